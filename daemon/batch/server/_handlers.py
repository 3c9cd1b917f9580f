"""What the daemon does for each verb of the bus."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerReader, LedgerWriter, count_states
from daemon.batch.paths import StatePaths
from daemon.batch.server._admission import Quota, admit_submission
from daemon.batch.server._dispatcher import VerbHandler
from daemon.batch.server._runtime import DaemonClock, DaemonSettings, EventLog
from daemon.batch.server._uploads import FileUploads, TraceUploads
from daemon.batch.server._workers import MOST_WORKERS, WorkerRegistry
from daemon.batch.stores import Marker, encode_chunk, is_url, read_part
from daemon.model.assessments import AssessmentRules, RunRecord
from daemon.model.messages import (
    Completion,
    Count,
    DownloadChunk,
    Empty,
    FileDownloadRequest,
    FileUploadChunk,
    IdRequest,
    KeyRequest,
    LeaseReply,
    LeaseRequest,
    LedgerAcknowledgement,
    LedgerAnswer,
    PriorityRequest,
    RecordQuery,
    ReleaseRequest,
    RenewReply,
    RenewRequest,
    RetryRequest,
    RunQuery,
    TraceDownloadRequest,
    TraceUploadChunk,
    UploadProgress,
    WelcomeReply,
    WorkerInfo,
)
from daemon.model.packed_submission import (
    Fingerprint,
    PackedSubmission,
    fingerprint,
    unpack_submission,
)
from daemon.model.spec import ENGINE_VERSION, install_hint, own_version, version_text
from daemon.model.status import (
    CampaignRow,
    DaemonOverview,
    DiskUsage,
    KeyDeliveries,
    RunDetail,
    RunPage,
    Submission,
    SubmissionReceipt,
    WorkerRow,
)
from daemon.model.verbs import (
    COMPLETE,
    LEASE,
    RELEASE,
    RENEW,
    SUBMIT,
    UPLOAD,
    VERBS,
    WELCOME,
    AnyVerb,
)
from grammars.model.scene import Scene
from grammars.text import codec

_NAMED: Final = frozenset({WELCOME, LEASE, RENEW, COMPLETE, RELEASE, UPLOAD})
"""What is done only for the key it was done for before: their methods get its name as well."""


@dataclass(frozen=True, slots=True)
class _AdmittedSubmission:
    submission: Submission
    fingerprint: Fingerprint


@dataclass
class Handlers:
    """What the daemon does when it is asked: a method for each verb, and so more than twenty.

    It has the name of the verb, and :mod:`daemon.model.verbs` says what it is for. It gets the
    validated request and what its thread owns of the ledger, and returns the answer.
    """

    paths: StatePaths
    settings: DaemonSettings
    registry: WorkerRegistry
    log: EventLog
    clock: DaemonClock
    quota: Quota
    version: str
    stop: Callable[[], None]
    trouble: Callable[[], str]
    marker: Marker
    draining: bool = False

    def __post_init__(self) -> None:
        self._identity = own_version()
        self._traces = TraceUploads(self.paths, self.log)
        self._files = FileUploads(self.paths, self.log)
        self._started_at = self.clock.now()
        self.by_verb = {verb: VerbHandler(self._method(verb)) for verb in VERBS.values()}
        # To unpack and check 100,000 runs takes seconds: not the writer's, leases wait for those.
        self.by_verb[SUBMIT] = VerbHandler(self._method(SUBMIT), prepare=self._admit)

    def _method(self, verb: AnyVerb) -> Callable[[Any, Any, str], object]:
        """Return what is done about a verb; few of them depend on whose key asks."""
        method: Callable[..., object] = getattr(self, verb.name)
        if verb in _NAMED:
            return method
        return lambda ledger, request, _: method(ledger, request)

    # Questions, each answered from one snapshot of the ledger

    def overview(self, ledger: LedgerReader, _: Empty) -> DaemonOverview:
        now = self.clock.now()
        campaigns, counts = ledger.counts()
        rate = ledger.rate(now)
        waiting = counts["queued"] + counts["running"]
        return DaemonOverview(
            version=self.version,
            state=str(self.paths.state),
            started_at=self._started_at,
            now=now,
            campaigns=campaigns,
            workers=len(self.registry.rows()),
            **count_states(counts),
            rate=rate,
            seconds_left=60.0 * waiting / rate if waiting and rate > 0.0 else None,
            trouble=self.trouble(),
        )

    def campaigns(self, ledger: LedgerReader, _: Empty) -> tuple[CampaignRow, ...]:
        return ledger.campaigns()

    def runs(self, ledger: LedgerReader, query: RunQuery) -> RunPage:
        return ledger.runs(query)

    def run(self, ledger: LedgerReader, request: IdRequest) -> RunDetail:
        return ledger.run(request.id)

    def declared(self, ledger: LedgerReader, request: IdRequest) -> AssessmentRules:
        return ledger.declared(request.id)

    def records(self, ledger: LedgerReader, query: RecordQuery) -> tuple[RunRecord, ...]:
        return ledger.records(query)

    def workers(self, _: LedgerReader, __: Empty) -> tuple[WorkerRow, ...]:
        return self.registry.rows()

    def scene(self, _: LedgerReader, request: IdRequest) -> Scene:
        try:
            data = self.paths.scene(request.id).read_bytes()
        except (OSError, ValueError) as error:
            raise Refused(f"there is no scene {request.id}") from error
        return codec.from_json(Scene, data)

    def welcome(self, _: LedgerReader, worker: WorkerInfo, asker: str) -> WelcomeReply:
        self._check_version(worker)
        self._check_holder(worker, asker)
        settings = self.settings
        return WelcomeReply(
            str(self.paths.state),
            self.version,
            ENGINE_VERSION,
            settings.lease,
            settings.renew,
            self.marker.identity,
            self.marker.probe,
            settings.store,
        )

    def disk(self, _: LedgerReader, __: Empty) -> DiskUsage:
        return replace(self.paths.disk(), traces=self.quota.used, quota=self.quota.limit)

    def shutdown(self, _: LedgerReader, __: Empty) -> Empty:
        self.log.write("shutdown requested")
        self.stop()
        return Empty()

    def deliveries(self, ledger: LedgerReader, request: KeyRequest) -> KeyDeliveries:
        return ledger.deliveries(request.id)

    # Megabytes, carried in a thread of their own

    def fetch(self, ledger: LedgerReader, request: TraceDownloadRequest) -> DownloadChunk:
        trace = ledger.trace_reference(request.run)
        if is_url(trace.location):
            raise Refused(f"the trace of {request.run} lies at {trace.location}: get it there")
        try:
            data = read_part(Path(trace.location), request.offset, request.count)
        except OSError as error:
            raise Refused(f"the trace of {request.run} cannot be read: {error.strerror}") from error
        if data and request.offset + len(data) == trace.size:
            self.log.write("trace fetched", run=request.run, bytes=trace.size)
        return DownloadChunk(request.offset, trace.size, trace.sha256, *encode_chunk(data))

    def upload(self, ledger: LedgerReader, chunk: TraceUploadChunk, asker: str) -> UploadProgress:
        return self._traces.add_chunk(ledger, chunk, asker)

    def keep(self, ledger: LedgerReader, chunk: FileUploadChunk) -> UploadProgress:
        return self._files.add_chunk(ledger, chunk)

    def file(self, ledger: LedgerReader, request: FileDownloadRequest) -> DownloadChunk:
        return self._files.read_chunk(ledger, request)

    # Changes of the ledger; each is answered after its commit

    def _admit(self, packed: PackedSubmission) -> _AdmittedSubmission:
        try:
            submission = unpack_submission(packed)
        except ValueError as error:
            raise Refused(f"the request is malformed: {error}") from error
        admit_submission(submission, self.paths)
        return _AdmittedSubmission(submission, fingerprint(submission))

    def submit(self, ledger: LedgerWriter, admitted: _AdmittedSubmission) -> SubmissionReceipt:
        receipt = ledger.submit(admitted.submission, self.clock.now(), admitted.fingerprint)
        self.log.write("submitted", **codec.to_plain(receipt))
        return receipt

    def cancel(self, ledger: LedgerWriter, request: IdRequest) -> Count:
        count = ledger.cancel(request.id, self.clock.now())
        self.log.write("cancelled", campaign=request.id, runs=count)
        return Count(count)

    def retry(self, ledger: LedgerWriter, request: RetryRequest) -> Count:
        count = ledger.retry(request, self.clock.now())
        self.log.write("retried", campaign=request.campaign, runs=count)
        return Count(count)

    def pause(self, ledger: LedgerWriter, request: IdRequest) -> Count:
        self.log.write("paused", campaign=request.id)
        return Count(ledger.pause(request.id, self.clock.now(), paused=True))

    def resume(self, ledger: LedgerWriter, request: IdRequest) -> Count:
        self.log.write("resumed", campaign=request.id)
        return Count(ledger.pause(request.id, self.clock.now(), paused=False))

    def prioritise(self, ledger: LedgerWriter, request: PriorityRequest) -> Empty:
        ledger.set_priority(request.campaign, request.priority, self.clock.now())
        self.log.write("prioritised", **codec.to_plain(request))
        return Empty()

    def void(self, ledger: LedgerWriter, request: KeyRequest) -> Generator[None, None, Count]:
        runs = 0
        for names in ledger.void_key(request.id, self.clock.now()):
            # Before the commit: afterwards the next result's trace may lie there already.
            for name in filter(None, names):
                self.paths.trace(name).unlink(missing_ok=True)
            runs += len(names)
            yield
        self.log.write("voided", key=request.id, runs=runs)
        return Count(runs)

    def lease(self, ledger: LedgerWriter, request: LeaseRequest, asker: str) -> LeaseReply:
        now = self.clock.now()
        ledger.check_trusted(asker)
        self._register_worker(ledger, request.worker, asker, now)
        if self.draining:
            return LeaseReply((), draining=True)
        if self.quota.trouble:
            return LeaseReply(())  # not an error: workers ask again until there is room
        worker, store = request.worker.id, self.settings.store
        slots = self.registry.slots(worker), self.registry.slots_of_holder(asker)
        count = min(request.count, ledger.room_for_leases(worker, asker, slots))
        leases = ledger.lease(worker, count, now, store=store, lacks=request.lacks, holder=asker)
        return LeaseReply(leases)

    def renew(self, ledger: LedgerWriter, request: RenewRequest, asker: str) -> RenewReply:
        now = self.clock.now()
        self._register_worker(ledger, request.worker, asker, now)
        return RenewReply(ledger.renew(request.worker.id, request.holds, now, holder=asker))

    def complete(
        self, ledger: LedgerWriter, completion: Completion, asker: str
    ) -> LedgerAcknowledgement:
        ledger.check_trusted(asker)
        # First the trace, then the result: a result in the ledger is a promise that its trace is
        # there. Settled before the commit, a crash in between leaves a file too many, never one
        # too few; the worker then hears nothing and completes again.
        ledger.check_completion(completion)
        if self._traces.is_missing(ledger, completion):
            return LedgerAcknowledgement(LedgerAnswer.MISSING)
        answer = ledger.complete(completion, self.clock.now(), holder=asker)
        self._traces.settle_result(ledger, completion, answer)
        if answer is LedgerAnswer.RECORDED and not completion.location:
            self.quota.add_bytes(completion.result.trace.size)
        if answer is LedgerAnswer.DIFFERS:
            self.log.write("nondeterminism", run=completion.run, worker=completion.worker)
        return LedgerAcknowledgement(answer)

    def release(
        self, ledger: LedgerWriter, request: ReleaseRequest, asker: str
    ) -> LedgerAcknowledgement:
        answer = ledger.release(request, self.clock.now(), holder=asker)
        self.log.write("released", run=request.run, reason=request.reason[-400:])
        return LedgerAcknowledgement(answer)

    def _check_version(self, worker: WorkerInfo) -> None:
        # Results must not depend on who computed them, and trace bytes do depend on the version.
        theirs = version_text(worker.version, worker.engine)
        if theirs != self._identity:
            raise Refused(
                f"worker {worker.id} has {theirs}, this daemon {self._identity}: "
                f"{install_hint(self._identity)}"
            )

    def _check_holder(self, worker: WorkerInfo, asker: str) -> None:
        if not self.registry.may_be(worker.id, asker):
            raise Refused(f"worker {worker.id} belongs to another key: choose another name for it")

    def _register_worker(
        self, ledger: LedgerWriter, worker: WorkerInfo, asker: str, now: float
    ) -> None:
        # With every request rather than once: after a restart the registry is empty, and workers
        # do not notice restarts.
        self._check_version(worker)
        self._check_holder(worker, asker)
        if self.registry.is_full(worker.id):
            raise Refused(f"worker {worker.id} has to wait: there are {MOST_WORKERS} already")
        if self.registry.record_contact(worker, now, asker):
            ledger.record_event(now, "worker", worker.id, state="came")
            self.log.write("worker came", worker=worker.id, slots=worker.slots)
