"""From the bus to the ledger: requests are queued for the ledger's threads, done there, answered.

Zenoh's callbacks only enqueue. One thread writes the ledger, two read it; everybody else queues up, to a limit. A request is validated by the thread that does it; whatever is wrong with it is its error reply, never more.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import zenoh

from daemon.batch.errors import DaemonError, Refused, Unavailable, Unreachable
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.security import VERB_RULES, strip_control_characters
from daemon.batch.server._runtime import EventLog
from daemon.model.messages import ErrorReply, Verb
from daemon.model.status import ChangeEvent
from grammars.text import codec

_BATCH: Final = 64
_MOST: Final = 2048
_MOST_BYTES: Final = 256 * 2**20
"""Requests that may wait for a clerk, and their bytes: what comes then is told to come again."""
BUSY: Final = Unavailable(
    f"the daemon is busy, {_MOST} requests wait already: try again in a moment"
)


@dataclass(frozen=True, slots=True)
class LedgerJob:
    """Something to do with the ledger; ``done`` gets its value, or the exception it raised.

    ``size`` is what it holds in memory until it is done [bytes].
    """

    act: Callable[[Any], object]
    done: Callable[[object], None]
    size: int = 0


class _LedgerThread(threading.Thread):
    """A thread with a queue of jobs, done one after the other.

    ``put`` takes what the daemon itself wants, ``offer`` what others want, within limits.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._jobs: queue.SimpleQueue[LedgerJob | None] = queue.SimpleQueue()
        self._load = threading.Lock()
        self._offered = 0
        self._bytes = 0

    def put(self, job: LedgerJob) -> None:
        """Queue a job; returns at once."""
        self._jobs.put(job)

    def offer(self, job: LedgerJob) -> bool:
        """Queue a job unless too much waits already; returns at once, whether it is queued."""
        with self._load:
            full = self._offered >= _MOST or self._bytes + job.size > _MOST_BYTES
            if full and self._offered:
                return False
            self._offered += 1
            self._bytes += job.size

        def done(value: object) -> None:
            with self._load:
                self._offered -= 1
                self._bytes -= job.size
            job.done(value)

        self._jobs.put(LedgerJob(job.act, done, job.size))
        return True

    def finish(self) -> None:
        """Do what is queued, then end the thread."""
        self._jobs.put(None)
        self.join()


class WriterThread(_LedgerThread):
    """Owns the writing connection: runs jobs in transactions, answers after the commit.

    Jobs that wait together share a commit (the fsync is what costs); each has a savepoint, so a
    refused one undoes only itself.
    """

    def __init__(self, book: LedgerWriter, publish: Callable[[list[ChangeEvent]], None]) -> None:
        super().__init__("ledger-writer")
        self._book = book
        self._publish = publish

    def run(self) -> None:
        """Work until told to finish."""
        running = True
        while running:
            batch, running = self._take()
            if batch:
                self._work(batch)

    def _take(self) -> tuple[list[LedgerJob], bool]:
        batch: list[LedgerJob] = []
        job = self._jobs.get()
        while job is not None:
            batch.append(job)
            if len(batch) == _BATCH or self._jobs.empty():
                return batch, True
            job = self._jobs.get()
        return batch, False

    def _work(self, batch: list[LedgerJob]) -> None:
        try:
            with self._book.transaction():
                # What is no refusal the dispatcher writes to the log; the asker is told of both.
                values = [self._book.attempt(job.act) for job in batch]
        except Unavailable as failure:
            values = [failure for _ in batch]
        for job, value in zip(batch, values, strict=True):
            job.done(value)
        if self._book.events:
            self._publish(self._book.events)


class ReaderThread(_LedgerThread):
    """Owns the reading connection: answers questions one by one, each from one snapshot."""

    def __init__(self, name: str, reader: LedgerReader) -> None:
        super().__init__(name)
        self._reader = reader

    def run(self) -> None:
        """Answer until told to finish."""
        while (job := self._jobs.get()) is not None:
            job.done(self._answer(job))

    def _answer(self, job: LedgerJob) -> object:
        try:
            with self._reader.snapshot():
                return job.act(self._reader)
        except Exception as error:
            return error  # the asker is told; the desk logs what is not a refusal


class OverloadReply(_LedgerThread):
    """Tells those to come again for whom there is no room; so that nobody else waits for that."""

    def __init__(self) -> None:
        super().__init__("doorman")

    def run(self) -> None:
        """Turn away until told to finish."""
        while (job := self._jobs.get()) is not None:
            job.done(BUSY)


