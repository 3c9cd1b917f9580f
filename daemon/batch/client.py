"""The client: everything people can ask the daemon, for the command line and the dashboard."""

from __future__ import annotations

import threading
from collections import deque
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
from daemon.model.messages import (
    EVENTS,
    JUDGED,
    LIVE,
)
from daemon.model.spec import RunSpec
from daemon.model.status import ChangeEvent, LiveSnapshot, SubmissionReceipt
from daemon.model.submission import Submission
from daemon.model.verbs import SUBMIT, DaemonClient, Role, Verb
from grammars.text import codec

A = TypeVar("A")
T = TypeVar("T")
L = TypeVar("L", LiveSnapshot, LiveJudgement)

# Samples that wait while a call takes long. Events must be many, for a lost one means asking for
# everything again; of a watched run nobody wants to see but the newest snapshots.
_EVENTS_KEPT: Final = 4096
_LIVE_KEPT: Final = 256
_WATCHED_KEPT: Final = 4
_JUDGED_KEPT: Final = 1
_LARGEST_SNAPSHOT: Final = 2**16
"""Bytes of JSON; a building with hundreds of joints takes some thousands."""
_SLOW_TIMEOUT: Final = 600.0
"""Seconds to wait for the answer to a slow verb."""


def read_snapshot(payload: bytes) -> LiveSnapshot:
    """Read a snapshot of a run; raises ``ValueError`` for what no run tells.

    Workers, and anybody in a cluster, may publish whatever they like under the names of runs.
    """
    if len(payload) > _LARGEST_SNAPSHOT:
        raise ValueError(f"a snapshot of more than {_LARGEST_SNAPSHOT} bytes")
    return codec.from_json(LiveSnapshot, strip_control_characters(payload))


def _read_judgement(payload: bytes) -> LiveJudgement:
    # It has not come through the daemon, which cleans what it takes.
    return unpack_judgement(payload, strip_control_characters)


def _of_run(run: str, read: Callable[[bytes], L]) -> Callable[[bytes], L]:
    """Return a reader that raises ``ValueError`` for what speaks of another run."""

    def read_own(payload: bytes) -> L:
        told = read(payload)
        if told.run != run:
            raise ValueError(f"it speaks of {told.run}")
        return told

    return read_own


class _Feed(threading.Thread, Generic[T]):
    """One key's samples, passed on in order; the oldest are dropped when calls take long.

    By a thread of its own: a slow callback of Zenoh's stops everything that comes over its link,
    the answers to questions too.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        kept: int,
        read: Callable[[bytes], T],
        call: Callable[[T], None],
    ) -> None:
        super().__init__(name=f"listens to {key}", daemon=True)
        self._read = read
        self._call = call
        self._waiting: deque[bytes] = deque(maxlen=kept)
        self._arrived = threading.Condition()
        self._closing = False
        self._subscriber = session.declare_subscriber(key, self._receive)
        self.start()

    def _receive(self, sample: zenoh.Sample) -> None:
        with self._arrived:
            self._waiting.append(sample.payload.to_bytes())
            self._arrived.notify()

    def run(self) -> None:
        """Pass on what arrives until closed."""
        while (payload := self._next()) is not None:
            try:
                value = self._read(payload)
            except ValueError:
                continue  # not from our daemon; what is published is never relied on
            self._call(value)

    def _next(self) -> bytes | None:
        with self._arrived:
            self._arrived.wait_for(lambda: self._waiting or self._closing)
            return None if self._closing else self._waiting.popleft()

    def close(self) -> None:
        """Stop; afterwards no call is under way, unless this is one."""
        # Before the thread is told to end, so that nothing arrives that nobody would pass on.
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]
        with self._arrived:
            self._closing = True
            self._arrived.notify()
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

        An encrypted one needs a key: that in ``keys``, else in ``SCENARIO_KEYS``, else in the
        user's settings. Raises :class:`Unreachable` when nobody is there.
        """
        credentials = find_credentials(Role.OPERATOR, keys) if is_encrypted(endpoint) else None
        return cls(bus.open_client(endpoint, credentials), endpoint, timeout, credentials)

    def close(self) -> None:
        """End the subscriptions and the connection."""
        for subscription in tuple(self._subscriptions):
            subscription.close()
        # Last: a process that leaves with a subscription open hangs in Zenoh's threads. A daemon
        # that hangs does not confirm it; Zenoh waits ten seconds and drops the connection then.
        with suppress(zenoh.ZError):
            self._session.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, verb: Verb[..., A], request: object) -> A:
        """Ask the daemon, return its answer."""
        timeout = max(self._timeout, _SLOW_TIMEOUT) if verb.slow else self._timeout
        return bus.ask(self._session, self.endpoint, verb, request, timeout, self._credentials)

    def submit(self, submission: Submission) -> SubmissionReceipt:
        """Hand over a campaign, after the files that its runs need."""
        self.send_files(submission.cells)
        return self.ask(SUBMIT, submission)

    def send_files(self, runs: Sequence[RunSpec]) -> None:
        """Send the files that runs need, their maps included, as far as the daemon lacks them."""
        for digest in dict.fromkeys(digest for run in runs for digest in run.files):
            path = user_files_folder() / digest
            if path.is_file():  # one that is not here may be there all the same
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
        """Call back on detailed snapshots of one run while it runs, and on how it is judged.

        What comes under its name and speaks of another run is left out.
        """
        key, seen = f"{LIVE}/*/*/{run}", _of_run(run, read_snapshot)
        feeds: list[_Feed[Any]] = [_Feed(self._session, key, _WATCHED_KEPT, seen, on_live)]
        if on_judged is not None:
            judged = _of_run(run, _read_judgement)
            feeds.append(_Feed(self._session, f"{key}/{JUDGED}", _JUDGED_KEPT, judged, on_judged))
        return self._subscription(feeds)

    def _subscription(self, feeds: Sequence[_Feed[Any]]) -> ExitStack:
        """Return what ends the feeds when it is closed; afterwards no call is under way."""
        subscription = ExitStack()
        # Who watches one run after another all day keeps none of them.
        subscription.callback(self._subscriptions.discard, subscription)
        for feed in feeds:
            subscription.callback(feed.close)
        self._subscriptions.add(subscription)
        return subscription
