"""Tells the fork server what the runs that come need, and has compiled what it lacks.

That is the kernels of their rooms; and what a run began with that has ended well is done there once
for those like it, which are forked from the server and find it done.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Hashable
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Final

from daemon.batch import kernel_compilation
from daemon.batch.errors import WorkerBroken
from daemon.batch.worker._attempts import Attempt, Waitable
from daemon.model.execution import DEFAULT_EXECUTOR, EXECUTOR_VARIABLE, PREPARATION_VARIABLE
from daemon.model.kernel_rooms import RUN_ROOMS, kernel_rooms
from daemon.model.spec import RunSpec, SutReference
from daemon.model.status import Preparation, PreparationPhase
from grammars.text import codec

_NO_ANSWER: Final = "the process that compiles machine code ended without an answer"

_COUNTING: Final = 1.0
"""Seconds between two changes of what is said about compiling."""


_SHORT_RUN: Final = 10.0
"""CPU seconds: a run that took longer may have begun with something that would keep the fork server
from starting others for too long, and what it began with is little of it."""


class ForkServerPreparation:
    """What the fork server has been told, and the process that compiles what it lacks.

    ``fork`` starts a process from the fork server, given what it executes and its arguments. The
    server loads what is listed, if the disk has it, before it forks (see
    :mod:`daemon.batch.forkserver_preload`).
    """

    def __init__(self, fork: Callable[..., tuple[ForkServerProcess, Connection]]) -> None:
        self._fork = fork
        self._list, os.environ[PREPARATION_VARIABLE] = _new_list()
        self._listings = 0
        self._rooms: dict[str, None] = {}
        self._begun: set[Hashable] = set()
        self._example = b""
        self._ready: set[str] = set()
        self._compiling: tuple[ForkServerProcess, Connection] | None = None
        self._answered = False
        self._failure = ""
        self._count_at = 0.0
        self.standing: Preparation | None = None
        """How far compiling is, while something is compiled."""

    @property
    def waitables(self) -> tuple[Waitable, ...]:
        """What the process that compiles sends, while there is one."""
        return (self._compiling[1],) if self._compiling is not None else ()

    def prepare(self, sut: SutReference, niceness: int) -> bool:
        """Return whether the fork server has what a run of ``sut`` needs; see to it otherwise.

        Raises :class:`WorkerBroken` with the reason when that cannot be compiled, and ``OSError``
        or ``EOFError`` when there is no process to be had.
        """
        if os.environ.get(EXECUTOR_VARIABLE) != DEFAULT_EXECUTOR:
            return True  # loads what it needs by itself
        if self._failure:
            failure, self._failure = self._failure, ""
            raise WorkerBroken(f"this worker has no machine code for runs:\n{failure}")
        rooms = kernel_rooms(sut.kind, sut.parameters)
        if self._ready.issuperset(rooms):
            return True
        if self._compiling is None:
            self._rooms |= dict.fromkeys(rooms)
            self._write_list()
            self._answered = False
            self._compiling = self._fork(kernel_compilation.compile_kernels, niceness)
            self.listen()
        return False

    def take_ended(self, attempt: Attempt, scene: Path) -> None:
        """Have the fork server do what a run in the scene of that file began with.

        Only of one that has ended well, once for each map and kind of system, and of systems that
        ship here: what others do is for processes of their own.
        """
        spec = attempt.lease.spec
        likeness = (spec.scene, spec.map, spec.robot, spec.sut.kind)
        if likeness in self._begun or not _may_be_prepared(spec) or not attempt.finished:
            return
        try:
            result = attempt.result()
        except (OSError, ValueError):
            return  # who delivers it says what is wrong with it
        # What has just ended in a process of its own, within its limits, ends in the server too.
        if result.ended == "crashed" or result.timing.cpu > _SHORT_RUN:
            return
        self._begun.add(likeness)
        self._example = b"\n".join((b"", str(scene).encode(), codec.to_json(spec)))
        self._write_list()

    def listen(self) -> None:
        """Take in what the process that compiles has sent."""
        if self._compiling is None:
            return
        process, wire = self._compiling
        try:
            while wire.poll():
                self._take(wire.recv_bytes())
        except (EOFError, OSError):
            if not self._answered:
                self._failure = _NO_ANSWER
            process.join()
            process.close()
            wire.close()
            self._compiling, self.standing = None, None

    def _take(self, message: bytes) -> None:
        kind, content = message[:1], message[1:].decode("utf-8", "replace")
        if kind == kernel_compilation.COUNT:
            self._count(*map(int, content.split()))
            return
        if kind == kernel_compilation.WAITING:
            self.standing = Preparation(PreparationPhase.WAITING)
            return
        self._answered = True
        if kind == kernel_compilation.READY:
            self._ready.update(self._rooms)
            # Before the next fork the server looks again, and loads what has been compiled.
            self._write_list()
        else:
            self._failure = content

    def _count(self, done: int, total: int) -> None:
        # The daemon is told what changes here, and some kernels take a tenth of a second.
        now = time.monotonic()
        if now >= self._count_at:
            self._count_at = now + _COUNTING
            self.standing = Preparation(PreparationPhase.COMPILING, done, total)

    def _write_list(self) -> None:
        self._listings += 1
        words = " ".join((str(self._listings), *self._rooms)).encode() + self._example
        os.pwrite(self._list, words, 0)
        os.ftruncate(self._list, len(words))


def _may_be_prepared(spec: RunSpec) -> bool:
    ours = kernel_rooms(spec.sut.kind, spec.sut.parameters) != RUN_ROOMS
    executed = os.environ.get(EXECUTOR_VARIABLE) == DEFAULT_EXECUTOR
    # Files are within the reach of their run alone.
    return ours and executed and not spec.files


def _new_list() -> tuple[int, str]:
    """Return a file, open, and its path: read by the fork server, gone with this process."""
    # It is there on a full disk as well.
    opened = os.memfd_create("preparation")
    return opened, f"/proc/{os.getpid()}/fd/{opened}"
