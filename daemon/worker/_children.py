"""Children: one process per run, forked from a warm fork server."""

from __future__ import annotations

import multiprocessing
import signal
import sys
import time
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path
from typing import Final

from daemon import child
from daemon.child import Task
from daemon.errors import WorkerBroken
from daemon.executor import Limits
from daemon.worker._backend import Waitable
from daemon.worker._spool import Attempt

_LAST_WORDS: Final = 4000
_WARM_UP_LIMIT: Final = 300.0


@dataclass(slots=True)
class Child:
    """A running attempt and its process; ``live`` is what it last told about itself.

    There is no ``blame`` when it failed for want of space on the disk, or of the system under
    test.
    """

    attempt: Attempt
    process: ForkServerProcess
    wire: Connection
    limit: float
    deadline: float
    words: str = ""
    live: bytes = b""
    blame: bool = True
    lacks: bool = False

    @property
    def waitables(self) -> tuple[Waitable, ...]:
        """The end of the process, and what it sends."""
        return self.process.sentinel, self.wire

    def listen(self) -> None:
        """Read what the child has sent, keep the newest snapshot and its last words; end it
        when its time is up.
        """
        with suppress(EOFError):  # it is gone: its end is noticed by its process
            self._read()
        if time.monotonic() > self.deadline and not self.ended:
            self.kill(f"stopped after {self.limit:g} s of wall clock time")

    def _read(self) -> None:
        while self.wire.poll():
            message = self.wire.recv_bytes()
            if message[:1] == child.LIVE:
                self.live = message[1:]
            elif message[:1] in (child.FAILED, child.NO_ROOM, child.LACKS):
                self.blame = message[:1] == child.FAILED
                self.lacks = message[:1] == child.LACKS
                self.words = message[1:].decode("utf-8", "replace")[-_LAST_WORDS:]

    @property
    def ended(self) -> bool:
        """Whether the process is gone."""
        return self.process.exitcode is not None

    def kill(self, why: str = "") -> None:
        """End the process at once."""
        self.words = why or self.words
        self.process.kill()
        self.process.join()

    def close(self) -> None:
        """Free what belongs to the ended process."""
        self.listen()
        self.wire.close()
        self.process.close()

    def why(self) -> str:
        """Why there is no result: what was printed, and last what ended it."""
        return "\n".join(filter(None, (self.attempt.output(), self.words or self._fate())))

    def _fate(self) -> str:
        code = self.process.exitcode or 0
        if code < 0:
            known = {int(number): number.name for number in signal.Signals}
            return f"the run's process was killed by {known.get(-code, f'signal {-code}')}"
        return f"the run's process ended with code {code} and no result"


class Nursery:
    """Starts children, ``slots`` at a time.

    The first one shows whether runs can be executed at all.
    """

    waitables: tuple[Waitable, ...] = ()

    def __init__(self, slots: int) -> None:
        self.slots = slots
        self._context: ForkServerContext = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(["daemon.child", "daemon.preload"])

    def listen(self) -> None:
        """Children are listened to one by one."""

    def prove(self) -> None:
        """Start the fork server and wait until it is warm.

        Raises :class:`WorkerBroken` with the reason when it cannot execute runs.
        """
        try:
            process, wire = self._fork(child.probe)
            with wire:
                answer = wire.recv_bytes() if wire.poll(_WARM_UP_LIMIT) else b""
        except (EOFError, OSError) as error:
            raise WorkerBroken(f"this worker's fork server ended: {error}") from error
        process.join()
        process.close()
        if answer != child.READY:
            words = answer[1:].decode("utf-8", "replace") or "the first child did not answer"
            raise WorkerBroken(f"this worker cannot execute runs:\n{words}")

    def start(self, attempt: Attempt, scene: Path, limits: Limits) -> Child:
        """Start the process of an attempt; raises ``OSError`` or ``EOFError`` when there is none
        to be had.
        """
        task = Task(attempt.folder, scene, limits.memory, limits.nice)
        process, wire = self._fork(child.main, task)
        limit = limits.wall_of(attempt.grant.spec.limit)
        return Child(attempt, process, wire, limit, time.monotonic() + limit)

    def _fork(
        self, target: Callable[..., None], *task: Task
    ) -> tuple[ForkServerProcess, Connection]:
        ours, theirs = self._context.Pipe(duplex=False)
        process = self._context.Process(target=target, args=(*task, theirs))
        try:
            with theirs, _without_main_module():
                process.start()
        except (EOFError, OSError):
            ours.close()
            raise
        return process, ours


@contextmanager
def _without_main_module() -> Iterator[None]:
    """Keep children from importing the program's main module (60 ms for a command line).

    They need nothing of it: what they run is imported by name.
    """
    kept = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = kept
