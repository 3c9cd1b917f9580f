"""The process that runs of one kind of system are forked from, with all they need in memory.

    python -m daemon.batch.zygote DESCRIPTOR EXECUTOR PARENT

A fresh process costs a run 13 to 20 ms when it is forked from a process that has numpy loaded, over
100 ms when it is spawned. It buys hard limits on time and memory, nothing left over from one seed
to the next, and a crash that costs one run. Not a plain fork of the worker: that has an open Zenoh
session and threads, and a child's first question hangs.

The descriptor is a socket. By it the worker first asks for the kernels of a run: the zygote loads
what the disk has, has a child compile the rest in a short run, once on a machine, and says how far
that is. Then each request starts a run, with a socket of its own. Once a run has ended well, what
it began with is done here for those like it. The zygote ends with its worker.
"""

from __future__ import annotations

import gc
import os
import signal
import socket
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib import import_module
from typing import Any, Final, NoReturn

from daemon.batch.run_process import (
    COMPILED,
    DISK_FULL,
    ENDED,
    FAILED,
    LEASE,
    LONGEST_WORDS,
    PREPARE,
    READY,
    RESULT,
    RUN,
    STARTED,
    KernelTask,
    RunTask,
    run_attempt,
)
from daemon.model.live_judgement import LiveJudgement
from daemon.model.messages import Lease
from daemon.model.spec import RunResult, RunSpec, Script
from daemon.model.status import LiveSnapshot
from daemon.supervision.child import (
    adopt_orphans,
    die_with_parent,
    lower_session,
    return_freed_memory,
)
from daemon.supervision.event_loop import HUNG_UP, EventLoop
from daemon.supervision.remains import KILL_LIMIT, end_children
from grammars.model.scene import Scene
from grammars.text import codec

_LARGEST_REQUEST: Final = 2**16
_SHORT_RUN: Final = 10.0
"""CPU seconds: a run that took longer may have begun with something that would keep the zygote from
starting others for too long, and what it began with is little of it."""

LARGE: Final = 1 << 20
"""Bytes of an array whose memory goes back to the system at once."""


class Zygote(EventLoop):
    """The life of this process: ``wire`` leads to its worker."""

    def __init__(self, wire: socket.socket, execute: Callable[..., RunResult]) -> None:
        super().__init__()
        self._wire = wire
        self._execute = execute
        # By the process of its guardian.
        self._runs: dict[int, tuple[RunTask, socket.socket]] = {}
        self._kill_at: dict[int, float] = {}
        self._begun: set[str] = set()
        # Lists of kernels by the process that compiles what is on them.
        self._rehearsals: dict[int, str] = {}
        self.watch(wire.fileno(), self._take_request)

    def live(self) -> None:
        """Serve the worker until it hangs up."""
        while not self.ending:
            moments = self._kill_at.values()
            self.turn(max(0.0, min(moments) - time.monotonic()) if moments else None)
            for process in [p for p, at in self._kill_at.items() if at <= time.monotonic()]:
                # It was stopped, say: the run dies with it, and the rest is ended from here.
                os.kill(process, signal.SIGKILL)
                del self._kill_at[process]

    def _take_request(self) -> None:
        request, files, _, _ = socket.recv_fds(self._wire, _LARGEST_REQUEST, 1)
        for file in files:
            os.set_inheritable(file, False)
        if request[:1] == RUN:
            self._start(codec.from_json(RunTask, request[1:]), socket.socket(fileno=files[0]))
        elif request[:1] == PREPARE:
            self._prepare(codec.from_json(KernelTask, request[1:]), files[0])
        else:
            self.end()

    # Runs

    def _start(self, task: RunTask, wire: socket.socket) -> None:
        lower_session(task.nice)
        try:
            process = os.fork()
        except OSError as error:
            wire.send(DISK_FULL + f"there is no room for a process: {error}".encode())
            wire.send(ENDED + b"1")
            wire.close()
            return
        if not process:
            self._become_child()
            self._wire.close()
            run_attempt(task, wire, self._execute)
        self._runs[process] = task, wire
        self.watch(wire.fileno(), partial(self._hang_up, process), HUNG_UP)
        wire.send(STARTED)

    def _become_child(self) -> None:
        """Let go of what is the zygote's alone, in a process it has forked."""
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for _, wire in self._runs.values():
            wire.close()

    def _hang_up(self, process: int) -> None:
        """The run is not wanted any more, as its guardian knows: give that the time to end it."""
        self.forget(self._runs[process][1].fileno())
        self._kill_at[process] = time.monotonic() + 2 * KILL_LIMIT

    def child_ended(self, process: int, code: int) -> None:
        """Report the end of a run when nothing of it is left."""
        if process in self._rehearsals:
            # It has told why, if it could not: a run that calls these kernels has the same trouble.
            self._load(self._rehearsals.pop(process))
            return
        if process not in self._runs:
            return  # a guardian that was killed has left it
        task, wire = self._runs.pop(process)
        if self._kill_at.pop(process, None) is None:
            self.forget(wire.fileno())
        # A guardian that has done its work ends with a code, or by the signal that ended the run.
        if code < 0:
            end_children(os.getpid(), lambda: (*self._runs, *self._rehearsals), reap=self.reap)
        is_new = code == 0 and task.likeness and task.likeness not in self._begun
        example = read_example(task) if is_new else None
        with suppress(OSError), wire:  # its worker does not listen any more
            wire.send(ENDED + str(code).encode())
        if example is not None:
            self._begun.add(task.likeness)
            _begin_like(*example)

    # Kernels

    def _prepare(self, task: KernelTask, file: int) -> None:
        """Load kernels; where one is missing, have a child compile all in a short run.

        Its memory, which is that of a compiler, goes with it.
        """
        # The compiler is nothing for executors that have no kernels: 70 MB.
        from daemon.model.kernels import load_list

        lower_session(task.nice)
        with open(file, "rb") as specification:
            if task.name in self._rehearsals.values():
                return
            if load_list(task.name):
                self._say_ready(task.name)
                return
            self._wire.send(COMPILED + b"0")
            reading, writing = os.pipe()
            zygote = os.getpid()
            process = os.fork()
            if not process:
                self._become_child()
                os.close(reading)
                die_with_parent(zygote)
                nice = max(task.nice, os.getpriority(os.PRIO_PROCESS, 0))
                os.setpriority(os.PRIO_PROCESS, 0, nice)
                rehearse_run(task, specification.read(), self._wire, writing)
        os.close(writing)
        self._rehearsals[process] = task.name
        self.watch(reading, partial(self._take_progress, task.name, reading))

    def _take_progress(self, name: str, reading: int) -> None:
        """Let runs start when the short run has driven; kernels that judge come meanwhile."""
        if os.read(reading, 1):
            self._load(name)
        else:
            self.forget(reading)
            os.close(reading)

    def _load(self, name: str) -> None:
        """Load what a short run has compiled, and let runs start."""
        from daemon.model.kernels import load_list

        load_list(name)
        self._say_ready(name)

    def _say_ready(self, name: str) -> None:
        _keep_for_good()
        self._wire.send(READY + name.encode())


