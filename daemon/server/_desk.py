"""The desk: everything the daemon can be asked, by verb."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from daemon.assessment import RunRecord
from daemon.errors import Refused
from daemon.ledger import Book, Reader, standing
from daemon.messages import (
    Acknowledgement,
    Answer,
    Chunk,
    Completion,
    Fetch,
    FetchFile,
    Keep,
    LeaseReply,
    LeaseRequest,
    Named,
    Nothing,
    Number,
    Piece,
    PriorityRequest,
    RecordQuery,
    Release,
    RenewReply,
    RenewRequest,
    RetryRequest,
    RunQuery,
    Verb,
    Welcome,
    WorkerInfo,
)
from daemon.parcel import Fingerprint, Parcel, fingerprint, unpack
from daemon.places import Places
from daemon.protocol import CampaignRow, Disk, Overview, Submission, WorkerRow
from daemon.server._admission import admit
from daemon.server._clock import Clock
from daemon.server._counter import Service
from daemon.server._files import Files
from daemon.server._intake import Intake
from daemon.server._journal import Journal
from daemon.server._quota import Quota
from daemon.server._roster import MOST_WORKERS, Roster
from daemon.server._settings import Settings
from daemon.spec import ENGINE_VERSION
from daemon.store import Marker, is_url, packed, read_part
from daemon.versions import identity, named, remedy
from grammars import codec
from grammars.scene import Scene


@dataclass(frozen=True, slots=True)
class _Admitted:
    submission: Submission
    fingerprint: Fingerprint


class Desk:
    """Everything the daemon can be asked: its ``services`` by verb."""

    def __init__(
        self,
        places: Places,
        settings: Settings,
        roster: Roster,
        journal: Journal,
        clock: Clock,
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
        self._identity = identity()
        self._marker = marker
        self._intake = Intake(places, journal)
        self._files = Files(places, journal)
        self._started_at = clock.now()
        self.draining = False
        self.services = self._reading() | self._writing() | self._carrying()

    def _reading(self) -> dict[Verb, Service]:
        return {
            Verb.OVERVIEW: Service(Nothing, self._overview),
            Verb.CAMPAIGNS: Service(
                Nothing, lambda r, _: r.campaigns(), answer=tuple[CampaignRow, ...]
            ),
            Verb.RUNS: Service(RunQuery, lambda r, query: r.runs(query)),
            Verb.RUN: Service(Named, lambda r, named: r.run(named.id)),
            Verb.DECLARED: Service(Named, lambda r, named: r.declared(named.id)),
            Verb.RECORDS: Service(
                RecordQuery, lambda r, query: r.records(query), answer=tuple[RunRecord, ...]
            ),
            Verb.SCENE: Service(Named, self._scene),
            Verb.WORKERS: Service(
                Nothing, lambda _, __: self._roster.rows(), answer=tuple[WorkerRow, ...]
            ),
            Verb.DISK: Service(Nothing, self._disk),
            Verb.WELCOME: Service(WorkerInfo, self._welcome),
            Verb.SHUTDOWN: Service(Nothing, self._shutdown),
        }

    def _writing(self) -> dict[Verb, Service]:
        return {
            Verb.SUBMIT: Service(Parcel, self._submit, writes=True, prepare=self._admit),
            Verb.CANCEL: Service(Named, self._cancel, writes=True),
            Verb.RETRY: Service(RetryRequest, self._retry, writes=True),
            Verb.PAUSE: Service(Named, self._pause, writes=True),
            Verb.RESUME: Service(Named, self._resume, writes=True),
            Verb.PRIORITISE: Service(PriorityRequest, self._prioritise, writes=True),
            Verb.LEASE: Service(LeaseRequest, self._lease, writes=True),
            Verb.RENEW: Service(RenewRequest, self._renew, writes=True),
            Verb.COMPLETE: Service(Completion, self._complete, writes=True),
            Verb.RELEASE: Service(Release, self._release, writes=True),
        }

    def _carrying(self) -> dict[Verb, Service]:
        """What moves megabytes has a clerk of its own: nobody's question waits for it."""
        return {
            Verb.UPLOAD: Service(Chunk, lambda r, chunk: self._intake.take(r, chunk), carries=True),
            Verb.FETCH: Service(Fetch, self._fetch, carries=True),
            Verb.KEEP: Service(Keep, self._files.take, carries=True),
            Verb.FILE: Service(FetchFile, self._files.piece, carries=True),
        }

    def _overview(self, reader: Reader, _: Nothing) -> Overview:
        now = self._clock.now()
        campaigns, counts = reader.counts()
        rate = reader.rate(now)
        waiting = counts["queued"] + counts["running"]
        return Overview(
            version=self._version,
            state=str(self._places.state),
            started_at=self._started_at,
            now=now,
            campaigns=campaigns,
            workers=len(self._roster.rows()),
            **standing(counts),
            rate=rate,
            seconds_left=60.0 * waiting / rate if waiting and rate > 0.0 else None,
            trouble=self._trouble(),
        )

    def _scene(self, _: Reader, named: Named) -> Scene:
        try:
            data = self._places.scene(named.id).read_bytes()
        except (OSError, ValueError) as error:
            raise Refused(f"there is no scene {named.id}") from error
        return codec.from_json(Scene, data)

    def _welcome(self, _: Reader, worker: WorkerInfo) -> Welcome:
        self._check(worker)
        settings = self._settings
        return Welcome(
            str(self._places.state),
            self._version,
            ENGINE_VERSION,
            settings.lease,
            settings.renew,
            self._marker.identity,
            self._marker.probe,
            settings.store,
        )

    def _fetch(self, reader: Reader, fetch: Fetch) -> Piece:
        trace = reader.trace(fetch.run)
        if is_url(trace.location):
            raise Refused(f"the trace of {fetch.run} lies at {trace.location}: get it there")
        try:
            data = read_part(Path(trace.location), fetch.offset, fetch.count)
        except OSError as error:
            raise Refused(f"the trace of {fetch.run} cannot be read: {error.strerror}") from error
        if data and fetch.offset + len(data) == trace.size:
            self._journal.write("trace fetched", run=fetch.run, bytes=trace.size)
        return Piece(fetch.offset, trace.size, trace.sha256, *packed(data))

    def _disk(self, _: Reader, __: Nothing) -> Disk:
        return replace(self._places.disk(), traces=self._quota.used, quota=self._quota.limit)

    def _shutdown(self, _: Reader, __: Nothing) -> Nothing:
        self._journal.write("shutdown requested")
        self._stop()
        return Nothing()

    def _admit(self, parcel: Parcel) -> _Admitted:
        try:
            submission = unpack(parcel)
        except ValueError as error:
            raise Refused(f"the request is malformed: {error}") from error
        admit(submission, self._places)
        return _Admitted(submission, fingerprint(submission))

    def _submit(self, book: Book, admitted: _Admitted) -> object:
        receipt = book.submit(admitted.submission, self._clock.now(), admitted.fingerprint)
        self._journal.write("submitted", **codec.to_plain(receipt))
        return receipt

    def _cancel(self, book: Book, named: Named) -> Number:
        count = book.cancel(named.id, self._clock.now())
        self._journal.write("cancelled", campaign=named.id, runs=count)
        return Number(count)

    def _retry(self, book: Book, request: RetryRequest) -> Number:
        count = book.retry(request, self._clock.now())
        self._journal.write("retried", campaign=request.campaign, runs=count)
        return Number(count)

    def _pause(self, book: Book, named: Named) -> Number:
        self._journal.write("paused", campaign=named.id)
        return Number(book.pause(named.id, self._clock.now(), paused=True))

    def _resume(self, book: Book, named: Named) -> Number:
        self._journal.write("resumed", campaign=named.id)
        return Number(book.pause(named.id, self._clock.now(), paused=False))

    def _prioritise(self, book: Book, request: PriorityRequest) -> Nothing:
        book.prioritise(request.campaign, request.priority, self._clock.now())
        self._journal.write("prioritised", **codec.to_plain(request))
        return Nothing()

    def _check(self, worker: WorkerInfo) -> None:
        theirs = named(worker.version, worker.engine)
        if theirs != self._identity:
            raise Refused(
                f"worker {worker.id} has {theirs}, this daemon {self._identity}: "
                f"{remedy(self._identity)}"
            )

    def _meet(self, book: Book, worker: WorkerInfo, now: float) -> None:
        self._check(worker)
        if self._roster.full(worker.id):
            raise Refused(f"worker {worker.id} has to wait: there are {MOST_WORKERS} already")
        if self._roster.seen(worker, now):
            book.note(now, "worker", worker.id, state="came")
            self._journal.write("worker came", worker=worker.id, slots=worker.slots)

    def _lease(self, book: Book, request: LeaseRequest) -> LeaseReply:
        now = self._clock.now()
        self._meet(book, request.worker, now)
        if self.draining:
            return LeaseReply((), draining=True)
        if self._quota.trouble:
            return LeaseReply(())
        store = self._settings.store
        grants = book.lease(request.worker.id, request.count, now, store=store, lacks=request.lacks)
        return LeaseReply(grants)

    def _renew(self, book: Book, request: RenewRequest) -> RenewReply:
        now = self._clock.now()
        self._meet(book, request.worker, now)
        return RenewReply(book.renew(request.worker.id, request.holds, now))

    def _complete(self, book: Book, completion: Completion) -> Acknowledgement:
        book.check(completion)
        if self._intake.lacks(book, completion):
            return Acknowledgement(Answer.MISSING)
        answer = book.complete(completion, self._clock.now())
        self._intake.settle(book, completion, answer)
        if answer is Answer.RECORDED and not completion.location:
            self._quota.added(completion.result.trace.size)
        if answer == "differs":
            self._journal.write("nondeterminism", run=completion.run, worker=completion.worker)
        return Acknowledgement(answer)

    def _release(self, book: Book, release: Release) -> Acknowledgement:
        answer = book.release(release, self._clock.now())
        self._journal.write("released", run=release.run, reason=release.reason[-400:])
        return Acknowledgement(answer)
