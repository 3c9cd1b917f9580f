"""The process that runs of one kind of system are forked from, with all they need in memory.

    python -m daemon.batch.zygote DESCRIPTOR EXECUTOR PARENT

A fresh process costs a run 13 to 20 ms when it is forked from a process that has numpy loaded, over
100 ms when it is spawned. It buys hard limits on time and memory, nothing left over from one seed
to the next, and a crash that costs one run. Not a plain fork of the worker: that has an open Zenoh
session and threads, and a child's first question hangs.

The descriptor is a socket. By it the worker first asks for kernels: the zygote loads what the disk
has, has a child compile the rest, once on a machine, and says how far that is. Then each request
starts a run, with a socket of its own. Once a run has ended well, what it began with is done here
for those like it. The zygote ends with its worker.
"""

from __future__ import annotations

import ctypes
import fcntl
import gc
import os
import signal
import socket
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from daemon.batch.numba_cache import numba_cache_folder
from daemon.batch.run_process import (
    DISK_FULL,
    ENDED,
    FAILED,
    LEASE,
    LONGEST_WORDS,
    PREPARATION,
    PREPARE,
    READY,
    RESULT,
    RUN,
    STARTED,
    RunTask,
    run_attempt,
)
from daemon.model.execution import DEFAULT_EXECUTOR
from daemon.model.live_judgement import LiveJudgement
from daemon.model.messages import Lease
from daemon.model.spec import RunResult, RunSpec, Script
from daemon.model.status import LiveSnapshot, Preparation, PreparationPhase
from daemon.supervision.child import adopt_orphans, die_with_parent, lower_session
from daemon.supervision.event_loop import HUNG_UP, EventLoop
from daemon.supervision.remains import KILL_LIMIT, end_children
from grammars.model.scene import Scene
from grammars.text import codec

_LARGEST_REQUEST: Final = 2**16
_SHORT_RUN: Final = 10.0
"""CPU seconds: a run that took longer may have begun with something that would keep the zygote from
starting others for too long, and what it began with is little of it."""
_LOOK_AT_LOCK: Final = 0.5
_MMAP_THRESHOLD: Final = -3
"""Number of the parameter in malloc.h."""
_LARGE: Final = 1 << 20
"""What is larger gets pages of its own from the system [B]."""


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
            niceness, *rooms = request[1:].decode().split()
            self._prepare(rooms, int(niceness))
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
            run_attempt(task, wire, self._execute)
        self._runs[process] = task, wire
        self.watch(wire.fileno(), partial(self._hang_up, process), HUNG_UP)
        wire.send(STARTED)

    def _become_child(self) -> None:
        """Let go of what is the zygote's alone, in a process it has forked."""
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        self._wire.close()
        for _, wire in self._runs.values():
            wire.close()

    def _hang_up(self, process: int) -> None:
        """The run is not wanted any more, as its guardian knows: give that the time to end it."""
        self.forget(self._runs[process][1].fileno())
        self._kill_at[process] = time.monotonic() + 2 * KILL_LIMIT

    def child_ended(self, process: int, code: int) -> None:
        """Report the end of a run when nothing of it is left."""
        if process not in self._runs:
            return  # a guardian that was killed has left it
        task, wire = self._runs.pop(process)
        if self._kill_at.pop(process, None) is None:
            self.forget(wire.fileno())
        # A guardian that has done its work ends with a code, or by the signal that ended the run.
        if code < 0:
            end_children(os.getpid(), lambda: self._runs, reap=self.reap)
        is_new = code == 0 and task.likeness and task.likeness not in self._begun
        example = read_example(task) if is_new else None
        with suppress(OSError), wire:  # its worker does not listen any more
            wire.send(ENDED + str(code).encode())
        if example is not None:
            self._begun.add(task.likeness)
            _begin_like(*example)

    # Kernels

    def _prepare(self, rooms: list[str], niceness: int) -> None:
        lower_session(niceness)
        missing = _load_kernels(rooms)
        if missing and not self._compile(missing, niceness):
            self.end()
            return
        _load_kernels(missing)
        _keep_for_good()
        self._wire.send(READY)

    def _compile(self, rooms: list[str], niceness: int) -> bool:
        """Have a child compile what the disk does not have; return whether it has done so.

        Its memory, which is that of a compiler, goes with it.
        """
        zygote = os.getpid()
        process = os.fork()
        if not process:
            signal.set_wakeup_fd(-1)
            die_with_parent(zygote)
            os.setpriority(os.PRIO_PROCESS, 0, max(niceness, os.getpriority(os.PRIO_PROCESS, 0)))
            compile_kernels(rooms, self._wire)
        _, status = os.waitpid(process, 0)
        code = os.waitstatus_to_exitcode(status)
        if code < 0:
            self._wire.send(FAILED + f"compiling was ended by signal {-code}".encode())
        return code == 0


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
    from daemon.model.kernels import loading_only
    from daemon.run import prepare

    try:
        with loading_only():
            prepare(spec, scene)
    except Exception:
        # The disk is full, say: runs begin with it themselves, as before.
        traceback.print_exc()
    _keep_for_good()


