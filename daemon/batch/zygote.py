"""Zygote: a process with everything in memory from which runs of one kind of system are forked.

    python -m daemon.batch.zygote DESCRIPTOR EXECUTOR PARENT

A fresh process costs a run 13 to 20 ms when it is forked from a process with numpy, over 100 ms
when it is spawned. It gives hard limits on time and memory, no leftovers between seeds, and a crash
costs only one run. The worker itself cannot be forked: it has an open Zenoh session and threads, so
a child's first request would hang.

The descriptor is a socket. The worker first asks for the kernels of a run: the zygote loads those
on the disk, lets a child compile the rest in a short run, once on a machine, and reports progress.
Each further request starts a run, with a socket of its own. After the first good run of a likeness
the zygote fills its own caches for the next ones. The zygote ends with its worker.
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
"""Longest run whose start the zygote repeats [CPU s]: after a longer one this could block other
starts, and would save little."""

LARGE: Final = 1 << 20
"""Size of arrays whose memory returns to the system at once [B]."""


class Zygote(EventLoop):
    """The zygote of this process; ``wire`` is the socket to its worker."""

    def __init__(self, wire: socket.socket, execute: Callable[..., RunResult]) -> None:
        super().__init__()
        self._wire = wire
        self._execute = execute
        # Runs by the process of their guardian.
        self._runs: dict[int, tuple[RunTask, socket.socket]] = {}
        self._kill_at: dict[int, float] = {}
        self._prepared: set[str] = set()
        # Lists of kernels by the process that compiles them.
        self._rehearsals: dict[int, str] = {}
        self.watch(wire.fileno(), self._take_request)

    def live(self) -> None:
        """Serve the worker until it hangs up."""
        while not self.ending:
            moments = self._kill_at.values()
            self.turn(max(0.0, min(moments) - time.monotonic()) if moments else None)
            for process in [p for p, at in self._kill_at.items() if at <= time.monotonic()]:
                # A stopped guardian, say: the run dies with it, and the zygote ends the rest.
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
        """Close the zygote's own resources in a process it has forked."""
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for _, wire in self._runs.values():
            wire.close()

    def _hang_up(self, process: int) -> None:
        """Set a deadline for the guardian to end a run that the worker has abandoned."""
        self.forget(self._runs[process][1].fileno())
        self._kill_at[process] = time.monotonic() + 2 * KILL_LIMIT

    def child_ended(self, process: int, code: int) -> None:
        """Report the end of a run when all its processes have ended."""
        if process in self._rehearsals:
            # After an error too: a run that calls these kernels reports the same error.
            self._load(self._rehearsals.pop(process))
            return
        if process not in self._runs:
            return  # an orphan of a killed guardian
        task, wire = self._runs.pop(process)
        if self._kill_at.pop(process, None) is None:
            self.forget(wire.fileno())
        # A signal may have ended the guardian before it could end the rest.
        if code < 0:
            end_children(os.getpid(), lambda: (*self._runs, *self._rehearsals), reap=self.reap)
        is_new = code == 0 and task.likeness and task.likeness not in self._prepared
        example = read_example(task) if is_new else None
        with suppress(OSError), wire:  # the worker may have closed it
            wire.send(ENDED + str(code).encode())
        if example is not None:
            self._prepared.add(task.likeness)
            _prepare_like(*example)

    # Kernels

    def _prepare(self, task: KernelTask, file: int) -> None:
        """Load kernels; if one is missing, let a child compile all in a short run.

        The compiler's memory ends with the child.
        """
        # Executors without kernels need no compiler (70 MB).
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
        """Let runs start when the short run has driven; the judge's kernels may come later."""
        if os.read(reading, 1):
            self._load(name)
        else:
            self.forget(reading)
            os.close(reading)

    def _load(self, name: str) -> None:
        """Load the kernels of a short run, and let runs start."""
        from daemon.model.kernels import load_list

        load_list(name)
        self._say_ready(name)

    def _say_ready(self, name: str) -> None:
        _keep_for_good()
        self._wire.send(READY + name.encode())


def read_example(task: RunTask) -> tuple[RunSpec, Scene] | None:
    """Return the specification and the scene of a run that has ended well and soon.

    A run that ended within its limits in its own process also ends in the zygote.
    """
    try:
        result = codec.from_json(RunResult, (task.folder / RESULT).read_bytes())
        if result.ended == "crashed" or result.timing.cpu > _SHORT_RUN:
            return None
        lease = codec.from_json(Lease, (task.folder / LEASE).read_bytes())
        return lease.spec, codec.from_json(Scene, task.scene.read_bytes())
    except (OSError, ValueError):
        return None  # the delivery of the result reports the error


def _prepare_like(spec: RunSpec, scene: Scene) -> None:
    """Fill the caches of runs like ``spec`` in ``scene``, for later runs."""
    from daemon.run import prepare

    try:
        prepare(spec, scene)
    except Exception:
        # For example on a full disk: runs then do it themselves, as before.
        traceback.print_exc()
    _keep_for_good()


def rehearse_run(task: KernelTask, spec: bytes, wire: socket.socket, driven: int) -> NoReturn:
    """Execute a short run, report each compiled kernel to ``wire``, and exit."""
    try:
        from daemon.run import rehearse

        rehearse(
            codec.from_json(RunSpec, spec),
            codec.from_json(Scene, task.scene.read_bytes()),
            lambda: wire.send(COMPILED + b"1"),
            lambda: os.write(driven, b"1"),
        )
    except BaseException:
        # The run itself fails in the same way, and reports it with its name.
        traceback.print_exc()
    os._exit(0)


def _keep_for_good() -> None:
    # A collection writes to every object it visits, and so copies the pages that children share
    # with this process. Collect the garbage now; no later collection visits the rest.
    gc.collect()
    gc.freeze()


def _load(name: str) -> Callable[..., Any]:
    module_name, _, function = name.partition(":")
    module = import_module(module_name)
    if warm_up := getattr(module, "warm_up", None):
        warm_up()
    # Build decoders and encoders here, not in every child; those of a specification and its
    # script take 15 ms.
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
    # This lowers the peak of S1 by 11 MB, and by 28 MB if the zygote has prepared for it.
    return_freed_memory(LARGE)
    # Orphans of a killed guardian come to this process, which ends them.
    adopt_orphans()
    try:
        execute = _load(executor)
    except Exception:
        # The executor may be a plug-in.
        wire.send(FAILED + traceback.format_exc()[-LONGEST_WORDS:].encode("utf-8", "replace"))
        return
    _keep_for_good()
    wire.send(READY)
    Zygote(wire, execute).live()


if __name__ == "__main__":
    main()
