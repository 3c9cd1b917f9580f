"""From the bus to the ledger: requests are queued for the ledger's threads, done there, answered.

Zenoh's callbacks only enqueue. One thread writes the ledger, two read it; everybody else queues
up, to a limit. A request is validated by the thread that does it; whatever is wrong with it is its
error reply, never more.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import zenoh

from daemon.batch.errors import DaemonError, Refused, Unavailable, Unreachable
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.security import strip_control_characters
from daemon.batch.server._checkpoints import IdleCheckpoints
from daemon.batch.server._runtime import EventLog
from daemon.model.messages import ErrorReply
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

    ``size`` is what it holds in memory until it is done [bytes].
    """

    act: Callable[[Any], object]
    done: Callable[[object], None]
    size: int = 0


class _LedgerThread(threading.Thread):
    """A thread with a queue of jobs, done one after the other.

    ``put`` takes what the daemon itself wants, ``offer`` what others want, within limits: a flood
    of questions must not keep leases from expiring.
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

    def __init__(
        self,
        ledger: LedgerWriter,
        publish: Callable[[list[ChangeEvent]], None],
        checkpoints: IdleCheckpoints,
    ) -> None:
        super().__init__("ledger-writer")
        self._ledger = ledger
        self._publish = publish
        self._checkpoints = checkpoints

    def run(self) -> None:
        """Work until told to finish."""
        running = True
        while running:
            batch, running = self._take()
            if batch:
                self._work(batch)
            self._checkpoints.note_changes()
        self._checkpoints.act()

    def _first(self) -> LedgerJob | None:
        """Wait for a job; while there is none the ledger's WAL is emptied."""
        while True:
            try:
                return self._jobs.get(timeout=self._checkpoints.patience)
            except queue.Empty:
                self._checkpoints.act()

    def _take(self) -> tuple[list[LedgerJob], bool]:
        batch: list[LedgerJob] = []
        job = self._first()
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
    """Tells those to come again for whom there is no room; so that nobody else waits for that.

    A thread, since a reply from within Zenoh's callback may deadlock (eclipse-zenoh/zenoh#1092).
    """

    def __init__(self) -> None:
        super().__init__("overload-reply")

    def run(self) -> None:
        """Turn away until told to finish."""
        while (job := self._jobs.get()) is not None:
            job.done(BUSY)


class LedgerlessThread(_LedgerThread):
    """Answers what needs no ledger, while there is none to be had."""

    def __init__(self) -> None:
        super().__init__("without-ledger")

    def run(self) -> None:
        """Answer until told to finish."""
        while (job := self._jobs.get()) is not None:
            try:
                value: object = job.act(None)
            except Exception as error:
                value = error  # the asker is told; what is no refusal goes to the log too
            job.done(value)


_LONGEST_PROBLEM: Final = 4000
_LONGEST_KEY: Final = 200


@dataclass(frozen=True, slots=True)
class VerbHandler:
    """What is done about a verb: ``act`` gets what the verb's thread owns of the ledger.

    What takes long and needs no ledger, the carrier does first: then ``prepare`` makes of the
    request what ``act`` gets.
    """

    act: Callable[[Any, Any], object]
    prepare: Callable[[Any], object] | None = None


@dataclass(frozen=True, slots=True)
class RequestDispatcher:
    """Queues requests for the threads that do what they ask for.

    Who finds a full queue is told so by ``overload``; who floods that too hears nothing.
    """

    handlers: Mapping[AnyVerb, VerbHandler]
    log: EventLog
    writer: _LedgerThread
    reader: _LedgerThread
    carrier: _LedgerThread
    overload: _LedgerThread

    def on_query(self, query: zenoh.Query) -> None:
        """Find the thread and enqueue: the callback of the queryable."""
        # Nothing is parsed or refused here: Zenoh calls from the thread that reads its sockets,
        # and whatever takes long in it delays everybody, heartbeats included.
        verb = VERBS.get(str(query.key_expr).rpartition("/")[2])
        if verb is None:
            self._queue(self.reader, query, lambda _: _refuse_unknown(query))
            return
        handler = self.handlers[verb]
        if handler.prepare is not None:
            self._prepare(verb, handler, handler.prepare, query)
        else:
            self._queue(
                self._thread(verb),
                query,
                lambda ledger: _answer(verb, handler, ledger, _request(verb, query)),
            )

    def _thread(self, verb: AnyVerb) -> _LedgerThread:
        if verb.thread is ServerThread.WRITER:
            return self.writer
        return self.carrier if verb.thread is ServerThread.CARRIER else self.reader

    def _queue(
        self,
        thread: _LedgerThread,
        query: zenoh.Query,
        act: Callable[[Any], object],
        done: Callable[[object], None] | None = None,
    ) -> None:
        size = 0 if query.payload is None else len(query.payload)
        job = LedgerJob(act, done or (lambda value: self._reply(query, value)), size)
        if not thread.offer(job):
            self.overload.offer(job)

    def _prepare(
        self,
        verb: AnyVerb,
        handler: VerbHandler,
        prepare: Callable[[Any], object],
        query: zenoh.Query,
    ) -> None:
        def go_on(value: object) -> None:
            if isinstance(value, Exception):
                self._reply(query, value)
            else:
                self._queue(
                    self._thread(verb), query, partial(_answer, verb, handler, request=value)
                )

        self._queue(self.carrier, query, lambda _: prepare(_request(verb, query)), go_on)

    def _reply(self, query: zenoh.Query, value: object) -> None:
        # The asker waits until the query is closed, whatever was replied.
        with query:
            try:
                if isinstance(value, bytes):
                    query.reply(query.key_expr, value)
                else:
                    passing = isinstance(value, Unreachable)
                    problem = ErrorReply(self._error_text(query, value), passing)
                    query.reply_err(codec.to_json(problem))
            except zenoh.ZError as error:
                self.log.write("unanswered", key=str(query.key_expr), problem=str(error))

    def _error_text(self, query: zenoh.Query, value: object) -> str:
        if not isinstance(value, DaemonError):
            self.log.write("failure", key=str(query.key_expr), problem=repr(value))
            return f"the daemon failed: {value!r}"[:_LONGEST_PROBLEM]
        key = str(query.key_expr)[:_LONGEST_KEY]
        self.log.write("refused", key=key, problem=str(value)[:400])
        return str(value)[:_LONGEST_PROBLEM]


def _refuse_unknown(query: zenoh.Query) -> object:
    raise Refused(f"this daemon does not know how to {str(query.key_expr)[:_LONGEST_KEY]}")


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


def _answer(verb: AnyVerb, handler: VerbHandler, ledger: object, request: object) -> bytes:
    # In the thread that did it: the answer is of the same snapshot, and bytes when it is passed on.
    return codec.to_json(handler.act(ledger, request), verb.answer)
