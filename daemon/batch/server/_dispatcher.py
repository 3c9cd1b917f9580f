"""From the bus to the ledger: requests are queued for the ledger's threads, done there, answered.

Zenoh's callbacks only enqueue. One thread writes the ledger, two read it; everybody else queues
up, to a limit, and the names of keys take turns. A request is validated by the thread that does
it; whatever is wrong with it is its error reply, never more.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import zenoh

from daemon.batch.errors import DaemonError, Refused, Unavailable, Unreachable
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.security import strip_control_characters
from daemon.batch.server._askers import Askers, TurnQueue, holder_of, split_key
from daemon.batch.server._runtime import EventLog
from daemon.model.messages import OWNER, ErrorReply
from daemon.model.status import ChangeEvent
from daemon.model.verbs import VERBS, AnyVerb, ServerThread
from grammars.text import codec

_BATCH: Final = 64
"""Jobs that share a commit. Its fsync is what costs: measured on one disk, 2 950 runs a second with
one for each job, 9 470 without any; and nobody waits for more than 64 others' jobs."""
_MOST: Final = 2048
_MOST_BYTES: Final = 256 * 2**20
"""Requests that may wait for a thread, and their bytes, four of the largest submissions: what comes
then is told to come again."""
BUSY: Final = Unavailable(
    f"the daemon is busy, {_MOST} requests wait already: try again in a moment"
)


@dataclass(frozen=True, slots=True)
class LedgerJob:
    """Something to do with the ledger; ``done`` gets its value, or the exception it raised.

    ``size`` is what it holds in memory until it is done [bytes], ``name`` whose turn it takes.
    """

    act: Callable[[Any], object]
    done: Callable[[object], None]
    size: int = 0
    name: str = OWNER


