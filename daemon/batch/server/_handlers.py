"""Handlers of the verbs of the bus."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeAlias

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerReader, LedgerWriter, TimeLeft
from daemon.batch.paths import StatePaths
from daemon.batch.server._dispatcher import VerbHandler, read_request
from daemon.batch.server._housekeeping import Housekeeping
from daemon.batch.server._runtime import DaemonSettings, EventLog
from daemon.batch.server._submissions import read_extension, read_submission
from daemon.batch.server._uploads import DaemonFiles
from daemon.batch.server._workers import LeaseDeadlines, SearchClients, WorkerRegistry
from daemon.batch.stores import Marker, is_url, read_part
from daemon.model import verbs
from daemon.model.ids import is_id
from daemon.model.messages import (
    CampaignQuery,
    Completion,
    Count,
    DeleteRequest,
    Empty,
    FilePart,
    GetRequest,
    IdRequest,
    LeaseReply,
    LeaseRequest,
    LedgerAcknowledgement,
    LedgerAnswer,
    ReleaseRequest,
    RenewReply,
    RenewRequest,
    RetryRequest,
    SteerRequest,
    WelcomeReply,
    WorkerInfo,
)
from daemon.model.search import ExtendRequest, SearchSubmission
from daemon.model.search_answer import SearchProgress, SearchQuery, SearchRow
from daemon.model.status import (
    CampaignRow,
    DaemonOverview,
    DeletedCampaign,
    DiskUsage,
    Preparation,
    SubmissionReceipt,
    Trouble,
    TroubleCause,
    WorkerRow,
)
from daemon.model.submission import Submission
from grammars.text import codec

_FRESH: Final = 1.0
_REST: Final = 20.0
"""Period of estimates of the time left [s], and its least multiple of their duration (0.3 s with
100,000 runs). The estimate counts down in between."""
_MOST_TROUBLES: Final = 32
"""Most troubles in an overview: hundreds of workers may share one full disk."""
_ASKED: Final[tuple[verbs.AnyVerb, ...]] = (verbs.RUNS, verbs.RUN, verbs.DECLARED, verbs.ORIGIN)
"""Verbs that the ledger alone answers."""


_MeasuredDeletion: TypeAlias = tuple[DeleteRequest, dict[str, tuple[int, ...]]]
"""A request to delete campaigns, and the sizes of their traces by campaign [B]."""


@dataclass
class Handlers:
    """Handlers of all verbs: a method with the name of each, unless it would only forward.

    :mod:`daemon.model.verbs` describes the verbs. A method gets the ledger access of its thread and
    the validated request, and returns the answer.
    """

    paths: StatePaths
    settings: DaemonSettings
    registry: WorkerRegistry
    log: EventLog
    deadlines: LeaseDeadlines
    housekeeping: Housekeeping
    version: str
    stop: Callable[[], None]
    troubles: Callable[[], tuple[Trouble, ...]]
    marker: Marker
    starting: Callable[[], Preparation | None]
    draining: bool = False

    def __post_init__(self) -> None:
        self._files = DaemonFiles(self.paths, self.log)
        self._estimate, self._estimated_at = TimeLeft(), -math.inf
        self._estimate_again_at = -math.inf
        self._started_at = time.time()
        self.clients = SearchClients()
        others: dict[verbs.AnyVerb, Callable[[Any, Any], object]] = {
            verbs.PUT: self._files.put,
            **{verb: partial(_ask_ledger, verb) for verb in _ASKED},
        }
        self.by_verb: dict[verbs.AnyVerb, VerbHandler] = {
            verb: VerbHandler(others.get(verb) or getattr(self, verb.name))
            for verb in verbs.VERBS.values()
        }
        # Not in the writer's thread: checking 100,000 runs takes seconds, and leases would wait.
        for verb, read in ((verbs.SUBMIT, read_submission), (verbs.EXTEND, read_extension)):
            prepare = partial(read, paths=self.paths)
            self.by_verb[verb] = replace(self.by_verb[verb], prepare=prepare)
        self.by_verb[verbs.DELETE] = VerbHandler(self.delete, prepare=self._measure)

    # Read requests, each answered from one snapshot of the ledger

    def overview(self, ledger: LedgerReader, _: Empty) -> DaemonOverview:
        now = time.time()
        campaigns, counts = ledger.counts()
        rate = ledger.rate(now)
        halted, troubles = self._standing_troubles(ledger)
        workers = [row for row in self.registry.rows() if not row.away]
        return DaemonOverview(
            version=self.version,
            state=str(self.paths.state),
            started_at=self._started_at,
            now=now,
            campaigns=campaigns,
            workers=len(workers),
            **counts,
            rate=rate,
            seconds_left=self._time_left(ledger).all,
            halted=halted,
            troubles=troubles,
            preparation=next(filter(None, (w.preparation for w in workers)), self.starting()),
        )

    def campaigns(self, ledger: LedgerReader, query: CampaignQuery) -> tuple[CampaignRow, ...]:
        seconds = self._time_left(ledger).campaigns
        rows = (
            replace(row, search=self.clients.state(row.id)) if row.search == "waiting" else row
            for row in ledger.ask(verbs.CAMPAIGNS, query)
        )
        return tuple(
            row
            if row.paused or row.finished_at is not None
            else replace(row, seconds_left=seconds.get(row.id))
            for row in rows
        )

    def _time_left(self, ledger: LedgerReader) -> TimeLeft:
        start = time.monotonic()
        if start >= self._estimate_again_at:
            waits = self.draining or bool(self.housekeeping.trouble)
            self._estimate = ledger.time_left(
                time.time(),
                0 if waits else self.registry.slots(),
                self.registry.paces(),
                {row.id for row in self.registry.rows() if row.preparation is not None},
            )
            self._estimated_at = now = time.monotonic()
            self._estimate_again_at = now + max(_FRESH, _REST * (now - start))
        return self._estimate.after(time.monotonic() - self._estimated_at)

    def _standing_troubles(self, ledger: LedgerReader) -> tuple[bool, tuple[Trouble, ...]]:
        """Return whether the first trouble blocks all runs, and all troubles."""
        workers = [row for row in self.registry.rows() if not row.away]
        halting = list(self.troubles())
        here, texts = socket.gethostname(), {trouble.words for trouble in halting}
        idle = [
            Trouble(f"worker {row.id}: {row.trouble}", TroubleCause.WORKER)
            for row in workers
            # The daemon and a worker here share a full disk: report it once.
            if row.trouble and not (row.host == here and row.trouble in texts)
        ]
        if idle and len(idle) == len(workers) and not any(row.busy for row in workers):
            halting += idle[:1]
        notices = (Trouble(words, TroubleCause.WORKER) for words in self.registry.notices())
        inputs = (Trouble(words, TroubleCause.INPUT) for words in ledger.holds())
        troubles = dict.fromkeys((*halting, *idle, *notices, *inputs))
        return bool(halting), tuple(troubles)[:_MOST_TROUBLES]

    def searches(self, ledger: LedgerReader, query: SearchQuery) -> tuple[SearchRow, ...]:
        return tuple(
            replace(
                row,
                state=self.clients.state(row.campaign),
                client=self.clients.client(row.campaign),
            )
            if row.state == "waiting"
            else row
            for row in ledger.ask(verbs.SEARCHES, query)
        )

    def workers(self, ledger: LedgerReader, _: Empty) -> tuple[WorkerRow, ...]:
        runs = ledger.held_runs()
        return tuple(replace(row, runs=runs.get(row.id, ())) for row in self.registry.rows())

    def welcome(self, _: LedgerReader, worker: WorkerInfo) -> WelcomeReply:
        self.registry.check_version(worker)
        marker = self.marker
        return WelcomeReply(str(self.paths.state), self.settings.renew, marker.identity, marker.era)

    def disk(self, _: LedgerReader, __: Empty) -> DiskUsage:
        return replace(
            self.paths.disk(), traces=self.housekeeping.used, quota=self.housekeeping.limit
        )

    def shutdown(self, _: LedgerReader, __: Empty) -> Empty:
        self.log.write("shutdown requested")
        self.stop()
        return Empty()

    # Transfers of megabytes, in a thread of their own

    def get(self, ledger: LedgerReader, request: GetRequest) -> FilePart:
        path = self._path_of(ledger, request)
        try:
            return FilePart(path.stat().st_size, read_part(path, request.offset))
        except OSError as error:
            raise Refused(f"{path.name} cannot be read: {error.strerror}") from error

    def _path_of(self, ledger: LedgerReader, request: GetRequest) -> Path:
        if not request.run:
            scene, file = self.paths.scene(request.sha256), self.paths.files / request.sha256
            return scene if scene.exists() else file
        row = ledger.run(request.run).row
        if row.result is None or row.result.trace.sha256 != request.sha256:
            raise Refused(f"{request.run} has another trace now: ask again")
        if not row.trace:
            raise Refused(f"{request.run}: {row.reason}")
        if is_url(row.trace):
            raise Refused(f"the trace of {request.run} is at {row.trace}: get it there")
        return Path(row.trace)

    # Changes of the ledger; each is answered after its commit

    def submit(self, ledger: LedgerWriter, submission: Submission) -> SubmissionReceipt:
        ledger.end_holds(self._files.has, time.time())
        receipt = ledger.submit(submission, time.time())
        self.log.write("submitted", **codec.to_plain(receipt))
        return receipt

    def cancel(self, ledger: LedgerWriter, request: IdRequest) -> Count:
        count = ledger.cancel(request.id, time.time())
        self.log.write("cancelled", campaign=request.id, runs=count)
        return Count(count)

    def acknowledge(self, ledger: LedgerWriter, request: IdRequest) -> Count:
        count = ledger.acknowledge(request.id, time.time())
        self.log.write("acknowledged", campaign=request.id, runs=count)
        return Count(count)

    def retry(self, ledger: LedgerWriter, request: RetryRequest) -> Count:
        count = ledger.retry(request, time.time())
        self.log.write("retried", campaign=request.campaign, runs=count)
        return Count(count)

    def _measure(self, payload: bytes) -> _MeasuredDeletion:
        request = read_request(verbs.DELETE, payload)
        assert isinstance(request, DeleteRequest)
        campaigns = tuple(dict.fromkeys(request.campaigns))
        # Not in the writer's thread: there may be thousands of files.
        sizes = {one: self.paths.trace_sizes(one) for one in campaigns if is_id(one)}
        return replace(request, campaigns=campaigns), sizes

    def delete(
        self, ledger: LedgerWriter, deletion: _MeasuredDeletion
    ) -> tuple[DeletedCampaign, ...]:
        request, sizes = deletion
        counts = ledger.deletable(request.campaigns)
        deleted = tuple(
            DeletedCampaign(name, runs, len(sizes[name]), sum(sizes[name]))
            for name, runs in zip(request.campaigns, counts, strict=True)
        )
        if not request.dry:
            ledger.delete(request.campaigns, time.time())
            self.log.write("deleted", campaigns=request.campaigns[:20], runs=sum(counts))
        return deleted

    def steer(self, ledger: LedgerWriter, request: SteerRequest) -> Count:
        count = ledger.steer(request, time.time())
        self.log.write("steered", **codec.to_plain(request))
        return Count(count)

    def search(self, ledger: LedgerWriter, request: SearchSubmission) -> Empty:
        campaign = request.campaign
        if not is_id(campaign):
            words = f"{campaign!r} is not a campaign id: use up to 100 of A-Z a-z 0-9 _ -"
            raise Refused(words)
        ledger.begin_search(request, time.time())
        if request.client and self.clients.claim(campaign, request.client):
            self.log.write("search", campaign=campaign, client=request.client)
        return Empty()

    def extend(self, ledger: LedgerWriter, request: ExtendRequest) -> Count:
        self.clients.require(request.runs.campaign, request.client)
        return Count(ledger.extend(request.proposals, request.runs, time.time()))

    def progress(self, ledger: LedgerWriter, progress: SearchProgress) -> Empty:
        campaign = progress.campaign
        self.clients.require(campaign, progress.client)
        ledger.note_progress(progress, time.time())
        if progress.state != "running":
            self.clients.leave(campaign)
            state, note = progress.state, progress.note[:400]
            self.log.write("search left", campaign=campaign, state=state, note=note)
        return Empty()

    def lease(self, ledger: LedgerWriter, request: LeaseRequest) -> LeaseReply:
        now = time.time()
        self._register_worker(ledger, request.worker, now)
        if self.draining:
            return LeaseReply((), draining=True)
        if self.housekeeping.trouble:
            return LeaseReply(())  # not an error: workers ask again until there is space
        ledger.end_holds(self._files.has, now)
        return LeaseReply(
            ledger.lease(
                request.worker.id,
                request.count,
                now,
                lacks=request.lacks,
                missing=self._files.missing,
            )
        )

    def renew(self, ledger: LedgerWriter, request: RenewRequest) -> RenewReply:
        now = time.time()
        self._register_worker(ledger, request.worker, now)
        self.deadlines.renew(request.holds)
        return RenewReply(ledger.renew(request.worker.id, request.holds, now))

    def complete(self, ledger: LedgerWriter, completion: Completion) -> LedgerAcknowledgement:
        # First the trace, then the result: a result in the ledger implies its trace. The trace is
        # settled before the commit, so a crash in between leaves a file too many, never one too
        # few; the worker then gets no answer and completes again.
        ledger.require_era(completion.era, completion.token)
        ledger.check_completion(completion)
        if self._files.is_missing(ledger, completion):
            return LedgerAcknowledgement(LedgerAnswer.MISSING)
        answer = ledger.complete(completion, time.time())
        self._files.settle_result(ledger, completion, answer)
        if answer is LedgerAnswer.RECORDED:
            self.housekeeping.add_bytes(completion.result.trace.size)
        if answer is LedgerAnswer.DIFFERS:
            self.log.write("nondeterminism", run=completion.run, worker=completion.worker)
        return LedgerAcknowledgement(answer)

    def release(self, ledger: LedgerWriter, request: ReleaseRequest) -> LedgerAcknowledgement:
        ledger.require_era(request.era, request.token)
        if request.damaged:
            self._files.examine(request.damaged)
        answer = ledger.release(request, time.time())
        self.log.write("released", run=request.run, reason=request.reason[-400:])
        return LedgerAcknowledgement(answer)

    def _register_worker(self, ledger: LedgerWriter, worker: WorkerInfo, now: float) -> None:
        # With every request: a restart empties the registry, and workers do not notice it.
        self.registry.check_version(worker)
        ledger.require_era(worker.era)
        if self.registry.record_contact(worker):
            ledger.record_event(now, "worker", worker.id, state="came")
            self.log.write("worker came", worker=worker.id, slots=worker.slots)


def _ask_ledger(verb: verbs.AnyVerb, ledger: LedgerReader, request: object) -> object:
    return ledger.ask(verb, request)
