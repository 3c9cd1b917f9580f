"""Client of the daemon, for the command line and the dashboard."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

import zenoh

from daemon.batch import bus
from daemon.batch.paths import is_encrypted
from daemon.batch.security import Credentials, find_credentials, strip_control_characters
from daemon.batch.stores import upload
from daemon.model.attachments import user_files_folder
from daemon.model.live_judgement import LiveJudgement, unpack_judgement
from daemon.model.messages import EVENTS, JUDGED, LIVE
from daemon.model.spec import RunSpec
from daemon.model.status import ChangeEvent, LiveSnapshot, SubmissionReceipt
from daemon.model.submission import Submission
from daemon.model.verbs import SUBMIT, DaemonClient, Role, Verb
from grammars.text import codec

A = TypeVar("A")
T = TypeVar("T")
L = TypeVar("L", LiveSnapshot, LiveJudgement)

# Samples that wait during a long call. Many events, since a lost one means querying everything
# again; few snapshots of a watched run, since only the newest matter.
_EVENTS_KEPT: Final = 4096
_LIVE_KEPT: Final = 256
_WATCHED_KEPT: Final = 4
_JUDGED_KEPT: Final = 1
_LARGEST_SNAPSHOT: Final = 2**16
"""Bytes of JSON; a building with hundreds of joints takes some thousands."""
_SLOW_TIMEOUT: Final = 600.0
"""Timeout of a slow verb [s]."""


def read_snapshot(payload: bytes) -> LiveSnapshot:
    """Read a snapshot of a run; raises ``ValueError`` for implausible ones.

    Workers, and anybody in a cluster, may publish anything under the names of runs.
    """
    if len(payload) > _LARGEST_SNAPSHOT:
        raise ValueError(f"a snapshot of more than {_LARGEST_SNAPSHOT} bytes")
    return codec.from_json(LiveSnapshot, strip_control_characters(payload))


def _of_run(run: str, read: Callable[[bytes], L]) -> Callable[[bytes], L]:
    """Return a reader that raises ``ValueError`` for data of another run."""

    def read_own(payload: bytes) -> L:
        value = read(payload)
        if value.run != run:
            raise ValueError(f"it belongs to {value.run}")
        return value

    return read_own


class _Feed(threading.Thread, Generic[T]):
    """Forwards one key's samples in order; drops the oldest when calls take long.

    In a thread of its own: a slow callback of Zenoh stops everything on its link, including the
    answers to requests.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        capacity: int,
        read: Callable[[bytes], T],
        call: Callable[[T], None],
    ) -> None:
        super().__init__(name=f"listens to {key}", daemon=True)
        self._read = read
        self._call = call
        self._subscriber = session.declare_subscriber(key, zenoh.handlers.RingChannel(capacity))
        self.start()

    def run(self) -> None:
        """Forward samples until closed."""
        for sample in self._subscriber:
            try:
                value = self._read(sample.payload.to_bytes())
            except ValueError:
                continue  # not from our daemon; nothing relies on publications
            self._call(value)

    def close(self) -> None:
        """Stop; afterwards no call is in progress, unless this is one."""
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]
        if self is not threading.current_thread():
            self.join()


class Client(DaemonClient):
    """A connection to the daemon. Thread-safe; it reconnects when the daemon comes back."""

    def __init__(
        self,
        session: zenoh.Session,
        endpoint: str,
        timeout: float,
        credentials: Credentials | None = None,
    ) -> None:
        self._session = session
        self._credentials = credentials
        self._timeout = timeout
        self._subscriptions: set[ExitStack] = set()
        self.endpoint = self.where = endpoint

    @classmethod
    def open(cls, endpoint: str, *, timeout: float = 3.0, keys: Path | None = None) -> Client:
        """Connect to an endpoint (:func:`daemon.batch.paths.is_endpoint`).

        An encrypted one needs a key: from ``keys``, ``SCENARIO_KEYS`` or the user's settings, in
        this order. Raises :class:`Unreachable` when nobody answers.
        """
        credentials = find_credentials(Role.OPERATOR, keys) if is_encrypted(endpoint) else None
        return cls(bus.open_client(endpoint, credentials), endpoint, timeout, credentials)

    def close(self) -> None:
        """End the subscriptions and the connection."""
        for subscription in tuple(self._subscriptions):
            subscription.close()
        # Last: a process that exits with an open subscription hangs in Zenoh's threads. A hanging
        # daemon does not confirm; Zenoh drops the connection after ten seconds.
        with suppress(zenoh.ZError):
            self._session.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, verb: Verb[..., A], request: object) -> A:
        """Ask the daemon and return its answer."""
        timeout = max(self._timeout, _SLOW_TIMEOUT) if verb.slow else self._timeout
        return bus.ask(self._session, self.endpoint, verb, request, timeout, self._credentials)

    def submit(self, submission: Submission) -> SubmissionReceipt:
        """Submit a campaign, after the files that its runs need."""
        self.send_files(submission.cells)
        return self.ask(SUBMIT, submission)

    def send_files(self, runs: Sequence[RunSpec]) -> None:
        """Send the files and maps of runs that the daemon lacks."""
        for digest in dict.fromkeys(digest for run in runs for digest in run.files):
            path = user_files_folder() / digest
            if path.is_file():  # the daemon may have a file that is missing here
                put = partial(self.put, digest, path.stat().st_size)
                upload(path, put)

    def events(
        self,
        on_event: Callable[[ChangeEvent], None],
        on_live: Callable[[LiveSnapshot], None] | None = None,
    ) -> ExitStack:
        """Call back on every event, and on snapshots of running runs."""
        changes = partial(codec.from_json, ChangeEvent)
        feeds: list[_Feed[Any]]
        feeds = [_Feed(self._session, EVENTS, _EVENTS_KEPT, changes, on_event)]
        if on_live is not None:
            feeds.append(_Feed(self._session, f"{LIVE}/*/*", _LIVE_KEPT, read_snapshot, on_live))
        return self._subscription(feeds)

    def watch(
        self,
        run: str,
        on_live: Callable[[LiveSnapshot], None],
        on_judged: Callable[[LiveJudgement], None] | None = None,
    ) -> ExitStack:
        """Call back on detailed snapshots and judgements of one run while it runs.

        Data of another run under its name is ignored.
        """
        key, read = f"{LIVE}/*/*/{run}", _of_run(run, read_snapshot)
        feeds: list[_Feed[Any]] = [_Feed(self._session, key, _WATCHED_KEPT, read, on_live)]
        if on_judged is not None:
            # Clean judgements, which do not pass through the daemon.
            unpack = partial(unpack_judgement, clean=strip_control_characters)
            judgement = _of_run(run, unpack)
            feed = _Feed(self._session, f"{key}/{JUDGED}", _JUDGED_KEPT, judgement, on_judged)
            feeds.append(feed)
        return self._subscription(feeds)

    def _subscription(self, feeds: Sequence[_Feed[Any]]) -> ExitStack:
        """Return an object whose closing ends the feeds; afterwards no call is in progress."""
        subscription = ExitStack()
        # Forget closed ones: a client may watch one run after another all day.
        subscription.callback(self._subscriptions.discard, subscription)
        for feed in feeds:
            subscription.callback(feed.close)
        self._subscriptions.add(subscription)
        return subscription
