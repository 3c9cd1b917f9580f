"""The process of one run: fresh, niced, limited, and ended with its worker.

It reads ``grant.json`` and the scene, executes the run, and writes ``trace.mcap`` and, last,
``result.json`` into its attempt's folder: a result implies a complete trace. Its output, and its
place in the code after a crash, go to ``output.txt``. A guardian above it
(:mod:`daemon.supervision.guardian`) ends all its processes with it.
"""

from __future__ import annotations

import errno
import faulthandler
import inspect
import os
import resource
import signal
import socket
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Final, Literal, NoReturn

from daemon.model.attachments import FILES_VARIABLE, SutMissing
from daemon.model.deadline import spare_time, wall_clock_limit
from daemon.model.live_judgement import LiveJudgement, pack_judgement
from daemon.model.messages import Lease
from daemon.model.spec import RunResult, Snapshot, bound_result
from daemon.model.status import LiveSnapshot
from daemon.model.verdicts import Outcome
from daemon.supervision.guardian import guard
from daemon.supervision.output_file import OutputFile
from grammars.model.scene import Scene
from grammars.text import codec
from grammars.text.files import sync_directory, write_atomically

LEASE: Final = "grant.json"
TRACE: Final = "trace.mcap"
OUTPUT: Final = "output.txt"
RESULT: Final = "result.json"
FILES: Final = "files"
"""Link to the files of systems under test, if needed."""


class WatchDetail(StrEnum):
    """Data that watchers request from a run in addition to its progress.

    ``MARGIN``, the least so far, is for watchers of all runs; ``DETAILS`` and ``JUDGEMENT`` are for
    watchers of this one.
    """

    MARGIN = "margin"
    DETAILS = "details"
    JUDGEMENT = "judgement"


# Messages arrive whole or not at all; the first byte is the kind. From the worker to a zygote:
PREPARE: Final = b"P"
"""A :class:`KernelTask` in JSON, with a file that has the specification of a run."""
RUN: Final = b"R"
"""A :class:`RunTask` in JSON, with the socket of the run."""
# From a zygote to the worker:
COMPILED: Final = b"P"
"""Number of kernels compiled since the last such message."""
READY: Final = b"R"
"""Name of a list of loaded kernels; empty when the zygote itself is ready."""
# From the process of a run, or the zygote for it, to the worker:
STARTED: Final = b"S"
LIVE: Final = b"L"
JUDGEMENT: Final = b"J"
FAILED: Final = b"F"
DISK_FULL: Final = b"N"
SUT_MISSING: Final = b"K"
"""The system under test is not installed here: not the run's fault."""
FAILURES: Final = (FAILED, DISK_FULL, SUT_MISSING)
ENDED: Final = b"E"
"""Exit code of the guardian, after all processes of the run have ended."""
# From the worker to the process of a run:
WATCH: Final = b"W"
"""The requested :class:`WatchDetail` words."""
LARGEST_MESSAGE: Final = 2**19
"""Bytes; sockets take less."""

_DISK_ERRORS: Final = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.ESTALE)
"""Errors of a disk that takes no trace now: full, read-only, failing, gone."""
# Seconds between two snapshots: five a second are enough for a list, ten for a moving picture.
_LIVE_PERIOD: Final = 0.2
_WATCHED_PERIOD: Final = 0.1
LONGEST_WORDS: Final = 16_000
"""Longest reason for a missing result [characters]: an exception may have megabytes."""
_OOM_SCORE: Final = "500"
"""Half of the largest score (proc(5)): the kernel kills a run before its worker, which can start it
again, and before people's other programs."""


@dataclass(frozen=True, slots=True)
class RunTask:
    """The order to execute a run.

    It has the attempt's folder, the scene's file, the memory limit [B] or 0, the niceness, and the
    wall clock limit [s]. Runs of the same ``likeness`` begin alike; it is empty if unknown.
    """

    folder: Path
    scene: Path
    memory: int
    nice: int
    wall: float
    likeness: str = ""


@dataclass(frozen=True, slots=True)
class KernelTask:
    """The order to load the kernels in the list ``name``, and to compile missing ones.

    A run in the scene of this file calls them; ``nice`` is as in :class:`RunTask`.
    """

    name: str
    scene: Path
    nice: int


def read_output(folder: Path) -> bytes:
    """Return the output of an attempt, only its first and last part beyond a MiB."""
    return OutputFile.read(folder / OUTPUT)


def run_attempt(task: RunTask, wire: socket.socket, execute: Callable[..., RunResult]) -> NoReturn:
    """Execute one run; exit with 0 if there is a result."""
    try:
        # First: all later errors, in C++ too, then go to the output.
        guard(task.folder / OUTPUT, lifeline=wire)
    except OSError as error:
        wire.send(DISK_FULL + f"there is no room for a process: {error}".encode())
        _exit(1)
    try:
        _prepare_process(task)
        lease = codec.from_json(Lease, (task.folder / LEASE).read_bytes())
        scene = codec.from_json(Scene, task.scene.read_bytes())
        trace = task.folder / TRACE
        reporter = SnapshotSender(lease.run, wire)
        # Only on request: executors that are plug-ins need not know them.
        options: dict[str, object] = {"leads": True} if lease.leads else {}
        if "judgements" in inspect.signature(execute).parameters:
            options["judgements"] = reporter
        with wall_clock_limit(task.wall):
            result = execute(
                lease.spec,
                scene,
                trace_path=trace,
                on_progress=reporter,
                interest=reporter.interest,
                **options,
            )
        _write_result(result, trace, task.folder)
    except SutMissing as error:
        wire.send(SUT_MISSING + str(error)[:LONGEST_WORDS].encode("utf-8", "replace"))
        _exit(1)
    except BaseException as error:
        # There is no verdict, also after a plug-in that exits: the worker returns the run with
        # these words.
        no_room = isinstance(error, OSError) and error.errno in _DISK_ERRORS
        words = traceback.format_exc()[-LONGEST_WORDS:]
        wire.send((DISK_FULL if no_room else FAILED) + words.encode("utf-8", "replace"))
        _exit(1)
    _exit(0)


