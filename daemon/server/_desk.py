"""The desk: takes requests off the bus, has them done by the clerks, replies.

Zenoh's callbacks only enqueue. Requests are validated by the clerk that does them; whatever is
wrong with one is its error reply, never more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import zenoh

from daemon.assessment import RunRecord
from daemon.errors import DaemonError, Refused, Unreachable
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
    Problem,
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
from daemon.security import RULES, tamed
from daemon.server._admission import admit
from daemon.server._clerks import Doorman, Job, Questions, Writer
from daemon.server._clock import Clock
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

_LONGEST_COMPLAINT: Final = 4000
_LONGEST_KEY: Final = 200


@dataclass(frozen=True, slots=True)
class _Service:
    request: Any
    act: Callable[[Any, Any], object]
    answer: Any = None
    writes: bool = False
    carries: bool = False
    prepare: Callable[[Any], Any] | None = None
    """Done to the request before the writer gets it: what takes long and needs no ledger."""


@dataclass(frozen=True, slots=True)
class _Admitted:
    submission: Submission
    fingerprint: Fingerprint


class Desk:
    """Everything the daemon can be asked, by verb."""

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
        self._services = self._reading() | self._writing() | self._carrying()

    def _reading(self) -> dict[Verb, _Service]:
        return {
            Verb.OVERVIEW: _Service(Nothing, self._overview),
            Verb.CAMPAIGNS: _Service(
                Nothing, lambda r, _: r.campaigns(), answer=tuple[CampaignRow, ...]
            ),
            Verb.RUNS: _Service(RunQuery, lambda r, query: r.runs(query)),
            Verb.RUN: _Service(Named, lambda r, named: r.run(named.id)),
            Verb.DECLARED: _Service(Named, lambda r, named: r.declared(named.id)),
            Verb.RECORDS: _Service(
                RecordQuery, lambda r, query: r.records(query), answer=tuple[RunRecord, ...]
            ),
            Verb.SCENE: _Service(Named, self._scene),
            Verb.WORKERS: _Service(
                Nothing, lambda _, __: self._roster.rows(), answer=tuple[WorkerRow, ...]
            ),
            Verb.DISK: _Service(Nothing, self._disk),
            Verb.WELCOME: _Service(WorkerInfo, self._welcome),
            Verb.SHUTDOWN: _Service(Nothing, self._shutdown),
        }

    def _writing(self) -> dict[Verb, _Service]:
        return {
            Verb.SUBMIT: _Service(Parcel, self._submit, writes=True, prepare=self._admit),
            Verb.CANCEL: _Service(Named, self._cancel, writes=True),
            Verb.RETRY: _Service(RetryRequest, self._retry, writes=True),
            Verb.PAUSE: _Service(Named, self._pause, writes=True),
            Verb.RESUME: _Service(Named, self._resume, writes=True),
            Verb.PRIORITISE: _Service(PriorityRequest, self._prioritise, writes=True),
            Verb.LEASE: _Service(LeaseRequest, self._lease, writes=True),
            Verb.RENEW: _Service(RenewRequest, self._renew, writes=True),
            Verb.COMPLETE: _Service(Completion, self._complete, writes=True),
            Verb.RELEASE: _Service(Release, self._release, writes=True),
        }

    def _carrying(self) -> dict[Verb, _Service]:
        """What moves megabytes has a clerk of its own: nobody's question waits for it."""
        return {
            Verb.UPLOAD: _Service(
                Chunk, lambda r, chunk: self._intake.take(r, chunk), carries=True
            ),
            Verb.FETCH: _Service(Fetch, self._fetch, carries=True),
            Verb.KEEP: _Service(Keep, self._files.take, carries=True),
            Verb.FILE: _Service(FetchFile, self._files.piece, carries=True),
        }

    def receiver(
        self, writer: Writer, questions: Questions, carrier: Questions, doorman: Doorman
    ) -> Callable[[zenoh.Query], None]:
        """Return the callback for the queryable: it finds the clerk and enqueues.

        Who finds a full queue is told so by the ``doorman``; who floods that too hears nothing.
        """

        def receive(query: zenoh.Query) -> None:
            verb = str(query.key_expr).rpartition("/")[2]
            service = self._services.get(verb)  # type: ignore[call-overload]
            clerk: Writer | Questions = questions
            if service is not None and (service.writes or service.carries):
                clerk = writer if service.writes else carrier
            payload = query.payload
            size = 0 if payload is None else len(payload)
            job = Job(
                lambda ledger: self._serve(service, verb, query, ledger),
                lambda value: self._reply(query, value),
                size,
            )
            if service is not None and service.prepare is not None:
                clerk, job = carrier, self._in_two_steps(service, verb, query, size, offer)
            offer(clerk, job)

        def offer(clerk: Writer | Questions | None, job: Job) -> None:
            if not (clerk or writer).offer(job):
                doorman.offer(job)

        return receive

    def _in_two_steps(
        self,
        service: _Service,
        verb: str,
        query: zenoh.Query,
        size: int,
        offer: Callable[[None, Job], None],
    ) -> Job:
        """A job that prepares the request, and then another one for the writer."""
        prepare = service.prepare
        assert prepare is not None

        def go_on(value: object) -> None:
            if isinstance(value, Exception):
                self._reply(query, value)
                return
            act = lambda book: codec.to_json(service.act(book, value), service.answer)  # noqa: E731
            offer(None, Job(act, lambda answer: self._reply(query, answer), size))

        return Job(lambda _: prepare(self._request(service, verb, query)), go_on, size)

    def _serve(
        self, service: _Service | None, verb: str, query: zenoh.Query, ledger: object
    ) -> bytes:
        if service is None:
            raise Refused(f"this daemon does not know how to {str(query.key_expr)[:_LONGEST_KEY]}")
        request = self._request(service, verb, query)
        return codec.to_json(service.act(ledger, request), service.answer)

    def _request(self, service: _Service, verb: str, query: zenoh.Query) -> object:
        payload = query.payload
        limit = RULES[Verb(verb)].largest
        if payload is not None and len(payload) > limit:
            raise Refused(f"the request has {len(payload)} bytes, at most {limit} are taken")
        data = b"{}" if payload is None else payload.to_bytes()
        try:
            request: object = codec.from_json(service.request, tamed(data), exactly=True)
        except ValueError as error:
            raise Refused(f"the request is malformed: {error}") from error
        return request

    def _reply(self, query: zenoh.Query, value: object) -> None:
        with query:
            try:
                if isinstance(value, bytes):
                    query.reply(query.key_expr, value)
                else:
                    passing = isinstance(value, Unreachable)
                    problem = Problem(self._complaint(query, value), passing)
                    query.reply_err(codec.to_json(problem))
            except zenoh.ZError as error:
                self._journal.write("unanswered", key=str(query.key_expr), problem=str(error))

    def _complaint(self, query: zenoh.Query, value: object) -> str:
        if not isinstance(value, DaemonError):
            self._journal.write("failure", key=str(query.key_expr), problem=repr(value))
            return f"the daemon failed: {value!r}"[:_LONGEST_COMPLAINT]
        key = str(query.key_expr)[:_LONGEST_KEY]
        self._journal.write("refused", key=key, problem=str(value)[:400])
        return str(value)[:_LONGEST_COMPLAINT]

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
