"""What the daemon does for each verb of the bus."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerReader, LedgerWriter, count_states
from daemon.batch.paths import StatePaths
from daemon.batch.server._admission import admit_submission
from daemon.batch.server._dispatcher import VerbHandler
from daemon.batch.server._quota import Quota
from daemon.batch.server._runtime import DaemonClock, EventLog
from daemon.batch.server._settings import DaemonSettings
from daemon.batch.server._uploads import FileUploads, TraceUploads
from daemon.batch.server._workers import MOST_WORKERS, WorkerRegistry
from daemon.batch.stores import Marker, encode_chunk, is_url, read_part
from daemon.model.assessments import RunRecord
from daemon.model.messages import (
    Completion,
    Count,
    DownloadChunk,
    Empty,
    FileDownloadRequest,
    FileUploadChunk,
    IdRequest,
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
    Verb,
    WelcomeReply,
    WorkerInfo,
)
from daemon.model.packed_submission import (
    Fingerprint,
    PackedSubmission,
    fingerprint,
    unpack_submission,
)
from daemon.model.spec import ENGINE_VERSION
from daemon.model.status import CampaignRow, DaemonOverview, DiskUsage, Submission, WorkerRow
from daemon.model.versions import install_hint, own_version, version_text
from grammars.model.scene import Scene
from grammars.text import codec


@dataclass(frozen=True, slots=True)
class _AdmittedSubmission:
    submission: Submission
    fingerprint: Fingerprint


class Handlers:
    """Everything the daemon can be asked: its ``services`` by verb."""

    def __init__(
        self,
        places: StatePaths,
        settings: DaemonSettings,
        roster: WorkerRegistry,
        journal: EventLog,
        clock: DaemonClock,
        quota: Quota,
        *,
        version: str,
        stop: Callable[[], None],
        trouble: Callable[[], str],
        marker: Marker,
    ) -> None:
        self._places = places
        self._settings = settings
        self._roster = roster
        self._journal = journal
        self._clock = clock
        self._quota = quota
        self._stop = stop
        self._trouble = trouble
        self._version = version
        self._identity = own_version()
        self._marker = marker
        self._intake = TraceUploads(places, journal)
        self._files = FileUploads(places, journal)
        self._started_at = clock.now()
        self.draining = False
        self.services = self._reading() | self._writing() | self._carrying()

    def _reading(self) -> dict[Verb, VerbHandler]:
        return {
            Verb.OVERVIEW: VerbHandler(Empty, self._overview),
            Verb.CAMPAIGNS: VerbHandler(
                Empty, lambda r, _: r.campaigns(), answer=tuple[CampaignRow, ...]
            ),
            Verb.RUNS: VerbHandler(RunQuery, lambda r, query: r.runs(query)),
            Verb.RUN: VerbHandler(IdRequest, lambda r, named: r.run(named.id)),
            Verb.DECLARED: VerbHandler(IdRequest, lambda r, named: r.declared(named.id)),
            Verb.RECORDS: VerbHandler(
                RecordQuery, lambda r, query: r.records(query), answer=tuple[RunRecord, ...]
            ),
            Verb.SCENE: VerbHandler(IdRequest, self._scene),
            Verb.WORKERS: VerbHandler(
                Empty, lambda _, __: self._roster.rows(), answer=tuple[WorkerRow, ...]
            ),
            Verb.DISK: VerbHandler(Empty, self._disk),
            Verb.WELCOME: VerbHandler(WorkerInfo, self._welcome),
            Verb.SHUTDOWN: VerbHandler(Empty, self._shutdown),
        }

    def _writing(self) -> dict[Verb, VerbHandler]:
        return {
            Verb.SUBMIT: VerbHandler(
                PackedSubmission, self._submit, writes=True, prepare=self._admit
            ),
            Verb.CANCEL: VerbHandler(IdRequest, self._cancel, writes=True),
            Verb.RETRY: VerbHandler(RetryRequest, self._retry, writes=True),
            Verb.PAUSE: VerbHandler(IdRequest, self._pause, writes=True),
            Verb.RESUME: VerbHandler(IdRequest, self._resume, writes=True),
            Verb.PRIORITISE: VerbHandler(PriorityRequest, self._prioritise, writes=True),
            Verb.LEASE: VerbHandler(LeaseRequest, self._lease, writes=True),
            Verb.RENEW: VerbHandler(RenewRequest, self._renew, writes=True),
            Verb.COMPLETE: VerbHandler(Completion, self._complete, writes=True),
            Verb.RELEASE: VerbHandler(ReleaseRequest, self._release, writes=True),
        }

    def _carrying(self) -> dict[Verb, VerbHandler]:
        """What moves megabytes has a clerk of its own: nobody's question waits for it."""
        return {
            Verb.UPLOAD: VerbHandler(
                TraceUploadChunk, lambda r, chunk: self._intake.add_chunk(r, chunk), carries=True
            ),
            Verb.FETCH: VerbHandler(TraceDownloadRequest, self._fetch, carries=True),
            Verb.KEEP: VerbHandler(FileUploadChunk, self._files.add_chunk, carries=True),
            Verb.FILE: VerbHandler(FileDownloadRequest, self._files.read_chunk, carries=True),
        }

    def _overview(self, reader: LedgerReader, _: Empty) -> DaemonOverview:
        now = self._clock.now()
        campaigns, counts = reader.counts()
        rate = reader.rate(now)
        waiting = counts["queued"] + counts["running"]
        return DaemonOverview(
            version=self._version,
            state=str(self._places.state),
            started_at=self._started_at,
            now=now,
            campaigns=campaigns,
            workers=len(self._roster.rows()),
            **count_states(counts),
            rate=rate,
            seconds_left=60.0 * waiting / rate if waiting and rate > 0.0 else None,
            trouble=self._trouble(),
        )

    def _scene(self, _: LedgerReader, named: IdRequest) -> Scene:
        try:
            data = self._places.scene(named.id).read_bytes()
        except (OSError, ValueError) as error:
            raise Refused(f"there is no scene {named.id}") from error
        return codec.from_json(Scene, data)

    def _welcome(self, _: LedgerReader, worker: WorkerInfo) -> WelcomeReply:
        self._check(worker)
        settings = self._settings
        return WelcomeReply(
            str(self._places.state),
            self._version,
            ENGINE_VERSION,
            settings.lease,
            settings.renew,
            self._marker.identity,
            self._marker.probe,
            settings.store,
        )

    def _fetch(self, reader: LedgerReader, fetch: TraceDownloadRequest) -> DownloadChunk:
        trace = reader.trace_reference(fetch.run)
        if is_url(trace.location):
            raise Refused(f"the trace of {fetch.run} lies at {trace.location}: get it there")
        try:
            data = read_part(Path(trace.location), fetch.offset, fetch.count)
        except OSError as error:
            raise Refused(f"the trace of {fetch.run} cannot be read: {error.strerror}") from error
        if data and fetch.offset + len(data) == trace.size:
            self._journal.write("trace fetched", run=fetch.run, bytes=trace.size)
        return DownloadChunk(fetch.offset, trace.size, trace.sha256, *encode_chunk(data))

    def _disk(self, _: LedgerReader, __: Empty) -> DiskUsage:
        return replace(self._places.disk(), traces=self._quota.used, quota=self._quota.limit)

    def _shutdown(self, _: LedgerReader, __: Empty) -> Empty:
        self._journal.write("shutdown requested")
        self._stop()
        return Empty()

    def _admit(self, parcel: PackedSubmission) -> _AdmittedSubmission:
        try:
            submission = unpack_submission(parcel)
        except ValueError as error:
            raise Refused(f"the request is malformed: {error}") from error
        admit_submission(submission, self._places)
        return _AdmittedSubmission(submission, fingerprint(submission))

    def _submit(self, book: LedgerWriter, admitted: _AdmittedSubmission) -> object:
        receipt = book.submit(admitted.submission, self._clock.now(), admitted.fingerprint)
        self._journal.write("submitted", **codec.to_plain(receipt))
        return receipt

    def _cancel(self, book: LedgerWriter, named: IdRequest) -> Count:
        count = book.cancel(named.id, self._clock.now())
        self._journal.write("cancelled", campaign=named.id, runs=count)
        return Count(count)

    def _retry(self, book: LedgerWriter, request: RetryRequest) -> Count:
        count = book.retry(request, self._clock.now())
        self._journal.write("retried", campaign=request.campaign, runs=count)
        return Count(count)

    def _pause(self, book: LedgerWriter, named: IdRequest) -> Count:
        self._journal.write("paused", campaign=named.id)
        return Count(book.pause(named.id, self._clock.now(), paused=True))

    def _resume(self, book: LedgerWriter, named: IdRequest) -> Count:
        self._journal.write("resumed", campaign=named.id)
        return Count(book.pause(named.id, self._clock.now(), paused=False))

    def _prioritise(self, book: LedgerWriter, request: PriorityRequest) -> Empty:
        book.set_priority(request.campaign, request.priority, self._clock.now())
        self._journal.write("prioritised", **codec.to_plain(request))
        return Empty()

    def _check(self, worker: WorkerInfo) -> None:
        theirs = version_text(worker.version, worker.engine)
        if theirs != self._identity:
            raise Refused(
                f"worker {worker.id} has {theirs}, this daemon {self._identity}: "
                f"{install_hint(self._identity)}"
            )

    def _meet(self, book: LedgerWriter, worker: WorkerInfo, now: float) -> None:
        self._check(worker)
        if self._roster.is_full(worker.id):
            raise Refused(f"worker {worker.id} has to wait: there are {MOST_WORKERS} already")
        if self._roster.record_contact(worker, now):
            book.record_event(now, "worker", worker.id, state="came")
            self._journal.write("worker came", worker=worker.id, slots=worker.slots)

    def _lease(self, book: LedgerWriter, request: LeaseRequest) -> LeaseReply:
        now = self._clock.now()
        self._meet(book, request.worker, now)
        if self.draining:
            return LeaseReply((), draining=True)
        if self._quota.trouble:
            return LeaseReply(())
        store = self._settings.store
        grants = book.lease(request.worker.id, request.count, now, store=store, lacks=request.lacks)
        return LeaseReply(grants)

    def _renew(self, book: LedgerWriter, request: RenewRequest) -> RenewReply:
        now = self._clock.now()
        self._meet(book, request.worker, now)
        return RenewReply(book.renew(request.worker.id, request.holds, now))

    def _complete(self, book: LedgerWriter, completion: Completion) -> LedgerAcknowledgement:
        book.check_completion(completion)
        if self._intake.is_missing(book, completion):
            return LedgerAcknowledgement(LedgerAnswer.MISSING)
        answer = book.complete(completion, self._clock.now())
        self._intake.settle_result(book, completion, answer)
        if answer is LedgerAnswer.RECORDED and not completion.location:
            self._quota.add_bytes(completion.result.trace.size)
        if answer == "differs":
            self._journal.write("nondeterminism", run=completion.run, worker=completion.worker)
        return LedgerAcknowledgement(answer)

    def _release(self, book: LedgerWriter, release: ReleaseRequest) -> LedgerAcknowledgement:
        answer = book.release(release, self._clock.now())
        self._journal.write("released", run=release.run, reason=release.reason[-400:])
        return LedgerAcknowledgement(answer)