def _exit(code: int) -> NoReturn:
    """End without waiting for threads of the system under test."""
    # os._exit also skips the atexit handlers, including those of a system under test.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _write_result(result: RunResult, trace: Path, folder: Path) -> None:
    # The result is last and synchronised after the trace, so it implies a complete attempt.
    if not trace.is_file():
        raise FileNotFoundError(f"the run left no trace at {trace.name}")
    bound = bound_result(result)
    if len(bound.verdicts) < len(result.verdicts):
        bound = replace(bound, outcome=Outcome.ERROR)  # no verdict proves another outcome
    data = codec.to_json(bound)
    codec.from_json(RunResult, data)  # raises for values that JSON cannot carry, such as a NaN
    # The trace is on the disk, its name may not be. A result must never exist without it, since a
    # worker delivers both after a power cut.
    sync_directory(folder)
    write_atomically(folder / RESULT, data)


def _prepare_process(task: RunTask) -> None:
    if (task.folder / FILES).exists():
        os.environ[FILES_VARIABLE] = str(task.folder / FILES)
    # Python seeds its own generator in a child, numpy does not: all runs of a zygote would draw
    # the same numbers from an unseeded generator, and look deterministic.
    if "numpy.random" in sys.modules:
        sys.modules["numpy.random"].seed()
    faulthandler.enable()
    # Print the place of uninterruptible compiled code just before the worker ends the run.
    faulthandler.dump_traceback_later(task.wall + 0.9 * spare_time(task.wall))
    # Ctrl-C goes to the whole foreground group; the worker decides what happens to runs.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # With all cores full of runs a request to the daemon takes 15.6 ms at nice 0, 4.0 at 10, 0.26
    # at 19 (99th percentile). Never below the worker's own niceness.
    os.setpriority(os.PRIO_PROCESS, 0, max(task.nice, os.getpriority(os.PRIO_PROCESS, 0)))
    with suppress(OSError):  # some systems have no such file
        Path("/proc/self/oom_score_adj").write_text(_OOM_SCORE)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # gigabytes for each crash of a stack
    if task.memory:
        # Limit the address space, the only memory that rlimits bound. numba and numpy reserve much
        # more than they touch, so the default is generous. Only the soft limit: a ROS 2 stack
        # reserves more, and its supervisor lifts the limit for it.
        _, hard_limit = resource.getrlimit(resource.RLIMIT_AS)
        memory = (
            task.memory if hard_limit == resource.RLIM_INFINITY else min(task.memory, hard_limit)
        )
        resource.setrlimit(resource.RLIMIT_AS, (memory, hard_limit))


class SnapshotSender:
    """Sends snapshots and judgements to the worker without ever waiting for it.

    Five a second, or ten detailed ones while the worker reports a watcher of this run. Messages
    that the socket does not take are dropped.
    """

    def __init__(self, run: str, wire: socket.socket) -> None:
        self._run = run
        self._wire = wire
        self._requested: frozenset[str] = frozenset()
        self._next = 0.0

    def interest(self) -> Literal["nothing", "progress", "everything"]:
        """Return the detail of a due snapshot; between two of them it only reads the clock."""
        now = time.monotonic()
        if now < self._next:
            return "nothing"
        with suppress(OSError):  # BlockingIOError: no more messages
            while message := self._wire.recv(LARGEST_MESSAGE, socket.MSG_DONTWAIT):
                self._requested = frozenset(message[1:].decode().split())
        is_watched = WatchDetail.DETAILS in self._requested
        self._next = now + (_WATCHED_PERIOD if is_watched else _LIVE_PERIOD)
        return "everything" if is_watched else "progress"

    def scope(self) -> Literal["nothing", "margin", "everything"]:
        """Return the requested part of a judgement, as of the last due snapshot."""
        if WatchDetail.JUDGEMENT in self._requested:
            return "everything"
        return "margin" if WatchDetail.MARGIN in self._requested else "nothing"

    def tell(self, judgement: LiveJudgement) -> None:
        """Send a judgement."""
        self._send(JUDGEMENT + pack_judgement(replace(judgement, run=self._run)))

    def __call__(self, snapshot: Snapshot) -> None:
        """Send a snapshot."""
        self._send(LIVE + codec.to_json(LiveSnapshot(self._run, snapshot)))

    def _send(self, message: bytes) -> None:
        # Telemetry: drop it if the worker is slow or gone, or the message too long.
        with suppress(OSError):
            self._wire.send(message, socket.MSG_DONTWAIT)