def read_example(task: RunTask) -> tuple[RunSpec, Scene] | None:
    """Return the specification and the scene of a run that has ended, if it ended well and soon.

    What has ended in a process of its own, within its limits, ends in the zygote too.
    """
    try:
        result = codec.from_json(RunResult, (task.folder / RESULT).read_bytes())
        if result.ended == "crashed" or result.timing.cpu > _SHORT_RUN:
            return None
        lease = codec.from_json(Lease, (task.folder / LEASE).read_bytes())
        return lease.spec, codec.from_json(Scene, task.scene.read_bytes())
    except (OSError, ValueError):
        return None  # who delivers the result says what is wrong with it


def _begin_like(spec: RunSpec, scene: Scene) -> None:
    """Do what runs like ``spec`` in ``scene`` begin with, for those that come."""
    from daemon.run import prepare

    try:
        prepare(spec, scene)
    except Exception:
        # The disk is full, say: runs begin with it themselves, as before.
        traceback.print_exc()
    _keep_for_good()


def rehearse_run(task: KernelTask, spec: bytes, wire: socket.socket, driven: int) -> NoReturn:
    """Execute a short run, tell ``wire`` of each kernel that it compiles, and exit."""
    try:
        from daemon.run import rehearse

        rehearse(
            codec.from_json(RunSpec, spec),
            codec.from_json(Scene, task.scene.read_bytes()),
            lambda: wire.send(COMPILED + b"1"),
            lambda: os.write(driven, b"1"),
        )
    except BaseException:
        # The run itself fails like this, and says so: to whom, and of what, is known then.
        traceback.print_exc()
    os._exit(0)


def _keep_for_good() -> None:
    # A collection writes to every object it visits, and so copies the pages that children share
    # with this process. Garbage goes now; what is left is never looked at again by any collector.
    gc.collect()
    gc.freeze()


def _load(name: str) -> Callable[..., Any]:
    module_name, _, function = name.partition(":")
    module = import_module(module_name)
    if warm_up := getattr(module, "warm_up", None):
        warm_up()
    # Decoders and encoders are built once here, not once in every child; those of a specification
    # and of its script, which its digest asks for, take 15 ms.
    codec.warm_up(Lease, RunSpec, Script, Scene, RunResult, LiveSnapshot, LiveJudgement)
    execute: Callable[..., Any] = getattr(module, function)
    return execute


def main() -> None:
    """Load what every run needs, then fork runs until the worker is gone."""
    descriptor, executor, parent = sys.argv[1:]
    die_with_parent(int(parent))
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")  # a run is one thread of one core
    wire = socket.socket(fileno=int(descriptor))
    wire.set_inheritable(False)
    # With this S1 needs 11 MB less at its peak; and 28 MB less if the zygote, too, has had it when
    # it did what S1 begins with.
    return_freed_memory(LARGE)
    # What a guardian that was killed leaves behind comes to this process, which ends it.
    adopt_orphans()
    try:
        execute = _load(executor)
    except Exception:
        # Also of an executor that plugs in.
        wire.send(FAILED + traceback.format_exc()[-LONGEST_WORDS:].encode("utf-8", "replace"))
        return
    _keep_for_good()
    wire.send(READY)
    Zygote(wire, execute).live()


if __name__ == "__main__":
    main()
