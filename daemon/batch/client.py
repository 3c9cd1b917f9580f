"""The client: everything people can ask the daemon, for the command line and the dashboard."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Generic, TypeVar

import zenoh

from daemon.batch import bus
from daemon.batch.errors import Refused
from daemon.batch.paths import is_encrypted
from daemon.batch.security import Credentials, Role, find_credentials
from daemon.batch.stores import FileUpload
from daemon.model.assessments import AssessmentRules, RunRecord
from daemon.model.attachments import attached_digests, user_files_folder
from daemon.model.messages import (
    EVENTS,
    LARGEST_CHUNK,
    LIVE,
    Count,
    DownloadChunk,
    Empty,
    FileUploadChunk,
    IdRequest,
    PriorityRequest,
    RecordQuery,
    RetryRequest,
    RunQuery,
    TraceDownloadRequest,
    UploadProgress,
    Verb,
)
from daemon.model.packed_submission import pack_submission
from daemon.model.status import (
    CampaignRow,
    ChangeEvent,
    DaemonOverview,
    DiskUsage,
    LiveSnapshot,
    RunDetail,
    RunPage,
    Submission,
    SubmissionReceipt,
    WorkerRow,
)
from grammars.model.scene import Scene
from grammars.text import codec

T = TypeVar("T")

_EVENTS_KEPT: Final = 4096
_LIVE_KEPT: Final = 256
_WATCHED_KEPT: Final = 4
_BULK_TIMEOUT: Final = 60.0
_RECORDS: Final = 500
_FAULTS: Final = 5


class _Feed(threading.Thread, Generic[T]):
    """One key's samples, passed on in order; the oldest are dropped when calls take long."""

    def __init__(
        self, session: zenoh.Session, key: str, kept: int, kind: type[T], call: Callable[[T], None]
    ) -> None:
        super().__init__(name=f"listens to {key}", daemon=True)
        self._kind = kind
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
                value = codec.from_json(self._kind, payload)
            except ValueError:
                continue  # not from our daemon; what is published is never relied on
            self._call(value)

    def _next(self) -> bytes | None:
        with self._arrived:
            self._arrived.wait_for(lambda: self._waiting or self._closing)
            return None if self._closing else self._waiting.popleft()

    def close(self) -> None:
        """Stop; afterwards no call is under way, unless this is one."""
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]
        with self._arrived:
            self._closing = True
            self._arrived.notify()
        if self is not threading.current_thread():
            self.join()


