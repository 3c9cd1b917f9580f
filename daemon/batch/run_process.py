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
import select
import signal
import sys
import time
import traceback
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final, Literal, NoReturn

from daemon.batch.freed_memory import return_freed_memory
from daemon.model.attachments import FILES_VARIABLE, SutMissing
from daemon.model.deadline import spare_time, wall_clock_limit
from daemon.model.live_judgement import LARGEST_JUDGEMENT, LiveJudgement, pack_judgement
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
WATCHED: Final = "watched"
"""Lies in the folder of an attempt while somebody watches; what is wanted stands in it."""
JUDGED_FILE: Final = "judged.json.z"
"""Holds what the run is judged by now, a packed ``LiveJudgement``, while that is wanted."""


class Wanted(StrEnum):
    """What is wanted of a run beside how far it is, a word each.

    ``MARGIN`` by those who watch all runs, the least so far; ``DETAILS`` and ``JUDGEMENT`` by those
    who watch this one.
    """

    MARGIN = "margin"
    DETAILS = "details"
    JUDGEMENT = "judgement"


# The first byte of what a run's process tells its worker.
LIVE: Final = b"L"
JUDGEMENT: Final = b"J"
"""There is another judgement: it does not fit through the pipe, so it is in a file."""
FAILED: Final = b"F"
DISK_FULL: Final = b"N"
SUT_MISSING: Final = b"K"
"""The system under test is not installed here: nothing the run could help."""
FAILURES: Final = (FAILED, DISK_FULL, SUT_MISSING)
READY: Final = b"R"

_DISK_ERRORS: Final = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.ESTALE)
"""What a disk says that takes no trace just now: full, only to be read, failing, gone."""
# Seconds between two snapshots: five a second are enough for a list, ten for a picture that moves.
_LIVE_PERIOD: Final = 0.2
_WATCHED_PERIOD: Final = 0.1
_LENGTH_BYTES: Final = 8
"""So many bytes multiprocessing puts before a message, at most."""
_LONGEST_WORDS: Final = 16_000
"""Characters of the reason why there is no result: an exception may have megabytes of them."""
_OOM_SCORE: Final = "500"
"""Half of the way to certain death (proc(5)): a run goes before the worker that can start it again,
and before what people work with beside it."""


@dataclass(frozen=True, slots=True)
class RunTask:
    """What a child is told: its attempt's folder, the scene's file, memory limit [B] or 0,
    how far it steps back behind other processes, and its wall clock limit [s].
    """

    folder: Path
    scene: Path
    memory: int
    nice: int
    wall: float


def read_output(folder: Path) -> bytes:
    """Return what an attempt has printed, its first and last part if that is more than a MiB."""
    return OutputFile.read(folder / OUTPUT)


def read_judged(folder: Path) -> bytes:
    """Return what an attempt was last judged by, packed; nothing if that is too long to be it.

    Raises ``OSError`` when there is none.
    """
    with (folder / JUDGED_FILE).open("rb") as file:
        data = file.read(LARGEST_JUDGEMENT + 1)
    return data if len(data) <= LARGEST_JUDGEMENT else b""


def report_readiness(wire: Connection) -> None:
    """Report whether runs can be executed at all: nothing, or what is wrong."""
    from daemon.batch import forkserver_preload

    wire.send_bytes(
        FAILED + forkserver_preload.problem.encode() if forkserver_preload.problem else READY
    )


