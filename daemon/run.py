"""The one road of a run: specification and scene in, trace and verdicts out.

Every run, on any machine, is one call of :func:`execute`; :mod:`daemon.run_loop` advances simulated
time. The clock is read only to report the cost of a run.
"""

from __future__ import annotations

import gc
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from daemon.judging import oracles
from daemon.judging.oracles import judge, judge_leading, overall_outcome
from daemon.model.execution import machine_text
from daemon.model.kernels import compiling_ahead, keep_list, load_list
from daemon.model.spec import (
    LeadingMargin,
    RunResult,
    RunSpec,
    Script,
    Snapshot,
    Timing,
    kernel_list,
    package_versions,
    short_run,
)
from daemon.model.sut import TICK_RATE
from daemon.run_judge import JudgementReceiver, WatchedRun
from daemon.run_loop import Interest, ProgressCallback, RunLoop
from daemon.trace import TraceWriter, read_trace
from grammars.model.scene import Scene
from grammars.text import codec


class SceneMismatchError(ValueError):
    """The scene differs from the one that the specification names."""


def warm_up() -> None:
    """Prepare what every run needs, once for all forked children."""
    oracles.warm_up()
    codec.warm_up(RunSpec, Script, Scene, RunResult)
    package_versions()


def execute(
    spec: RunSpec,
    scene: Scene,
    *,
    trace_path: Path,
    on_progress: ProgressCallback | None = None,
    interest: Interest | None = None,
    leads: bool = False,
    judgements: JudgementReceiver | None = None,
) -> RunResult:
    """Run ``spec`` in ``scene``, write the trace to ``trace_path``, judge it.

    Same specification, same bytes: only ``timing`` in the result depends on the machine's speed.
    A system under test that raises ends the run as ``crashed``: an error verdict, never a failure
    of the robot. ``on_progress`` is called once a simulated second, or up to ten times as
    ``interest`` decides. ``judgements`` receives the verdicts so far while it asks for them. None
    of these influences the run. With ``leads`` the result also has leading margins; verdicts and
    trace stay the same.

    Raises :class:`SceneMismatchError` when ``scene`` is not the specified one.
    """
    if scene.digest != spec.scene:
        raise SceneMismatchError(f"scene {scene.digest[:12]} given, {spec.scene[:12]} specified")
    started, wall, cpu = time.time(), time.perf_counter(), time.process_time()
    with TraceWriter(trace_path, spec, scene, versions=package_versions()) as trace:
        watched = None
        if on_progress is not None and judgements is not None:
            on_progress = watched = WatchedRun(trace, on_progress, judgements)
        loop = RunLoop(spec, scene, trace, on_progress, interest)
        try:
            end = loop.run()
        finally:
            outputs = loop.close()
        if watched is not None:
            watched.finish(end.ended, end.note)
        simulated = loop.world.time
        # Free the maps of the world and the stack (55 MB in the published building) before
        # judging, which needs memory too. A world refers to itself, so only a collection frees it:
        # 0.4 ms with older objects frozen (``gc.freeze``), 200 ms otherwise.
        del loop, watched, on_progress
        gc.collect()
        for name, data in outputs.items():
            trace.attach(name, data)
        # Judge the file, not what is still in memory: judging the trace again, on another machine
        # and years later, then gives the same verdicts.
        recording = trace.finish(end.ended, end.note)
        try:
            recorded = read_trace(recording)
            margins: tuple[LeadingMargin, ...] = ()
            if leads:
                verdicts, margins = judge_leading(recorded, spec.oracles)
            else:
                verdicts = judge(recorded, spec.oracles)
            outcome = overall_outcome(recorded, verdicts)
        except BaseException:
            # The recording keeps its worth when a judge fails.
            trace.publish()
            raise
        trace.add_verdicts(codec.to_json({"outcome": outcome, "verdicts": verdicts}))
        info = trace.publish()
    timing = Timing(time.perf_counter() - wall, time.process_time() - cpu, simulated, started)
    result = (spec.digest, outcome, verdicts, end.ended, info, timing, end.note, margins)
    return RunResult(*result, machine_text(), end.stopped)


def prepare(spec: RunSpec, scene: Scene) -> None:
    """Fill the caches of runs like ``spec`` in ``scene``, for processes forked from this one.

    They inherit the map, the data that systems under test derive from it, and the outline of the
    building. This saves 0.3 CPU s of each run of the published campaign, the shortest of which
    takes 1 s. Raises as :func:`execute` does.
    """
    # A run of one tick fills every cache. It has no oracles, since some may be plug-ins.
    first = replace(spec, limit=1.0 / TICK_RATE, oracles=())
    with tempfile.TemporaryDirectory(prefix="scenario-prepared-") as folder:
        execute(first, scene, trace_path=Path(folder, "trace.mcap"))


def load_kernels(spec: RunSpec, scene: Scene) -> None:
    """Load the kernels of runs like ``spec``; a short run compiles those that the disk lacks."""
    if not load_list(kernel_list(spec)):
        rehearse(spec, scene, lambda: None, lambda: None)


def rehearse(
    spec: RunSpec, scene: Scene, on_kernel: Callable[[], object], on_driven: Callable[[], object]
) -> None:
    """Compile and list the kernels that runs like ``spec`` call, in the order of need.

    ``on_kernel`` is called after each of them, ``on_driven`` when only the kernels of the judge
    are missing. Raises as :func:`execute` does. For a process without threads.
    """
    name, short = kernel_list(spec), short_run(spec)

    def look(snapshot: Snapshot) -> None:
        if snapshot.time >= short.limit - 0.5:
            keep_list(name, called())
            on_driven()

    with (
        compiling_ahead(on_kernel) as called,
        tempfile.TemporaryDirectory(prefix="scenario-rehearsed-") as folder,
    ):
        execute(short, scene, trace_path=Path(folder, "trace.mcap"), on_progress=look)
        keep_list(name, called())
