"""One process per run, forked from a warm fork server, and the environment that server needs.

A fresh process costs a run 13 to 20 ms when it is forked from a server that has numpy loaded, over
100 ms when it is spawned. It buys hard limits on time and memory, nothing left over from one seed
to the next, and a crash that costs one run. Not ``ProcessPoolExecutor``: when one of its processes
is killed, every pending future is broken and the pool is dead. Not a plain fork of the worker: it
has an open Zenoh session and threads, and a child's first question hangs.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import time
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path
from typing import Final

from daemon.batch import run_process
from daemon.batch.errors import WorkerBroken
from daemon.batch.run_process import RunTask
from daemon.batch.worker._attempts import Attempt, AttemptEnd, Waitable
from daemon.batch.worker._fork_server_preparation import ForkServerPreparation
from daemon.model.deadline import spare_time, stopped_after
from daemon.model.execution import (
    EXECUTOR_VARIABLE,
    IMPORT_FIRST,
    RunLimits,
    safe_fork_server,
)
from daemon.model.spec import SutReference
from daemon.model.status import Preparation
from daemon.supervision.guardian import end_guarded
from daemon.supervision.remains import end_children, parent_of


def prepare_environment(executor: str) -> None:
    """Say what executes runs, and that a run is one thread of one core."""
    os.environ[EXECUTOR_VARIABLE] = executor
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")


def lower_session_priority(nice: int) -> None:
    """Let this worker's session step back as a whole, if it has one of its own.

    With autogroups (sched(7)) sessions share processors evenly whatever the
    niceness of their processes: that of the runs counts inside the worker's session only.
    """
    if os.getsid(0) == os.getpid():
        with suppress(OSError):  # a kernel without them
            Path("/proc/self/autogroup").write_text(str(nice))


_PRELOADED: Final = (
    "daemon.batch.run_process",
    "daemon.batch.kernel_compilation",
    "daemon.batch.forkserver_preload",
)
_LONGEST_REASON: Final = 4000
_WARM_UP_LIMIT: Final = 300.0
"""Seconds until the fork server answers: an executor that plugs in may load anything first."""


@dataclass(slots=True)
class ForkedExecution:
    """A running attempt and its guardian, the ``process``; ``live`` is what it last said of itself.

    ``sweep`` ends what a guardian has left that was killed, ``ended`` is told of the end.
    It counts against the run unless it failed for want of space on the disk, or of the system
    under test.
    """

    attempt: Attempt
    process: ForkServerProcess
    wire: Connection
    limit: float
    deadline: float
    sweep: Callable[[], None]
    ended: Callable[[], None]
    live: bytes = b""
    judged: bytes = b""
    _reason: str = ""
    _failure: bytes = run_process.FAILED
    _swept: bool = False
    _silent: bool = False

    @property
    def waitables(self) -> tuple[Waitable, ...]:
        """The end of the process, and what it sends."""
        # A pipe that nobody writes to any more is always ready: to wait for it would be to spin
        # until the guardian ends, on a core that it needs for that.
        return (self.process.sentinel,) if self._silent else (self.process.sentinel, self.wire)

    def listen(self) -> None:
        """Read what the child has sent, keep the newest snapshot and its last words; end it
        when its time is up.
        """
        try:
            self._read()
        except (EOFError, OSError):
            # It is gone, OSError: in the middle of a message. Its end is noticed by its process.
            self._silent = True
        if time.monotonic() > self.deadline and self.end is None:
            self.kill(stopped_after(self.limit))
        self._sweep()

    def _sweep(self) -> None:
        # A guardian that has done its work ends with a code, or by the signal that ended the run.
        if not self._swept and (self.process.exitcode or 0) < 0:
            self._swept = True
            self.sweep()

    def _read(self) -> None:
        while self.wire.poll():
            message = self.wire.recv_bytes()
            if message[:1] == run_process.LIVE:
                self.live = message[1:]
            elif message[:1] == run_process.JUDGEMENT:
                with suppress(OSError):  # the folder went with its run
                    self.judged = run_process.read_judged(self.attempt.folder)
            elif message[:1] in run_process.FAILURES:
                self._failure = message[:1]
                self._reason = message[1:].decode("utf-8", "replace")[-_LONGEST_REASON:]

    @property
    def end(self) -> AttemptEnd | None:
        """Why there is no result, if so: what was printed, and last what ended the process."""
        if self.process.exitcode is None:
            return None
        if self.attempt.finished:
            return AttemptEnd()
        reason = self._reason or self._exit_reason(self.process.exitcode)
        return AttemptEnd(
            "\n".join(filter(None, (self.attempt.output(), reason))),
            counts=self._failure == run_process.FAILED,
            sut_missing=self._failure == run_process.SUT_MISSING,
        )

    def watch(self, wanted: frozenset[run_process.Wanted]) -> None:
        """Leave word for the run."""
        self.attempt.mark_watched(wanted)

    def kill(self, why: str = "") -> None:
        """End the run at once, with all it has started."""
        self._reason = why or self._reason
        end_guarded(self.process)
        self._sweep()

    def close(self) -> None:
        """Free what belongs to the ended process."""
        self.listen()
        self.ended()
        self.wire.close()
        self.process.close()

    @staticmethod
    def _exit_reason(code: int) -> str:
        if code < 0:
            known = {int(number): number.name for number in signal.Signals}
            return f"the run's process was killed by {known.get(-code, f'signal {-code}')}"
        return f"the run's process ended with code {code} and no result"


class ForkServerPool:
    """Starts children, ``slots`` at a time.

    The first one shows whether runs can be executed at all.
    """

    trouble = ""
    """Its processes are children of the worker: what is wrong shows at the start."""

    def __init__(self, slots: int) -> None:
        self.slots = slots
        self._guardians: list[ForkServerProcess] = []
        self._preparation = ForkServerPreparation(self._fork_guarded)
        self._context: ForkServerContext = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload([IMPORT_FIRST, *_PRELOADED])

    @property
    def waitables(self) -> tuple[Waitable, ...]:
        """The process that compiles, while there is one; runs have their own."""
        return self._preparation.waitables

    @property
    def preparation(self) -> Preparation | None:
        """How far compiling is, while something is compiled."""
        return self._preparation.standing

    def listen(self) -> None:
        """Listen to the process that compiles; those of runs are listened to one by one."""
        self._preparation.listen()

    def prepare(self, sut: SutReference, limits: RunLimits) -> bool:
        """Whether a run of ``sut`` can start with its kernels loaded; sees to it otherwise.

        Raises as :meth:`start` does, and :class:`WorkerBroken` when they cannot be compiled.
        """
        return self._preparation.prepare(sut, limits.nice)

    def warm_up(self) -> None:
        """Start the fork server and wait until it is there, without a kernel yet.

        Raises :class:`WorkerBroken` with the reason when it cannot execute runs.
        """
        try:
            process, wire = self._fork(run_process.report_readiness)
            with wire:
                answer = wire.recv_bytes() if wire.poll(_WARM_UP_LIMIT) else b""
        except (EOFError, OSError) as error:
            raise WorkerBroken(f"this worker's fork server ended: {error}") from error
        process.join()
        process.close()
        if answer != run_process.READY:
            words = answer[1:].decode("utf-8", "replace") or "the first child did not answer"
            raise WorkerBroken(f"this worker cannot execute runs:\n{words}")

    def start(self, attempt: Attempt, scene: Path, limits: RunLimits) -> ForkedExecution:
        """Start the process of an attempt; raises ``OSError`` or ``EOFError`` when there is none
        to be had.
        """
        limit = limits.wall_of(attempt.lease.spec.limit)
        task = RunTask(attempt.folder, scene, limits.memory, limits.nice, limit)
        process, wire = self._fork_guarded(run_process.run_attempt, task)
        sweep = partial(self._sweep, parent_of(process.pid or 0))
        # The run ends itself at its limit, and has a trace and a result that say so. Only what
        # cannot be interrupted is ended from here.
        deadline = time.monotonic() + limit + spare_time(limit)
        ended = partial(self._preparation.take_ended, attempt, scene)
        return ForkedExecution(attempt, process, wire, limit, deadline, sweep, ended)

    def _sweep(self, server: int) -> None:
        """End what a guardian has left that was killed: it has come to the fork server."""
        if server:
            end_children(
                server, lambda: [one.pid or 0 for one in self._guardians if _is_alive(one)]
            )

    def _fork_guarded(
        self, target: Callable[..., None], *task: RunTask | int
    ) -> tuple[ForkServerProcess, Connection]:
        process, wire = self._fork(target, *task)
        self._guardians = [*filter(_is_alive, self._guardians), process]
        return process, wire

    def _fork(
        self, target: Callable[..., None], *task: RunTask | int
    ) -> tuple[ForkServerProcess, Connection]:
        ours, theirs = self._context.Pipe(duplex=False)
        process = self._context.Process(target=target, args=(*task, theirs))
        try:
            with theirs, _without_main_module(), safe_fork_server():
                process.start()
        except (EOFError, OSError):
            ours.close()
            raise
        return process, ours


def _is_alive(process: ForkServerProcess) -> bool:
    try:
        return process.is_alive()
    except ValueError:  # closed
        return False


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
