"""The process of one run: fresh, niced, limited, and gone with its worker.

It reads ``grant.json`` and the scene, executes the run, and leaves ``trace.mcap`` and, last,
``result.json`` in its attempt's folder: where there is a result, the trace is complete. What it
prints, and where it was when it crashed, goes to ``output.txt``; a guardian above it
(:mod:`daemon.supervision.guardian`) ends with it whatever it has started.
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
"""Leads to the files of systems under test, where one needs any."""


class Wanted(StrEnum):
    """What is wanted of a run beside how far it is, a word each.

    ``MARGIN`` by those who watch all runs, the least so far; ``DETAILS`` and ``JUDGEMENT`` by those
    who watch this one.
    """

    MARGIN = "margin"
    DETAILS = "details"
    JUDGEMENT = "judgement"


# Messages are whole or not there: each has a kind, its first byte. From the worker to a zygote:
PREPARE: Final = b"P"
"""A :class:`KernelTask` in JSON; a file with the specification of a run comes with it."""
RUN: Final = b"R"
"""A :class:`RunTask` in JSON; the socket of the run comes with it."""
# From a zygote to the worker:
COMPILED: Final = b"P"
"""How many kernels were compiled since the last such message."""
READY: Final = b"R"
"""The name of a list of kernels that are loaded; empty when the zygote itself is there."""
# From the process of a run, or the zygote for it, to the worker:
STARTED: Final = b"S"
LIVE: Final = b"L"
JUDGEMENT: Final = b"J"
FAILED: Final = b"F"
DISK_FULL: Final = b"N"
SUT_MISSING: Final = b"K"
"""The system under test is not installed here: nothing the run could help."""
FAILURES: Final = (FAILED, DISK_FULL, SUT_MISSING)
ENDED: Final = b"E"
"""Nothing of the run is left; the code with which its guardian has ended."""
# From the worker to the process of a run:
WATCH: Final = b"W"
"""Words for what is :class:`Wanted` of it."""
LARGEST_MESSAGE: Final = 2**19
"""Bytes; sockets take less."""

_DISK_ERRORS: Final = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.ESTALE)
"""What a disk says that takes no trace just now: full, only to be read, failing, gone."""
# Seconds between two snapshots: five a second are enough for a list, ten for a picture that moves.
_LIVE_PERIOD: Final = 0.2
_WATCHED_PERIOD: Final = 0.1
LONGEST_WORDS: Final = 16_000
"""Characters of the reason why there is no result: an exception may have megabytes of them."""
_OOM_SCORE: Final = "500"
"""Half of the way to certain death (proc(5)): a run goes before the worker that can start it again,
and before what people work with beside it."""


@dataclass(frozen=True, slots=True)
class RunTask:
    """The order to execute a run.

    It has the attempt's folder, the scene's file, the memory limit [B] or 0, how far the run steps
    back behind other processes, and its wall clock limit [s]. Runs of the same ``likeness`` begin
    alike; it is empty where that is not known.
    """

    folder: Path
    scene: Path
    memory: int
    nice: int
    wall: float
    likeness: str = ""


@dataclass(frozen=True, slots=True)
class KernelTask:
    """The order to load the kernels in the list ``name``, and to compile those that are missing.

    A run in the scene of this file calls them; ``nice`` as in :class:`RunTask`.
    """

    name: str
    scene: Path
    nice: int


def read_output(folder: Path) -> bytes:
    """Return what an attempt has printed, its first and last part if that is more than a MiB."""
    return OutputFile.read(folder / OUTPUT)


def run_attempt(task: RunTask, wire: socket.socket, execute: Callable[..., RunResult]) -> NoReturn:
    """Execute one run; exits with 0 when there is a result."""
    try:
        # Before anything else: what goes wrong from here on, in C++ too, is to be read there.
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
        # Only where they are asked for: executors that plug in need not know of them.
        asked: dict[str, object] = {"leads": True} if lease.leads else {}
        if "judgements" in inspect.signature(execute).parameters:
            asked["judgements"] = reporter
        with wall_clock_limit(task.wall):
            result = execute(
                lease.spec,
                scene,
                trace_path=trace,
                on_progress=reporter,
                interest=reporter.interest,
                **asked,
            )
        _write_result(result, trace, task.folder)
    except SutMissing as error:
        wire.send(SUT_MISSING + str(error)[:LONGEST_WORDS].encode("utf-8", "replace"))
        _exit(1)
    except BaseException as error:
        # No verdict comes of this, nor of a plug-in that would exit: the worker gives the run back
        # with these words.
        no_room = isinstance(error, OSError) and error.errno in _DISK_ERRORS
        words = traceback.format_exc()[-LONGEST_WORDS:]
        wire.send((DISK_FULL if no_room else FAILED) + words.encode("utf-8", "replace"))
        _exit(1)
    _exit(0)


def _exit(code: int) -> NoReturn:
    """End without waiting for whatever threads the system under test has left running."""
    # os._exit also skips the handlers of atexit, those of a system under test among them.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _write_result(result: RunResult, trace: Path, folder: Path) -> None:
    # The result is last and synchronised after the trace: where it is, all of the attempt is.
    if not trace.is_file():
        raise FileNotFoundError(f"the run left no trace at {trace.name}")
    bound = bound_result(result)
    if len(bound.verdicts) < len(result.verdicts):
        bound = replace(bound, outcome=Outcome.ERROR)  # nothing is left that would prove another
    data = codec.to_json(bound)
    codec.from_json(RunResult, data)  # raises for what JSON cannot carry, a NaN say
    # The trace is on the disk, its name may not be: the result must never be there without it,
    # since whoever finds a result after a power cut delivers both.
    sync_directory(folder)
    write_atomically(folder / RESULT, data)


def _prepare_process(task: RunTask) -> None:
    if (task.folder / FILES).exists():
        os.environ[FILES_VARIABLE] = str(task.folder / FILES)
    # Python seeds its own generator anew in a child. numpy does not: all runs of a zygote draw
    # the same numbers from a generator that nobody has seeded, and look deterministic.
    if "numpy.random" in sys.modules:
        sys.modules["numpy.random"].seed()
    faulthandler.enable()
    # Where it was, for compiled code that cannot be interrupted: just before its worker ends it.
    faulthandler.dump_traceback_later(task.wall + 0.9 * spare_time(task.wall))
    # Ctrl-C goes to the whole foreground group: what becomes of runs then, the worker decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # With all cores full of runs a question to the daemon takes 15.6 ms at nice 0, 4.0 at 10, 0.26
    # at 19 (99th percentile). Never before what the worker itself was given.
    os.setpriority(os.PRIO_PROCESS, 0, max(task.nice, os.getpriority(os.PRIO_PROCESS, 0)))
    with suppress(OSError):  # where there is such a thing: short of memory, a run goes first
        Path("/proc/self/oom_score_adj").write_text(_OOM_SCORE)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # gigabytes for each crash of a stack
    if task.memory:
        # Of address space, the only memory that rlimits bound: numba and numpy reserve much more
        # than they touch, so the default is generous. The soft limit alone: a ROS 2 stack that a
        # run starts reserves more, and its supervisor lifts it for that.
        _, most = resource.getrlimit(resource.RLIMIT_AS)
        memory = task.memory if most == resource.RLIM_INFINITY else min(task.memory, most)
        resource.setrlimit(resource.RLIMIT_AS, (memory, most))


class SnapshotSender:
    """Sends snapshots and judgements to the worker and never waits for it.

    A few a second, twice as many and with all there is to see while the worker says that somebody
    watches this run. What the socket does not take is left out.
    """

    def __init__(self, run: str, wire: socket.socket) -> None:
        self._run = run
        self._wire = wire
        self._wanted: frozenset[str] = frozenset()
        self._next = 0.0

    def interest(self) -> Literal["nothing", "progress", "everything"]:
        """Say whether a snapshot is due; asked often, it mostly costs a look at the clock."""
        now = time.monotonic()
        if now < self._next:
            return "nothing"
        with suppress(OSError):  # BlockingIOError: nothing more has come
            while message := self._wire.recv(LARGEST_MESSAGE, socket.MSG_DONTWAIT):
                self._wanted = frozenset(message[1:].decode().split())
        watched = Wanted.DETAILS in self._wanted
        self._next = now + (_WATCHED_PERIOD if watched else _LIVE_PERIOD)
        return "everything" if watched else "progress"

    def wanted(self) -> Literal["nothing", "margin", "everything"]:
        """Say how much of a judgement is wanted, as it was when a snapshot last was due."""
        if Wanted.JUDGEMENT in self._wanted:
            return "everything"
        return "margin" if Wanted.MARGIN in self._wanted else "nothing"

    def tell(self, judgement: LiveJudgement) -> None:
        """Send a judgement."""
        self._send(JUDGEMENT + pack_judgement(replace(judgement, run=self._run)))

    def __call__(self, snapshot: Snapshot) -> None:
        """Send a snapshot."""
        self._send(LIVE + codec.to_json(LiveSnapshot(self._run, snapshot)))

    def _send(self, message: bytes) -> None:
        # The worker is slow or gone, or the message too long: it is telemetry.
        with suppress(OSError):
            self._wire.send(message, socket.MSG_DONTWAIT)
