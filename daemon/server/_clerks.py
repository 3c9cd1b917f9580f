"""The threads that touch the ledger: one writes, two read; everybody else queues up, to a limit."""

from __future__ import annotations

import queue
import sqlite3
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from daemon.errors import Troubled
from daemon.ledger import Book, Reader
from daemon.protocol import Event

_BATCH: Final = 64
_MOST: Final = 2048
_MOST_BYTES: Final = 256 * 2**20
"""Requests that may wait for a clerk, and their bytes: what comes then is told to come again."""
BUSY: Final = Troubled(f"the daemon is busy, {_MOST} requests wait already: try again in a moment")


@dataclass(frozen=True, slots=True)
class Job:
    """Something to do with the ledger; ``done`` gets its value, or the exception it raised.

    ``size`` is what it holds in memory until it is done [bytes].
    """

    act: Callable[[Any], object]
    done: Callable[[object], None]
    size: int = 0


class _Clerk(threading.Thread):
    """A thread with a queue of jobs, done one after the other.

    ``put`` takes what the daemon itself wants, ``offer`` what others want, within limits.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._load = threading.Lock()
        self._offered = 0
        self._bytes = 0

    def put(self, job: Job) -> None:
        """Queue a job; returns at once."""
        self._jobs.put(job)

    def offer(self, job: Job) -> bool:
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

        self._jobs.put(Job(job.act, done, job.size))
        return True

    def finish(self) -> None:
        """Do what is queued, then end the thread."""
        self._jobs.put(None)
        self.join()


class Writer(_Clerk):
    """Owns the writing connection: runs jobs in transactions, answers after the commit.

    Jobs that wait together share a commit (the fsync is what costs); each has a savepoint, so a
    refused one undoes only itself.
    """

    def __init__(
        self,
        connection: sqlite3.Connection,
        book: Book,
        publish: Callable[[list[Event]], None],
    ) -> None:
        super().__init__("ledger-writer")
        self._db = connection
        self._book = book
        self._publish = publish

    def run(self) -> None:
        """Work until told to finish."""
        running = True
        while running:
            batch, running = self._take()
            if batch:
                self._work(batch)

    def _take(self) -> tuple[list[Job], bool]:
        batch: list[Job] = []
        job = self._jobs.get()
        while job is not None:
            batch.append(job)
            if len(batch) == _BATCH or self._jobs.empty():
                return batch, True
            job = self._jobs.get()
        return batch, False

    def _work(self, batch: list[Job]) -> None:
        self._book.events = []
        try:
            self._db.execute("BEGIN IMMEDIATE")
            values = [self._attempt(job) for job in batch]
            self._db.execute("COMMIT")
        except sqlite3.Error as error:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            failure = Troubled(f"the ledger cannot be written: {error}")
            values = [failure for _ in batch]
            self._book.events = []
        for job, value in zip(batch, values, strict=True):
            job.done(value)
        if self._book.events:
            self._publish(self._book.events)

    def _attempt(self, job: Job) -> object:
        kept = len(self._book.events)
        self._db.execute("SAVEPOINT job")
        try:
            value = job.act(self._book)
        except sqlite3.OperationalError:
            raise
        except Exception as error:
            # The asker is told, and the desk writes what is not a refusal to the log.
            self._db.execute("ROLLBACK TO job")
            del self._book.events[kept:]
            value = error
        self._db.execute("RELEASE job")
        return value


class Questions(_Clerk):
    """Owns the reading connection: answers questions one by one, each from one snapshot."""

    def __init__(self, name: str, connection: sqlite3.Connection, reader: Reader) -> None:
        super().__init__(name)
        self._db = connection
        self._reader = reader

    def run(self) -> None:
        """Answer until told to finish."""
        while (job := self._jobs.get()) is not None:
            job.done(self._answer(job))

    def _answer(self, job: Job) -> object:
        try:
            self._db.execute("BEGIN")
            try:
                return job.act(self._reader)
            finally:
                self._db.execute("COMMIT")
        except Exception as error:
            return error  # the asker is told; the desk logs what is not a refusal


class Doorman(_Clerk):
    """Tells those to come again for whom there is no room; so that nobody else waits for that."""

    def __init__(self) -> None:
        super().__init__("doorman")

    def run(self) -> None:
        """Turn away until told to finish."""
        while (job := self._jobs.get()) is not None:
            job.done(BUSY)
