"""Local execution of runs in forked processes, for verification and the search for causes.

They are forked from this process instead of a worker's zygote: it has loaded everything, has no
session of Zenoh, and runs need not pass through files.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import wait
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from daemon.model.deadline import spare_time, stopped_after, wall_clock_limit
from daemon.model.execution import RunLimits
from daemon.model.spec import RunResult, RunSpec
from daemon.run import execute, load_kernels
from daemon.supervision.child import lower_session
from daemon.supervision.guardian import end_guarded, guard
from grammars.model.scene import Scene
from grammars.text import codec
from grammars.text.files import write_atomically

_NICENESS: Final = 10
_ENDED: Final = "ended.json"

ExecuteRun: TypeAlias = Callable[..., RunResult]
"""Executes a run as :func:`daemon.run.execute` does."""


@dataclass(frozen=True, slots=True)
class EndedRun:
    """Result of a run, or the ``problem`` that kept it from having one."""

    result: RunResult | None
    problem: str = ""


def trace_in(folder: Path, number: int) -> Path:
    """Return where run ``number`` of :func:`run_in_children` leaves its trace in ``folder``."""
    return folder / str(number) / "trace.mcap"


def run_in_children(
    runs: Sequence[tuple[RunSpec, Scene]],
    folder: Path,
    *,
    wall: float = 0.0,
    execute_run: ExecuteRun = execute,
) -> list[EndedRun]:
    """Execute runs at the same time, each in a forked process, and return how each ended.

    A run has ``wall`` seconds of wall clock, 0 for the usual limit. A run stopped by the clock has
    no result, since it ends differently every time. No process, nor any started by a run, survives
    an exception here, Ctrl-C included.
    """
    for spec, scene in runs:
        # The process of a run reports errors, such as a missing map, itself.
        with suppress(Exception):
            load_kernels(spec, scene)
    limits = [RunLimits(wall=wall).wall_of(spec.limit) for spec, _ in runs]
    traces = [trace_in(folder, number) for number in range(len(runs))]
    context = multiprocessing.get_context("fork")
    processes = [
        context.Process(target=_run, args=(*run, limit, trace, execute_run), daemon=True)
        for run, limit, trace in zip(runs, limits, traces, strict=True)
    ]
    longest = max(limits, default=0.0)
    end = time.monotonic() + longest + spare_time(longest)
    started, late = [], []
    try:
        for process in processes:
            process.start()
            started.append(process)
        waiting = {process.sentinel for process in processes}
        while waiting and (spare := end - time.monotonic()) > 0.0:
            waiting -= set(wait(list(waiting), spare))
        late = [process.sentinel in waiting for process in processes]
    finally:
        for process in started:
            end_guarded(process)
    ended = []
    for process, trace, limit, is_late in zip(processes, traces, limits, late, strict=True):
        file = trace.with_name(_ENDED)
        if file.is_file():
            ended.append(codec.from_json(EndedRun, file.read_bytes()))
        elif is_late:
            ended.append(EndedRun(None, stopped_after(limit)))
        else:
            ended.append(EndedRun(None, f"its process died with code {process.exitcode}"))
    return ended


def _run(spec: RunSpec, scene: Scene, limit: float, trace: Path, execute_run: ExecuteRun) -> None:
    """Execute a run in the child and write its ending beside its trace."""
    _prepare_child()
    trace.parent.mkdir(parents=True)
    try:
        with wall_clock_limit(limit):
            result = execute_run(spec, scene, trace_path=trace)
        ended = EndedRun(None, result.note) if result.stopped else EndedRun(result)
    except Exception as error:
        ended = EndedRun(None, f"{type(error).__name__}: {error}")
    write_atomically(trace.with_name(_ENDED), codec.to_json(ended))


def _prepare_child() -> None:
    """Prepare this child for one run: guarded, in the background, silent, newly seeded."""
    os.setsid()
    lower_session(_NICENESS)
    guard()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends it
    os.setpriority(os.PRIO_PROCESS, 0, max(_NICENESS, os.getpriority(os.PRIO_PROCESS, 0)))
    # Redirect descriptors too: processes of a system under test print to them.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(nowhere, descriptor)
    sys.stdout = sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123
    # Python seeds its own generator anew in a child. numpy does not: two children would draw the
    # same numbers from an unseeded generator, and look deterministic.
    np.random.seed()
    # A run collects garbage at its end: skip everything that the parent has loaded.
    gc.freeze()