_LONGEST_COMPLAINT: Final = 4000
_LONGEST_KEY: Final = 200


@dataclass(frozen=True, slots=True)
class VerbHandler:
    """What is done about a verb: by the reader, by the writer, or by the carrier of megabytes.

    ``act`` gets the side of the ledger its clerk owns, and the request. What takes long and needs
    no ledger, the carrier does before the writer: ``prepare`` makes of the request what ``act``
    gets. ``answer`` names the type of the answer when it is not its class.
    """

    request: Any
    act: Callable[[Any, Any], object]
    answer: Any = None
    writes: bool = False
    carries: bool = False
    prepare: Callable[[Any], object] | None = None


@dataclass(frozen=True, slots=True)
class RequestDispatcher:
    """Queues requests for the clerks.

    Who finds a full queue is told so by the ``doorman``; who floods that too hears nothing.
    """

    services: Mapping[Verb, VerbHandler]
    journal: EventLog
    writer: WriterThread
    questions: ReaderThread
    carrier: ReaderThread
    doorman: OverloadReply

    def receive(self, query: zenoh.Query) -> None:
        """Find the clerk and enqueue: the callback of the queryable."""
        verb = str(query.key_expr).rpartition("/")[2]
        service = self.services.get(verb)  # type: ignore[call-overload]
        if service is None:
            self._queue(self.questions, query, lambda _: _unknown(query))
        elif service.prepare is not None:
            self._prepare(service, service.prepare, verb, query)
        else:
            clerk: WriterThread | ReaderThread = self.questions
            if service.writes or service.carries:
                clerk = self.writer if service.writes else self.carrier
            self._queue(
                clerk,
                query,
                lambda ledger: _answer_request(service, ledger, _request(service, verb, query)),
            )

    def _queue(
        self,
        clerk: WriterThread | ReaderThread,
        query: zenoh.Query,
        act: Callable[[Any], object],
        done: Callable[[object], None] | None = None,
    ) -> None:
        size = 0 if query.payload is None else len(query.payload)
        job = LedgerJob(act, done or (lambda value: self._reply(query, value)), size)
        if not clerk.offer(job):
            self.doorman.offer(job)

    def _prepare(
        self, service: VerbHandler, prepare: Callable[[Any], object], verb: str, query: zenoh.Query
    ) -> None:
        def go_on(value: object) -> None:
            if isinstance(value, Exception):
                self._reply(query, value)
            else:
                self._queue(self.writer, query, lambda book: _answer_request(service, book, value))

        self._queue(self.carrier, query, lambda _: prepare(_request(service, verb, query)), go_on)

    def _reply(self, query: zenoh.Query, value: object) -> None:
        with query:
            try:
                if isinstance(value, bytes):
                    query.reply(query.key_expr, value)
                else:
                    passing = isinstance(value, Unreachable)
                    problem = ErrorReply(self._complaint(query, value), passing)
                    query.reply_err(codec.to_json(problem))
            except zenoh.ZError as error:
                self.journal.write("unanswered", key=str(query.key_expr), problem=str(error))

    def _complaint(self, query: zenoh.Query, value: object) -> str:
        if not isinstance(value, DaemonError):
            self.journal.write("failure", key=str(query.key_expr), problem=repr(value))
            return f"the daemon failed: {value!r}"[:_LONGEST_COMPLAINT]
        key = str(query.key_expr)[:_LONGEST_KEY]
        self.journal.write("refused", key=key, problem=str(value)[:400])
        return str(value)[:_LONGEST_COMPLAINT]


def _unknown(query: zenoh.Query) -> object:
    raise Refused(f"this daemon does not know how to {str(query.key_expr)[:_LONGEST_KEY]}")


def _request(service: VerbHandler, verb: str, query: zenoh.Query) -> object:
    """The request, validated; raises :class:`Refused`."""
    payload = query.payload
    limit = VERB_RULES[Verb(verb)].largest
    if payload is not None and len(payload) > limit:
        raise Refused(f"the request has {len(payload)} bytes, at most {limit} are taken")
    data = b"{}" if payload is None else payload.to_bytes()
    try:
        request: object = codec.from_json(
            service.request, strip_control_characters(data), exactly=True
        )
    except ValueError as error:
        raise Refused(f"the request is malformed: {error}") from error
    return request


def _answer_request(service: VerbHandler, ledger: object, request: object) -> bytes:
    return codec.to_json(service.act(ledger, request), service.answer)
