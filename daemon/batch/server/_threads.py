"""The threads of the daemon's ledger: one writes, some read; the queues are limited."""

from __future__ import annotations

import queue
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Final

from daemon.batch.errors import DaemonError, Unavailable
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.model.status import ChangeEvent

_BATCH: Final = 64
"""Most jobs of one commit, whose fsync is the main cost: measured on one disk, 2 950 runs a second
with one for each job, 9 470 without any."""
_PAUSE: Final = 0.4
"""Time without a change after which the ledger's WAL is emptied [s]."""
_MOST: Final = 2048
"""Most waiting requests in a queue; further ones are refused for now."""
BUSY: Final = Unavailable(
    f"the daemon is busy, {_MOST} requests wait already: try again in a moment"
)


@dataclass(frozen=True, slots=True)
class LedgerJob:
    """A job on the ledger; ``done`` gets its value, or its exception."""

    act: Callable[[Any], object]
    done: Callable[[object], None]


class JobQueue(ABC):
    """A queue of jobs for the ledger.

    ``put`` takes jobs of the daemon itself, ``offer`` jobs of clients, within limits: a flood of
    requests must not keep leases from expiring.
    """

    def __init__(self) -> None:
        self._room = threading.Semaphore(_MOST)

    @abstractmethod
    def put(self, job: LedgerJob) -> None:
        """Queue a job and return at once."""

    @abstractmethod
    def finish(self) -> None:
        """Do the queued jobs, then end."""

    def offer(self, job: LedgerJob) -> bool:
        """Queue a job unless the queue is full; return at once whether it was queued."""
        if not self._room.acquire(blocking=False):
            return False

        def done(value: object) -> None:
            self._room.release()
            job.done(value)

        self.put(LedgerJob(job.act, done))
        return True


class WriterThread(JobQueue):
    """Owns the writing connection: runs jobs in transactions, answers after the commit.

    Waiting jobs share a commit and its fsync; each has a savepoint, so a refused one undoes only
    itself. In a pause the WAL is emptied, since SQLite drops everything after a single wrong bit of
    it. ``report`` gets the problem if that fails.
    """

    def __init__(
        self,
        ledger: LedgerWriter,
        publish: Callable[[list[ChangeEvent]], None],
        report: Callable[[str], None],
    ) -> None:
        super().__init__()
        self._ledger = ledger
        self._publish = publish
        self._report = report
        self._changes = -1
        self._changed_at = 0.0
        self._emptied = False
        self._jobs: queue.SimpleQueue[LedgerJob | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="ledger-writer", daemon=True)
        self._thread.start()

    @property
    def alive(self) -> bool:
        """True while it works; before :meth:`finish` only an error of its own ends it."""
        return self._thread.is_alive()

    def put(self, job: LedgerJob) -> None:
        """Queue a job and return at once."""
        self._jobs.put(job)

    def finish(self) -> None:
        """Do the queued jobs, then end."""
        self._jobs.put(None)
        self._thread.join()

    def _run(self) -> None:
        running = True
        while running:
            batch, running = self._take()
            if batch:
                self._work(batch)
            self._empty_in_pause()
        self._empty()

    def _take(self) -> tuple[list[LedgerJob], bool]:
        """Wait for a job; return the waiting ones, up to a batch, and whether more may come."""
        batch: list[LedgerJob] = []
        while len(batch) < _BATCH:
            try:
                job = self._jobs.get(block=not batch)
            except queue.Empty:
                break
            if job is None:
                return batch, False
            batch.append(job)
        return batch, True

    def _empty_in_pause(self) -> None:
        """Empty the WAL after a while without changes; the daemon's own ticks call this."""
        now, changes = time.monotonic(), self._ledger.changes
        if changes != self._changes:
            self._changes, self._changed_at, self._emptied = changes, now, False
        elif not self._emptied and now - self._changed_at >= _PAUSE:
            self._empty()

    def _empty(self) -> None:
        try:
            self._emptied = self._ledger.checkpoint()
        except DaemonError as error:
            self._emptied = True  # retried after the next change
            self._report(str(error))

    def _work(self, batch: list[LedgerJob]) -> None:
        try:
            with self._ledger.transaction():
                # An exception is the job's value, and its answer; unexpected ones are also logged.
                values = [self._ledger.attempt(job.act) for job in batch]
        except Unavailable as failure:
            values = [failure for _ in batch]
        for job, value in zip(batch, values, strict=True):
            job.done(value)
        if self._ledger.events:
            self._publish(self._ledger.events)


class ReaderPool(JobQueue):
    """Threads that answer requests, each from one snapshot of the ledger.

    Raises :class:`DaemonError` when the ledger cannot be read.
    """

    def __init__(self, paths: StatePaths, name: str, threads: int = 1) -> None:
        super().__init__()
        self._readers: queue.SimpleQueue[LedgerReader] = queue.SimpleQueue()
        with ExitStack() as stack:
            for _ in range(threads):
                self._readers.put(stack.enter_context(LedgerReader.open(paths)))
            self._opened = stack.pop_all()
        self._pool = ThreadPoolExecutor(threads, name)

    def put(self, job: LedgerJob) -> None:
        """Queue a job and return at once."""
        self._pool.submit(self._perform, job)

    def _perform(self, job: LedgerJob) -> None:
        reader = self._readers.get()
        try:
            with reader.snapshot():
                value = job.act(reader)
        except Exception as error:
            value = error  # it is the answer; unexpected ones are also logged
        self._readers.put(reader)
        job.done(value)

    def finish(self) -> None:
        """Do the queued jobs, then end."""
        self._pool.shutdown()
        self._opened.close()
