"""Runs as processes of this machine: forked from zygotes, one for each kind of system.

Every wait for a process has a limit. A silent process is killed, and its runs are returned.
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
from daemon.model.spec import WITH_KERNELS, RunSpec, kernel_list
from daemon.model.status import Preparation, PreparationPhase
from grammars.text import codec

_LONGEST_REASON: Final = 4000
# Seconds of silence after which a zygote is replaced: while it loads or compiles, which may take
# long in an executor that is a plug-in; and after a request for a process.
_PREPARING_LIMIT: Final = 600.0
_START_LIMIT: Final = 60.0
_KILL_PATIENCE: Final = 30.0
"""Time from the kill of a run to that of its zygote [s], longer than the zygote's own limit."""
_LAST_PATIENCE: Final = 5.0
"""Time for the end of a killed zygote, and of a run without its zygote [s]."""


class ZygoteProcess:
    """A zygote for its worker; ``ready`` are the lists of kernels that it has loaded.

    ``failure`` is the reason of its end, ``compiled`` the number of kernels during compilation.
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
        self._count = 0
        # Requested lists; the empty name is its own start.
        self._awaited = {""}
        self._answer_by = time.monotonic() + _PREPARING_LIMIT

    def prepare(self, spec: RunSpec, scene: Path, niceness: int) -> bool:
        """Return whether the kernels of a run are loaded; otherwise request them."""
        name = kernel_list(spec)
        if name in self.ready or name in self._awaited:
            return name in self.ready
        self._awaited.add(name)
        self._answer_by = time.monotonic() + _PREPARING_LIMIT
        order = run_process.PREPARE + codec.to_json(KernelTask(name, scene, niceness))
        with tempfile.TemporaryFile() as file, suppress(OSError):
            # ``listen`` notices if the zygote has ended.
            file.write(codec.to_json(spec))
            file.seek(0)
            socket.send_fds(self.wire, [order], [file.fileno()])
        return False

    def listen(self) -> None:
        """Read its messages; end it after too long a silence."""
        if self.failure:
            return
        try:
            for kind, content in _messages(self.wire):
                self._answer_by = time.monotonic() + _PREPARING_LIMIT
                if kind == run_process.COMPILED:
                    # The judge's kernels come after runs can start: the count goes on.
                    self.compiled = self._count = self._count + int(content)
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
        """Request the process of a run; return the socket to it. Raises ``OSError``."""
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
    """A running attempt; ``live`` and ``judged`` are its latest snapshot and judgement.

    Its end counts against the run unless a process, space on the disk, or the system under test was
    missing.
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
        """The socket of the run, until its end."""
        return (self.wire,) if self._code is None else ()

    def listen(self) -> None:
        """Read the messages, keep the newest; end the run when its time is up."""
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
            # The run ends itself at its limit, with a trace and a result. Only uninterruptible code
            # is ended from here.
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
        """Give up the process: its zygote cannot report its end any more."""
        self._code = 1
        self._reason = self._reason or why
        if not self._started:
            self._failure = run_process.DISK_FULL

    @property
    def end(self) -> AttemptEnd | None:
        """The end of the attempt; without a result its output and the reason."""
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

    def watch(self, details: frozenset[run_process.WatchDetail]) -> None:
        """Forward the watchers' requests to the run, unless it is over."""
        with suppress(OSError):
            self.wire.send(run_process.WATCH + " ".join(details).encode())

    def kill(self, why: str = "") -> None:
        """End the run with all its processes, within a limit."""
        if self._killed or self._code is not None:
            return
        self._killed = True
        self._reason = why
        self.deadline = time.monotonic() + _KILL_PATIENCE
        with suppress(OSError):  # it may just have ended
            self.wire.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        """Free the socket of the ended process."""
        self.wire.close()


def _messages(wire: socket.socket) -> Iterator[tuple[bytes, bytes]]:
    """Yield kind and content of messages; raises ``EOFError`` when the other end is gone."""
    while True:
        try:
            message = wire.recv(LARGEST_MESSAGE)
        except BlockingIOError:
            return
        except ConnectionResetError:
            continue  # it has not read all our messages; its own are still to be read
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
    """Always empty: its processes are children of the worker, so troubles appear at a start."""

    def __init__(self, slots: int, executor: str = DEFAULT_EXECUTOR) -> None:
        self.slots = slots
        self._executor = executor
        # By the kind of system; a new one has no kind yet.
        self._zygotes: dict[str, ZygoteProcess] = {}

    @property
    def waitables(self) -> tuple[Waitable, ...]:
        """The sockets of the zygotes; runs have their own."""
        return tuple(one.wire for one in self._zygotes.values() if not one.failure)

    @property
    def preparation(self) -> Preparation | None:
        """Progress of compilation, if any."""
        counts = [one.compiled for one in self._zygotes.values() if one.compiled is not None]
        return Preparation(PreparationPhase.COMPILING, sum(counts)) if counts else None

    def listen(self) -> None:
        """Read the messages of the zygotes; runs have their own."""
        for kind, zygote in tuple(self._zygotes.items()):
            zygote.listen()
            if zygote.ready and zygote.failure:
                del self._zygotes[kind]  # the next run starts another one

    def warm_up(self) -> None:
        """Start a zygote and wait until it is ready, without kernels.

        Raises :class:`WorkerBroken` with the reason if it cannot execute runs.
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
        """Return whether a run in the scene of this file can start with its kernels loaded.

        Otherwise request them. Raises ``OSError`` when no process can be started, and
        :class:`WorkerBroken` when the zygote has ended.
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
            return "" in zygote.ready  # the executor loads its modules itself
        return zygote.prepare(spec, scene, limits.nice)

    def start(self, attempt: Attempt, scene: Path, limits: RunLimits) -> ForkedExecution:
        """Start the process of a prepared attempt; raises ``OSError``."""
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
        # One zygote serves all plug-in systems: they have no kernels of ours.
        return spec.sut.kind if spec.sut.kind in WITH_KERNELS else "idle"

    def _likeness(self, spec: RunSpec) -> str:
        """Return the common properties of runs that begin alike, or an empty text.

        Only for our own systems without files: plug-ins run only in processes of their own, and
        files are only reachable in their run.
        """
        is_ours = self._executor == DEFAULT_EXECUTOR and spec.sut.kind in WITH_KERNELS
        if not is_ours or spec.files:
            return ""
        return repr((spec.scene, spec.map, spec.robot, spec.sut.kind))

    def close(self) -> None:
        """End the zygotes."""
        for zygote in self._zygotes.values():
            zygote.end()