def compile_kernels(rooms: list[str], wire: socket.socket) -> None:
    """Compile the kernels of ``rooms``, tell ``wire`` how far that is or why not, and exit."""
    try:
        with compiling_alone(numba_cache_folder(), wire):
            for done, room in enumerate(rooms):
                _tell(wire, Preparation(PreparationPhase.COMPILING, done, len(rooms)))
                import_module(room).warm_up()
    except BaseException:
        # Nothing a run could help: the worker gives back what needs these kernels.
        wire.send(FAILED + traceback.format_exc()[-LONGEST_WORDS:].encode("utf-8", "replace"))
        os._exit(1)
    os._exit(0)


@contextmanager
def compiling_alone(folder: Path, wire: socket.socket) -> Iterator[None]:
    """Wait until no other process compiles into ``folder``, and say so.

    What it has left there is loaded afterwards, not compiled once more.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "kernels.lock").open("ab")
    except OSError:
        yield  # nobody can be waited for: a file system that cannot be written
        return
    with lock:
        while True:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                # Again and again: who says nothing for long is replaced.
                _tell(wire, Preparation(PreparationPhase.WAITING))
                time.sleep(_LOOK_AT_LOCK)
                continue
            except OSError:
                pass  # a file system without locks
            break
        yield


def _tell(wire: socket.socket, preparation: Preparation) -> None:
    wire.send(PREPARATION + codec.to_json(preparation))


def _load_kernels(rooms: list[str]) -> list[str]:
    """Load the kernels of rooms as far as they are on the disk; return the other rooms."""
    missing = []
    for room in rooms:
        # The compiler is nothing for executors that have no kernels: 70 MB.
        from daemon.model.kernels import loading_only

        try:
            with loading_only():
                import_module(room).warm_up()
        except Exception:
            # Not on the disk; or something is wrong, and the child that compiles it says what.
            missing.append(room)
    return missing


def _keep_for_good() -> None:
    # A collection writes to every object it visits, and so copies the pages that children share
    # with this process. Garbage goes now; what is left is never looked at again by any collector.
    gc.collect()
    gc.freeze()


def return_freed_memory() -> None:
    """Have the memory of large arrays go back to the system whenever one is freed."""
    # Whoever frees a grid of megabytes has the next ones taken from the heap, which returns nothing
    # to the system (mallopt(3), M_MMAP_THRESHOLD, a limit that moves unless it is set). With a
    # fixed one S1 needs 11 MB less at its peak; and 28 MB less if the zygote, too, has had one
    # when it did what S1 begins with.
    with suppress(AttributeError):  # of glibc alone
        ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, _LARGE)


def _load(name: str) -> Callable[..., Any]:
    module_name, _, function = name.partition(":")
    module = import_module(module_name)
    if name == DEFAULT_EXECUTOR:
        module.warm_up(rooms=())
    elif warm_up := getattr(module, "warm_up", None):
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
    return_freed_memory()
    # What a guardian that was killed leaves behind comes to this process, which ends it.
    adopt_orphans()
    try:
        execute = _load(executor)
    except Exception:
        # Also of an executor that plugs in.
        wire.send(FAILED + traceback.format_exc()[-LONGEST_WORDS:].encode("utf-8", "replace"))
        return
    Zygote(wire, execute).live()


if __name__ == "__main__":
    main()
