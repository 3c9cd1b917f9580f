"""What lock step with a genuine ROS 2 stack costs, how many get ready, and how soon one that fails
is told.

A run in the demo's flat by the stand-in of the tests (rclpy, all nodes in one process), twice for
each ROS 2 environment that ``make test-ros2`` has made: time to come up, latency of the answers
as the trace has them, cycles that were late, simulated time per wall time, and whether both runs
were given the same commands; the pilot in the same run is the reference. Then the stand-in is
started twenty times, three at a time, and fails in each way that ``tests/ros2/test_runs.py`` knows:
the seconds from the fault to the end of the run, as the stack prints both, and the error. A
failure without a moment of its own, such as a stack that is too slow, has no line.
"""

import re
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from daemon.campaign import expand, load_campaign
from daemon.model.spec import SutReference
from daemon.run import execute
from daemon.trace import read_trace
from grammars.model.mission import Waypoint
from tests.benchmarks.measurement import Measurement, Reference, at_least, at_most
from tests.kernels import load_all
from tests.parts import ROOT
from tests.ros2.environment import DISTRIBUTIONS, environment_python
from tests.ros2.test_runs import FAILURES, ROUND, recorded, specified

LONG = "needs the environments that make test-ros2 makes"
ERRAND = (*ROUND, Waypoint("hall", 0.0, 0.0), *ROUND)
"""Without a wall in between: the stand-in drives straight."""
LIMIT = 120.0
STARTS, AT_ONCE = 20, 3
TOLD_LATE = {
    "controller hangs", "action server vanishes", "stack cannot keep up", "late response",
    "wrong frame",
}  # fmt: skip
"""Failures that show only after a patience."""
_FAULT = re.compile(r"\[(?:WARN|ERROR)\] \[(\d+\.\d+)\]")
_END = re.compile(r"interrupted at (\d+\.\d+)")
_READY = re.compile(r"ready after ([\d.]+) s")


def measure():
    """Yield runs, starts, then a line for each failure."""
    load_all()
    demo = expand(load_campaign(ROOT / "campaigns" / "demo" / "campaign.yaml"))
    pilot = SutReference("pilot", "pilot", {})
    spec = specified(demo, Path("python3"), ERRAND, LIMIT, {})
    alone, _ = executed("pilot", replace(spec, sut=pilot), demo)
    yield alone
    found = {name: environment_python(name) for name in DISTRIBUTIONS}
    for name, python in found.items():
        if python is None:
            print(f"{name}: no environment, make test-ros2 makes it")
        else:
            yield from twice(name, python, demo, Reference("the pilot", alone.value))
    if python is not None:
        yield started(demo, python)
        for failure in FAILURES:
            yield from failed(demo, python, failure)


def twice(name, python, demo, beside):
    spec = specified(demo, python, ERRAND, LIMIT, {"patience": "1 s"})
    (first, one), (second, other) = (executed(name, spec, demo) for _ in range(2))
    same = all(
        getattr(one.command, part).tobytes() == getattr(other.command, part).tobytes()
        for part in ("time", "vx", "vy", "wz")
    )
    given = f"both were given {'the same' if same else 'different'} commands"
    yield replace(first, reference=beside)
    yield replace(second, reference=beside, note=f"{second.note}; {given}")


def executed(name, spec, demo):
    """Run it once, return what it took and its trace."""
    began = time.perf_counter()
    up = began

    def hear(snapshot):
        nonlocal up
        if snapshot.waiting:
            up = time.perf_counter()

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trace.mcap"
        result = execute(spec, demo.scenes[0], trace_path=path, on_progress=hear)
        trace = read_trace(path)
    took = time.perf_counter() - up
    seconds = trace.latency.seconds
    late = sum("the last one holds" in event.text for event in trace.events)
    note = f"up after {up - began:.1f} s, {len(seconds)} cycles, {late} late"
    if len(seconds):
        median, most = (1e3 * np.percentile(seconds, share) for share in (50, 95))
        note += f", answers after {median:.2f} ms, 95 % {most:.2f} ms"
    if result.ended != "finished":
        note += f"; {result.note.partition(chr(10))[0]}"
    return Measurement(name, result.timing.simulated / took, "x real time", None, (), note), trace


def stand_in(demo, python, options="", **more):
    """Run the stand-in once."""
    with tempfile.TemporaryDirectory() as folder:
        return recorded(demo, python, Path(folder), options, **more)


def started(demo, python):
    """Start stacks side by side; return how many got ready."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        asked = [pool.submit(stand_in, demo, python) for _ in range(STARTS)]
        runs = [each.result() for each in asked]
    seconds = [float(found[1]) for run in runs if (found := _READY.search(run.said))]
    note = ", ".join(f"{np.percentile(seconds, share):.1f}" for share in (0, 50, 100))
    return Measurement(
        f"starts that got ready, {AT_ONCE} at a time", len(seconds), f"of {STARTS}", None,
        (at_least(STARTS),), f"after {note} s (least, median, most)",
    )  # fmt: skip


def failed(demo, python, name):
    options, settings, _ = FAILURES[name]
    run = stand_in(demo, python, options, launcher="launched" in name, **settings)
    end = _END.search(run.output)
    fault = _FAULT.search(run.output, 0, end.start()) if end else None
    if end and fault:
        goals = () if name in TOLD_LATE else (at_most(1.0),)
        error = run.result.note.partition("\n")[0]
        yield Measurement(name, float(end[1]) - float(fault[1]), "s", None, goals, error)