def run_attempt(task: RunTask, wire: Connection) -> None:
    """Execute one run; exits with 0 when there is a result."""
    # The fork server has loaded it, at a moment it chooses itself: nobody else may.
    from daemon.batch import forkserver_preload

    try:
        # Before anything else: what goes wrong from here on, in C++ too, is to be read there.
        guard(task.folder / OUTPUT, niceness=task.nice)
    except OSError as error:
        wire.send_bytes(DISK_FULL + f"there is no room for a process: {error}".encode())
        _exit(1)
    _prepare_process(task)
    try:
        if forkserver_preload.execute is None:
            raise ImportError(forkserver_preload.problem)
        lease = codec.from_json(Lease, (task.folder / LEASE).read_bytes())
        scene = codec.from_json(Scene, task.scene.read_bytes())
        trace = task.folder / TRACE
        reporter = SnapshotSender(lease.run, wire, task.folder)
        # Only where they are asked for: executors that plug in need not know of them.
        asked: dict[str, object] = {"leads": True} if lease.leads else {}
        if "judgements" in inspect.signature(forkserver_preload.execute).parameters:
            asked["judgements"] = reporter
        with wall_clock_limit(task.wall):
            result: RunResult = forkserver_preload.execute(
                lease.spec,
                scene,
                trace_path=trace,
                on_progress=reporter,
                interest=reporter.interest,
                **asked,
            )
        _write_result(result, trace, task.folder)
    except SutMissing as error:
        wire.send_bytes(SUT_MISSING + str(error)[:_LONGEST_WORDS].encode("utf-8", "replace"))
        _exit(1)
    except Exception as error:
        # No verdict comes of this: the worker gives the run back with these words.
        no_room = isinstance(error, OSError) and error.errno in _DISK_ERRORS
        words = traceback.format_exc()[-_LONGEST_WORDS:]
        wire.send_bytes((DISK_FULL if no_room else FAILED) + words.encode("utf-8", "replace"))
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
    return_freed_memory()
    if (task.folder / FILES).exists():
        os.environ[FILES_VARIABLE] = str(task.folder / FILES)
    # Python seeds its own generator anew in a child. numpy does not: all runs of a fork server draw
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
    """Sends snapshots to the worker and never waits for it.

    A few a second, twice as many and with all there is to see while the worker says, by a file in
    the attempt's ``folder``, that somebody watches this run; and what it is judged by now, in
    another file there.
    """

    def __init__(self, run: str, wire: Connection, folder: Path) -> None:
        self._run = run
        self._wire = wire
        self._folder = folder
        self._wanted: frozenset[str] = frozenset()
        self._next = 0.0

    def interest(self) -> Literal["nothing", "progress", "everything"]:
        """Say whether a snapshot is due; asked often, it mostly costs a look at the clock."""
        now = time.monotonic()
        if now < self._next:
            return "nothing"
        try:
            self._wanted = frozenset((self._folder / WATCHED).read_text("ascii").split())
        except (OSError, ValueError):
            self._wanted = frozenset()
        watched = Wanted.DETAILS in self._wanted
        self._next = now + (_WATCHED_PERIOD if watched else _LIVE_PERIOD)
        return "everything" if watched else "progress"

    def wanted(self) -> Literal["nothing", "margin", "everything"]:
        """Say how much of a judgement is wanted, as it was when a snapshot last was due."""
        if Wanted.JUDGEMENT in self._wanted:
            return "everything"
        return "margin" if Wanted.MARGIN in self._wanted else "nothing"

    def tell(self, judgement: LiveJudgement) -> None:
        """Put a judgement where the worker finds it, and tell it so."""
        data = pack_judgement(replace(judgement, run=self._run))
        # No room for it, which others will say: then it is not told.
        with suppress(OSError):
            write_atomically(self._folder / JUDGED_FILE, data, durable=False)
            self._send(JUDGEMENT)

    def __call__(self, snapshot: Snapshot) -> None:
        """Send a snapshot, without what makes it too long for the pipe, or not at all."""
        bare = replace(snapshot, returns=(), plan=(), contacts=())
        pictures = [snapshot, bare]
        if snapshot.waiting:
            # Before time begins every joint is as drawn: hundreds of them say nothing.
            pictures.append(replace(bare, joints=()))
        for picture in pictures:
            message = LIVE + codec.to_json(LiveSnapshot(self._run, picture))
            if len(message) + _LENGTH_BYTES <= select.PIPE_BUF:
                self._send(message)
                return

    def _send(self, message: bytes) -> None:
        # A pipe that is ready takes PIPE_BUF bytes at once, so this never blocks the run.
        if select.select([], [self._wire], [], 0)[1]:
            self._wire.send_bytes(message)