class Subscription:
    """Calls back with what the daemon publishes, from threads of its own, until closed."""

    def __init__(self) -> None:
        self._feeds: list[_Feed[Any]] = []

    def close(self) -> None:
        """Stop calling back; afterwards no call is under way (unless this is one)."""
        while self._feeds:
            self._feeds.pop().close()

    def __enter__(self) -> Subscription:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Client:
    """A connection to the daemon. Thread-safe; it reconnects when the daemon comes back.

    Every question raises :class:`daemon.batch.errors.Unreachable` when nobody answers and
    :class:`daemon.batch.errors.Refused` when the daemon says no.
    """

    def __init__(
        self,
        session: zenoh.Session,
        endpoint: str,
        timeout: float,
        holder: Credentials | None = None,
    ) -> None:
        self._session = session
        self._holder = holder
        self._timeout = timeout
        self._subscriptions: list[Subscription] = []
        self.endpoint = endpoint

    @classmethod
    def open(cls, endpoint: str, *, timeout: float = 3.0, keys: Path | None = None) -> Client:
        """Connect to an endpoint (:func:`daemon.batch.paths.is_endpoint`).

        An encrypted one needs a key: that in ``keys``, else in ``SCENARIO_KEYS``, else in the
        user's settings. Raises :class:`Unreachable` when nobody is there.
        """
        holder = find_credentials(Role.OPERATOR, keys) if is_encrypted(endpoint) else None
        return cls(bus.open_client(endpoint, holder), endpoint, timeout, holder)

    def close(self) -> None:
        """End the subscriptions and the connection."""
        for subscription in self._subscriptions:
            subscription.close()
        self._subscriptions.clear()
        self._session.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _ask(self, verb: Verb, request: object, kind: type[T]) -> T:
        return bus.ask(
            self._session, self.endpoint, verb, request, kind, self._timeout, self._holder
        )

    def _ask_bulk(self, verb: Verb, request: object, kind: type[T]) -> T:
        """Ask for something that may take long, with 100,000 runs say."""
        timeout = max(self._timeout, _BULK_TIMEOUT)
        return bus.ask(self._session, self.endpoint, verb, request, kind, timeout, self._holder)

    def overview(self) -> DaemonOverview:
        """How everything stands, in one line."""
        return self._ask(Verb.OVERVIEW, Empty(), DaemonOverview)

    def submit(self, submission: Submission) -> SubmissionReceipt:
        """Hand over a campaign; the receipt says that it is safely in the ledger.

        Submitting the same again (after :class:`Unreachable`, say) is harmless. Files that its
        systems under test need go first, from :func:`daemon.model.attachments.user_files_folder`.
        """
        suts = {id(run.sut): run.sut for run in (*submission.runs, *submission.reserve)}
        digests = (attached_digests(sut.parameters).values() for sut in suts.values())
        for digest in dict.fromkeys(chain.from_iterable(digests)):
            self._keep(digest, user_files_folder() / digest)
        return self._ask_bulk(Verb.SUBMIT, pack_submission(submission), SubmissionReceipt)

    def _keep(self, digest: str, path: Path) -> None:
        """Send a file the daemon lacks; one that is not here may be there all the same."""
        if not path.is_file():
            return
        upload, size = FileUpload(path), path.stat().st_size

        def ask(offset: int, text: str, sha256: str) -> UploadProgress:
            chunk = FileUploadChunk(digest, size, offset, text, sha256)
            return self._ask_bulk(Verb.KEEP, chunk, UploadProgress)

        while not upload.complete:
            upload.send_next(ask, LARGEST_CHUNK)
            if upload.faults > _FAULTS:
                raise Refused(f"the file {path} does not arrive: {upload.problem}")

    def campaigns(self) -> tuple[CampaignRow, ...]:
        """All campaigns, the newest first."""
        return self._ask(Verb.CAMPAIGNS, Empty(), tuple[CampaignRow, ...])

    def runs(
        self,
        campaign: str = "",
        *,
        state: str = "",
        outcome: str = "",
        text: str = "",
        sort: str = "index",
        descending: bool = False,
        offset: int = 0,
        limit: int = 200,
        scenario: str = "",
        sut: str = "",
    ) -> RunPage:
        """A page of at most 1000 runs; ``sort`` names a field of :class:`RunRow`.

        ``text`` is looked for in label, oracle, reason and id, ignoring case.
        """
        query = RunQuery(
            campaign, state, outcome, text, sort, descending, offset, limit, scenario, sut
        )
        return self._ask(Verb.RUNS, query, RunPage)

    def run(self, run: str) -> RunDetail:
        """Everything about one run."""
        return self._ask(Verb.RUN, IdRequest(run), RunDetail)

    def declared(self, campaign: str) -> AssessmentRules:
        """What a campaign declares about its results: policy, comparisons, expectations."""
        return self._ask(Verb.DECLARED, IdRequest(campaign), AssessmentRules)

    def records(self, campaign: str) -> tuple[RunRecord, ...]:
        """Every run of a campaign with its verdicts, in order: what assessments are made of."""
        found: list[RunRecord] = []
        while True:
            query = RecordQuery(campaign, len(found), _RECORDS)
            page = self._ask_bulk(Verb.RECORDS, query, tuple[RunRecord, ...])
            found.extend(page)
            if len(page) < _RECORDS:
                return tuple(found)

    def scene(self, digest: str) -> Scene:
        """A compiled scene."""
        return self._ask(Verb.SCENE, IdRequest(digest), Scene)

    def piece(self, run: str, offset: int) -> DownloadChunk:
        """A part of the trace of a run, from ``offset`` on; see :func:`daemon.batch.stores.local_copy`."""
        return self._ask_bulk(Verb.FETCH, TraceDownloadRequest(run, offset), DownloadChunk)

    def workers(self) -> tuple[WorkerRow, ...]:
        """The workers connected now."""
        return self._ask(Verb.WORKERS, Empty(), tuple[WorkerRow, ...])

    def disk(self) -> DiskUsage:
        """How much space there is where the daemon keeps things."""
        return self._ask(Verb.DISK, Empty(), DiskUsage)

    def cancel(self, campaign: str) -> int:
        """Cancel what is queued or running; returns the number of runs."""
        return self._ask_bulk(Verb.CANCEL, IdRequest(campaign), Count).count

    def retry(self, campaign: str, *, only: str = "lost|cancelled") -> int:
        """Queue runs again; returns how many.

        ``only`` lists, separated by ``|``: ``lost``, ``cancelled``, an outcome, or ``all``. A run
        that has a result keeps it: executing it again checks that it comes out the same.
        """
        words = tuple(word.strip() for word in only.split("|") if word.strip())
        return self._ask_bulk(Verb.RETRY, RetryRequest(campaign, words), Count).count

    def pause(self, campaign: str) -> int:
        """Start no more runs of a campaign; returns how many wait. What is running goes on."""
        return self._ask(Verb.PAUSE, IdRequest(campaign), Count).count

    def resume(self, campaign: str) -> int:
        """Go on with a paused campaign; returns how many of its runs are queued."""
        return self._ask(Verb.RESUME, IdRequest(campaign), Count).count

    def prioritise(self, campaign: str, priority: int) -> None:
        """Let a campaign go before those of lower priority (-1000 to 1000, 0 is usual)."""
        self._ask(Verb.PRIORITISE, PriorityRequest(campaign, priority), Empty)

    def shutdown(self) -> None:
        """Ask the daemon to leave; what is running gets a while to finish."""
        self._ask(Verb.SHUTDOWN, Empty(), Empty)

    def events(
        self,
        on_event: Callable[[ChangeEvent], None],
        on_live: Callable[[LiveSnapshot], None] | None = None,
    ) -> Subscription:
        """Call back on every event, and on snapshots of running runs.

        The calls come from other threads, one per kind, in order. Events may be lost when calls
        take long or the connection breaks: then ``seq`` has a gap, and asking again is right.
        """
        subscription = Subscription()
        self._subscriptions.append(subscription)
        feeds = subscription._feeds
        feeds.append(_Feed(self._session, EVENTS, _EVENTS_KEPT, ChangeEvent, on_event))
        if on_live is not None:
            feeds.append(_Feed(self._session, f"{LIVE}/*", _LIVE_KEPT, LiveSnapshot, on_live))
        return subscription

    def watch(self, run: str, on_live: Callable[[LiveSnapshot], None]) -> Subscription:
        """Call back on detailed snapshots of one run while it runs, about ten a second.

        Whoever executes it makes them only while somebody watches. Calls come from another thread.
        """
        subscription = Subscription()
        self._subscriptions.append(subscription)
        key = f"{LIVE}/*/{run}"
        subscription._feeds.append(_Feed(self._session, key, _WATCHED_KEPT, LiveSnapshot, on_live))
        return subscription