class _LedgerThread(threading.Thread):
    """A thread with a queue of jobs, done one after the other.

    ``put`` takes what the daemon itself wants, ``offer`` what others want, within limits: a flood
    of questions must not keep leases from expiring.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._jobs: TurnQueue[LedgerJob] = TurnQueue()
        self._load = threading.Lock()
        self._offered = 0
        self._bytes = 0

    def put(self, job: LedgerJob) -> None:
        """Queue a job; returns at once."""
        self._jobs.put(job, job.name)

    def offer(self, job: LedgerJob) -> bool:
        """Queue a job unless too much waits already; returns at once, whether it is queued."""
        with self._load:
            full = self._offered >= _MOST or self._bytes + job.size > _MOST_BYTES
            # One that is larger than all the room there is has its turn when nothing else waits.
            if full and self._offered:
                return False
            self._offered += 1
            self._bytes += job.size

        def done(value: object) -> None:
            with self._load:
                self._offered -= 1
                self._bytes -= job.size
            job.done(value)

        self._jobs.put(LedgerJob(job.act, done, job.size), job.name)
        return True

    def finish(self) -> None:
        """Do what is queued, then end the thread."""
        self._jobs.close()
        self.join()


class WriterThread(_LedgerThread):
    """Owns the writing connection: runs jobs in transactions, answers after the commit.

    Jobs that wait together share a commit (the fsync is what costs); each has a savepoint, so a
    refused one undoes only itself.
    """

    def __init__(self, ledger: LedgerWriter, publish: Callable[[list[ChangeEvent]], None]) -> None:
        super().__init__("ledger-writer")
        self._ledger = ledger
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
            with self._ledger.transaction():
                # An error is its value: the asker is told; what is no refusal goes to the log too.
                values = [self._ledger.attempt(job.act) for job in batch]
        except Unavailable as failure:
            values = [failure for _ in batch]
        for job, value in zip(batch, values, strict=True):
            job.done(value)
        if self._ledger.events:
            self._publish(self._ledger.events)


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
            return error  # the asker is told; what is no refusal goes to the log too


class OverloadReply(_LedgerThread):
    """Tells those no for whom there is no room, or who ask too much; nobody else waits for that.

    A thread, since a reply from within Zenoh's callback may deadlock (eclipse-zenoh/zenoh#1092).
    """

    def __init__(self) -> None:
        super().__init__("overload-reply")

    def run(self) -> None:
        """Turn away until told to finish."""
        while (job := self._jobs.get()) is not None:
            job.done(job.act(None))


_LONGEST_PROBLEM: Final = 4000
_LONGEST_KEY: Final = 200


@dataclass(frozen=True, slots=True)
class VerbHandler:
    """What is done about a verb: ``act`` gets what the verb's thread owns of the ledger.

    Its second argument is the request, its third the name of the asker's key, empty for the owner.
    What takes long and needs no ledger, the carrier does first: then ``prepare`` makes of the
    request what ``act`` gets.
    """

    act: Callable[[Any, Any, str], object]
    prepare: Callable[[Any], object] | None = None


@dataclass(frozen=True, slots=True)
class _Question:
    """A question under way: under which name it came, and its bytes."""

    query: zenoh.Query
    name: str
    size: int

    @property
    def holder(self) -> str:
        return holder_of(self.name)


@dataclass(frozen=True, slots=True)
class RequestDispatcher:
    """Queues requests for the threads that do what they ask for.

    Who finds a full queue is told so by ``overload``; who floods that too hears nothing.
    """

    handlers: Mapping[AnyVerb, VerbHandler]
    log: EventLog
    writer: WriterThread
    reader: ReaderThread
    carrier: ReaderThread
    overload: OverloadReply
    askers: Askers

    def on_query(self, query: zenoh.Query) -> None:
        """Find the thread and enqueue: the callback of the queryable."""
        # Nothing is parsed or refused here: Zenoh calls from the thread that reads its sockets,
        # and whatever takes long in it delays everybody, heartbeats included.
        name, word = split_key(str(query.key_expr))
        size = 0 if query.payload is None else len(query.payload)
        no = self.askers.admit(name, size) if name else None
        if no is not None:
            self._turn_away(query, no)
            return
        asked = _Question(query, name or OWNER, size)
        verb = VERBS.get(word) if name else None
        if verb is None:
            self._queue(self.reader, asked, lambda _: _refuse_unknown(query))
            return
        handler = self.handlers[verb]
        if handler.prepare is not None:
            self._prepare(verb, handler, handler.prepare, asked)
        else:
            self._queue(
                self._thread(verb),
                asked,
                lambda ledger: _answer(verb, handler, ledger, _request(verb, query), asked.holder),
            )

    def _turn_away(self, query: zenoh.Query, problem: DaemonError) -> None:
        """Say no at once; not in the log, which a flood would fill."""

        def answer(_: object) -> None:
            with query, suppress(zenoh.ZError):
                query.reply_err(_error_reply(str(problem), problem))

        self.overload.offer(LedgerJob(lambda _: problem, answer))

    def _thread(self, verb: AnyVerb) -> _LedgerThread:
        if verb.thread is ServerThread.WRITER:
            return self.writer
        return self.carrier if verb.thread is ServerThread.CARRIER else self.reader

    def _queue(
        self,
        thread: _LedgerThread,
        asked: _Question,
        act: Callable[[Any], object],
        done: Callable[[object], None] | None = None,
    ) -> None:
        answer = done or (lambda value: self._reply(asked, value))
        if thread.offer(LedgerJob(act, answer, asked.size, asked.name)):
            return
        busy = LedgerJob(lambda _: BUSY, answer, asked.size, asked.name)
        if not self.overload.offer(busy):
            self.askers.answered(asked.name, asked.size)

    def _prepare(
        self,
        verb: AnyVerb,
        handler: VerbHandler,
        prepare: Callable[[Any], object],
        asked: _Question,
    ) -> None:
        def go_on(value: object) -> None:
            if isinstance(value, Exception):
                self._reply(asked, value)
            else:
                self._queue(
                    self._thread(verb),
                    asked,
                    partial(_answer, verb, handler, request=value, asker=asked.holder),
                )

        self._queue(self.carrier, asked, lambda _: prepare(_request(verb, asked.query)), go_on)

    def _reply(self, asked: _Question, value: object) -> None:
        self.askers.answered(asked.name, asked.size)
        # The asker waits until the query is closed, whatever was replied.
        with asked.query as query:
            try:
                if isinstance(value, bytes):
                    query.reply(query.key_expr, value)
                else:
                    query.reply_err(_error_reply(self._error_text(query, value), value))
            except zenoh.ZError as error:
                self.log.write("unanswered", key=str(query.key_expr), problem=str(error))

    def _error_text(self, query: zenoh.Query, value: object) -> str:
        if not isinstance(value, DaemonError):
            self.log.write("failure", key=str(query.key_expr), problem=repr(value))
            return f"the daemon failed: {value!r}"[:_LONGEST_PROBLEM]
        key = str(query.key_expr)[:_LONGEST_KEY]
        self.log.write("refused", key=key, problem=str(value)[:400])
        return str(value)[:_LONGEST_PROBLEM]


def _error_reply(words: str, error: object) -> bytes:
    return codec.to_json(ErrorReply(words, passing=isinstance(error, Unreachable)))


def _refuse_unknown(query: zenoh.Query) -> object:
    key = str(query.key_expr)[:_LONGEST_KEY]
    raise Refused(f"this daemon does not know how to {key}: versions differ?")


def _request(verb: AnyVerb, query: zenoh.Query) -> object:
    """The request, validated; raises :class:`Refused`."""
    payload = query.payload
    if payload is not None and len(payload) > verb.largest:
        raise Refused(f"the request has {len(payload)} bytes, at most {verb.largest} are taken")
    data = b"{}" if payload is None else payload.to_bytes()
    try:
        kind: Any = verb.request
        request: object = codec.from_json(kind, strip_control_characters(data), exactly=True)
    except ValueError as error:
        raise Refused(f"the request is malformed: {error}") from error
    return request


def _answer(
    verb: AnyVerb, handler: VerbHandler, ledger: object, request: object, asker: str
) -> bytes:
    # In the thread that did it: the answer is of the same snapshot, and bytes when it is passed on.
    value = handler.act(ledger, request, asker)
    if isinstance(value, Generator):
        value = _finish(value)
    return codec.to_json(value, verb.answer)


def _finish(steps: Generator[None, None, object]) -> object:
    """Do what is done step by step, and return what it returns."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value
