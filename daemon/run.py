"""The one road of a run: specification and scene in, trace and verdicts out.

Every run, wherever it happens, is :func:`execute`; what happens while simulated time advances is
:mod:`daemon.run_loop`. Nothing here looks at a clock except to report what a run cost.
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
from daemon.model.rehearsal import kernel_list, short_run
from daemon.model.spec import (
    LeadingMargin,
    RunResult,
    RunSpec,
    Script,
    Snapshot,
    Timing,
    package_versions,
)
from daemon.model.sut import TICK_RATE
from daemon.run_judge import JudgementReceiver, WatchedRun
from daemon.run_loop import Interest, ProgressCallback, RunLoop
from daemon.trace import TraceWriter, read_trace
from grammars.model.scene import Scene
from grammars.text import codec


class SceneMismatchError(ValueError):
    """The scene at hand is not the one the specification names."""


def warm_up() -> None:
    """Make what every run needs, so that forked children need not."""
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

    Same specification, same bytes: nothing but ``timing`` in the result depends on the machine's
    speed. A system under test that raises ends the run as ``crashed``; that is an error verdict,
    never a failure of the robot. ``on_progress`` is called once a simulated second, with
    ``interest`` up to ten times, as often as that wants it; ``judgements`` is told what the run
    would be judged by now, while it wants that. None of them has any influence on the run.
    With ``leads`` the result has leading margins as well; verdicts and trace are the same.

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
        # Its maps, and what a stack makes of them, take 55 MB in the published building: they go
        # before the trace is read and judged, which takes memory of its own. A world refers to
        # itself, so only a collection frees it: 0.4 ms where all that is older than the run is
        # frozen (``gc.freeze``), 200 ms elsewhere.
        del loop, watched, on_progress
        gc.collect()
        for name, data in outputs.items():
            trace.attach(name, data)
        # Judged is the file, not what is still in memory: the verdicts of a run are then the very
        # ones that anybody gets who judges its trace again, on another machine and years later.
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
            # Where a judge failed: the recording is worth as much as ever.
            trace.publish()
            raise
        trace.add_verdicts(codec.to_json({"outcome": outcome, "verdicts": verdicts}))
        info = trace.publish()
    timing = Timing(time.perf_counter() - wall, time.process_time() - cpu, simulated, started)
    found = (spec.digest, outcome, verdicts, end.ended, info, timing, end.note, margins)
    return RunResult(*found, machine_text(), end.stopped)


def prepare(spec: RunSpec, scene: Scene) -> None:
    """Do what runs like ``spec`` in ``scene`` begin with, for processes forked from this one.

    They find the map, what systems under test derive from it and the outline of the building made:
    0.3 CPU s of each run of the published campaign, the shortest of which takes one. Raises as
    :func:`execute` does.
    """
    # A run of one tick, since whatever keeps something does so in a run. Without its oracles: of
    # these may be some that plug in.
    first = replace(spec, limit=1.0 / TICK_RATE, oracles=())
    with tempfile.TemporaryDirectory(prefix="scenario-prepared-") as folder:
        execute(first, scene, trace_path=Path(folder, "trace.mcap"))


def load_kernels(spec: RunSpec, scene: Scene) -> None:
    """Load what runs like ``spec`` call; a short run compiles what the disk lacks."""
    if not load_list(kernel_list(spec)):
        rehearse(spec, scene, lambda: None, lambda: None)


def rehearse(
    spec: RunSpec, scene: Scene, tell: Callable[[], object], on_driven: Callable[[], object]
) -> None:
    """Compile and list the kernels that runs like ``spec`` call, in the order of need.

    ``tell`` is called after each of them, ``on_driven`` when only those that judge are missing.
    Raises as :func:`execute` does. For a process without threads.
    """
    name, short = kernel_list(spec), short_run(spec)

    def look(snapshot: Snapshot) -> None:
        if snapshot.time >= short.limit - 0.5:
            keep_list(name, called())
            on_driven()

    with (
        compiling_ahead(tell) as called,
        tempfile.TemporaryDirectory(prefix="scenario-rehearsed-") as folder,
    ):
        execute(short, scene, trace_path=Path(folder, "trace.mcap"), on_progress=look)
        keep_list(name, called())
