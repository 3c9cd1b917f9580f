"""Runs as processes of this machine: forked from zygotes, one for each kind of system.

Nothing here waits for a process without a limit. One that is silent is killed, and the worker goes
on: runs that are lost with it are given back.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from pathlib import Path
from typing import Final

from daemon.batch import run_process
from daemon.batch.errors import WorkerBroken
from daemon.batch.run_process import LARGEST_MESSAGE, KernelTask, RunTask
from daemon.batch.worker._attempts import Attempt, AttemptEnd, Waitable
from daemon.model.deadline import spare_time, stopped_after
from daemon.model.execution import DEFAULT_EXECUTOR, RunLimits, python_command
from daemon.model.rehearsal import WITH_KERNELS, kernel_list
from daemon.model.spec import RunSpec
from daemon.model.status import Preparation, PreparationPhase
from grammars.text import codec

_LONGEST_REASON: Final = 4000
# Seconds until a zygote that says nothing is replaced: while it loads or compiles, which an
# executor that plugs in may do for long; and when it was asked for a process.
_PREPARING_LIMIT: Final = 600.0
_START_LIMIT: Final = 60.0
_KILL_PATIENCE: Final = 30.0
"""Seconds from the wish that a run ends to the end of its zygote, which kills for less time."""
_LAST_PATIENCE: Final = 5.0
"""Seconds until a run is given up that goes on without its zygote; and one is waited for."""


class ZygoteProcess:
    """A zygote, as its worker sees it; ``ready`` are the lists of kernels that it has loaded.

    ``failure`` says why it has ended, ``compiled`` how many kernels it has compiled while it does.
    """

    def __init__(self, executor: str) -> None:
        """Start it; raises ``OSError``."""
        self.wire, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.wire.setblocking(False)
        words = (str(theirs.fileno()), executor, str(os.getpid()))
        with theirs:
            self._process = subprocess.Popen(
                python_command("-m", "daemon.batch.zygote", *words),
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )
        self.ready: set[str] = set()
        self.failure = ""
        self.compiled: int | None = None
        # Lists it was asked for, and none: its own start.
        self._awaited = {""}
        self._answer_by = time.monotonic() + _PREPARING_LIMIT

    def prepare(self, spec: RunSpec, scene: Path, niceness: int) -> bool:
        """Whether the kernels of a run are loaded; has them loaded or compiled otherwise."""
        name = kernel_list(spec)
        if name in self.ready or name in self._awaited:
            return name in self.ready
        self._awaited.add(name)
        self._answer_by = time.monotonic() + _PREPARING_LIMIT
        order = run_process.PREPARE + codec.to_json(KernelTask(name, scene, niceness))
        with tempfile.TemporaryFile() as file, suppress(OSError):
            # Where it has ended, that is noticed when it is listened to.
            file.write(codec.to_json(spec))
            file.seek(0)
            socket.send_fds(self.wire, [order], [file.fileno()])
        return False

    def listen(self) -> None:
        """Take in what it has sent; end it when it has been silent for too long."""
        if self.failure:
            return
        try:
            for kind, content in _messages(self.wire):
                self._answer_by = time.monotonic() + _PREPARING_LIMIT
                if kind == run_process.COMPILED:
                    self.compiled = (self.compiled or 0) + int(content)
                elif kind == run_process.READY:
                    self.ready.add(content.decode())
                    self._awaited.discard(content.decode())
                    self.compiled = None
                elif kind == run_process.FAILED:
                    self.failure = content.decode("utf-8", "replace")
        except EOFError:
            self.end("the process that starts runs has ended")
        if self._awaited and time.monotonic() > self._answer_by:
            self.end(f"the process that starts runs was silent for {_PREPARING_LIMIT:g} s")

    def start(self, task: RunTask) -> socket.socket:
        """Ask for the process of a run; returns the socket to it. Raises ``OSError``."""
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        ours.setblocking(False)
        theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, LARGEST_MESSAGE)
        with theirs:
            try:
                request = run_process.RUN + codec.to_json(task)
                socket.send_fds(self.wire, [request], [theirs.fileno()])
            except OSError:
                ours.close()
                raise
        return ours

    def end(self, why: str = "") -> None:
        """Kill it; its runs end with it."""
        self.compiled = None
        self.failure = self.failure or why
        self._process.kill()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_LAST_PATIENCE)
        self.wire.close()


@dataclass(slots=True)
class ForkedExecution:
    """A running attempt; ``live`` and ``judged`` are what it last said of itself.

    Its end counts against the run unless it failed for want of a process, of space on the disk, or
    of the system under test.
    """

    attempt: Attempt
    zygote: ZygoteProcess
    wire: socket.socket
    limit: float
    deadline: float = field(default_factory=lambda: time.monotonic() + _START_LIMIT)
    live: bytes = b""
    judged: bytes = b""
    _started: bool = False
    _reason: str = ""
    _failure: bytes = run_process.FAILED
    _killed: bool = False
    _code: int | None = None

    @property
    def waitables(self) -> tuple[Waitable, ...]:
        """What the run and its zygote send."""
        return (self.wire,) if self._code is None else ()

    def listen(self) -> None:
        """Take in what was sent, keep the newest; end the run when its time is up."""
        if self._code is not None:
            return
        try:
            for kind, content in _messages(self.wire):
                self._take(kind, content)
        except EOFError:
            if self._code is None:
                self._lose("the process that starts runs has ended")
        if self._code is None and time.monotonic() > self.deadline:
            self._take_lateness()

    def _take(self, kind: bytes, content: bytes) -> None:
        if kind == run_process.LIVE:
            self.live = content
        elif kind == run_process.JUDGEMENT:
            self.judged = content
        elif kind == run_process.STARTED and not self._killed:
            # The run ends itself at its limit, and has a trace and a result that say so. Only what
            # cannot be interrupted is ended from here.
            self._started = True
            self.deadline = time.monotonic() + self.limit + spare_time(self.limit)
        elif kind in run_process.FAILURES and not self._killed:
            self._failure = kind
            self._reason = content.decode("utf-8", "replace")[-_LONGEST_REASON:]
        elif kind == run_process.ENDED:
            self._code = int(content)

    def _take_lateness(self) -> None:
        if self.zygote.failure:
            self._lose("its process does not end")
        elif self._killed or not self._started:
            self.zygote.end("the process that starts runs did not answer")
            self.deadline = time.monotonic() + _LAST_PATIENCE
        else:
            self.kill(stopped_after(self.limit))

    def _lose(self, why: str) -> None:
        """Give the process up: nobody is left who would say how it ends."""
        self._code = 1
        self._reason = self._reason or why
        if not self._started:
            self._failure = run_process.DISK_FULL

    @property
    def end(self) -> AttemptEnd | None:
        """Why there is no result, if so: what was printed, and last what ended the process."""
        if self._code is None:
            return None
        if self.attempt.finished:
            return AttemptEnd()
        reason = self._reason or _exit_reason(self._code)
        return AttemptEnd(
            "\n".join(filter(None, (self.attempt.output(), reason))),
            counts=self._failure == run_process.FAILED,
            sut_missing=self._failure == run_process.SUT_MISSING,
        )

    def watch(self, wanted: frozenset[run_process.WatchDetail]) -> None:
        """Tell the run what those who watch it want; a run that is over does not hear it."""
        with suppress(OSError):
            self.wire.send(run_process.WATCH + " ".join(wanted).encode())

    def kill(self, why: str = "") -> None:
        """Have the run ended, with all it has started: its end comes within a limit."""
        if self._killed or self._code is not None:
            return
        self._killed = True
        self._reason = why
        self.deadline = time.monotonic() + _KILL_PATIENCE
        with suppress(OSError):  # ended in that very moment
            self.wire.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        """Free what belongs to the ended process."""
        self.wire.close()


def _messages(wire: socket.socket) -> Iterator[tuple[bytes, bytes]]:
    """Yield what has come, kind and content; raises ``EOFError`` when the other end is gone."""
    while True:
        try:
            message = wire.recv(LARGEST_MESSAGE)
        except BlockingIOError:
            return
        except ConnectionResetError:
            continue  # it has not read all of ours; what it has sent is still to be read
        if not message:
            raise EOFError
        yield message[:1], message[1:]


def _exit_reason(code: int) -> str:
    if code < 0:
        names = {int(number): number.name for number in signal.Signals}
        return f"the run's process was killed by {names.get(-code, f'signal {-code}')}"
    return f"the run's process ended with code {code} and no result"


class ZygotePool:
    """Starts runs, ``slots`` at a time, each from the zygote of its kind."""

    trouble = ""
    """Its processes are children of the worker: what is wrong shows at the start."""

    def __init__(self, slots: int, executor: str = DEFAULT_EXECUTOR) -> None:
        self.slots = slots
        self._executor = executor
        # By the kind of system; the first one is of none yet.
        self._zygotes: dict[str, ZygoteProcess] = {}

    @property
    def waitables(self) -> tuple[Waitable, ...]:
        """What zygotes send; runs have their own."""
        return tuple(one.wire for one in self._zygotes.values() if not one.failure)

    @property
    def preparation(self) -> Preparation | None:
        """How far compiling is, while something is compiled."""
        counts = [one.compiled for one in self._zygotes.values() if one.compiled is not None]
        return Preparation(PreparationPhase.COMPILING, sum(counts)) if counts else None

    def listen(self) -> None:
        """Listen to the zygotes; runs are listened to one by one."""
        for kind, zygote in tuple(self._zygotes.items()):
            zygote.listen()
            if zygote.ready and zygote.failure:
                del self._zygotes[kind]  # the next run has another one started

    def warm_up(self) -> None:
        """Start a zygote and wait until it is there, without a kernel yet.

        Raises :class:`WorkerBroken` with the reason when it cannot execute runs.
        """
        try:
            zygote = self._zygotes[""] = ZygoteProcess(self._executor)
        except OSError as error:
            raise WorkerBroken(f"this worker cannot execute runs:\n{error}") from error
        while not zygote.ready:
            wait([zygote.wire], _PREPARING_LIMIT)
            zygote.listen()
            if zygote.failure:
                zygote.end()
                raise WorkerBroken(f"this worker cannot execute runs:\n{zygote.failure}")

    def prepare(self, spec: RunSpec, scene: Path, limits: RunLimits) -> bool:
        """Whether a run in the scene of this file can start with its kernels loaded.

        Sees to it otherwise. Raises ``OSError`` when there is no process to be had, and
        :class:`WorkerBroken` when the one that starts runs has ended.
        """
        kind = self._kind(spec)
        zygote = self._zygotes.get(kind)
        if zygote is None:
            zygote = self._zygotes.pop("", None) or ZygoteProcess(self._executor)
            self._zygotes[kind] = zygote
        if zygote.failure:
            zygote.end()
            del self._zygotes[kind]
            raise WorkerBroken(f"this worker cannot start runs:\n{zygote.failure}")
        if self._executor != DEFAULT_EXECUTOR:
            return "" in zygote.ready  # it loads what it needs by itself
        return zygote.prepare(spec, scene, limits.nice)

    def start(self, attempt: Attempt, scene: Path, limits: RunLimits) -> ForkedExecution:
        """Start the process of an attempt that was prepared for.

        Raises ``OSError`` when there is none to be had.
        """
        spec = attempt.lease.spec
        zygote = self._zygotes[self._kind(spec)]
        limit = limits.wall_of(spec.limit)
        task = RunTask(
            attempt.folder, scene, limits.memory, limits.nice, limit, self._likeness(spec)
        )
        return ForkedExecution(attempt, zygote, zygote.start(task), limit)

    def _kind(self, spec: RunSpec) -> str:
        if self._executor != DEFAULT_EXECUTOR:
            return ""
        # Systems that plug in are served by one: they have no kernels of ours.
        return spec.sut.kind if spec.sut.kind in WITH_KERNELS else "idle"

    def _likeness(self, spec: RunSpec) -> str:
        """Return what runs have in common that begin alike, of systems that ship here.

        What others do is for processes of their own, and files are within the reach of their run
        alone.
        """
        is_ours = self._executor == DEFAULT_EXECUTOR and spec.sut.kind in WITH_KERNELS
        if not is_ours or spec.files:
            return ""
        return repr((spec.scene, spec.map, spec.robot, spec.sut.kind))

    def close(self) -> None:
        """End the zygotes."""
        for zygote in self._zygotes.values():
            zygote.end()
