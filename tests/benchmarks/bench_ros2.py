"""What lock step with a genuine ROS 2 stack costs: wall time per cycle, and per simulated second.

A run in the demo's flat by the stand-in of the tests (rclpy, all nodes in one process), twice for
each ROS 2 environment that ``make test-ros2`` has made: time to come up, latency of the answers
as the trace has them, cycles that were late, simulated time per wall time with a goal under way,
and whether both runs were given the same commands. Beside it the pilot in the same run.
"""

import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from daemon.campaign import expand, load_campaign
from daemon.model.spec import SutReference
from daemon.run import execute
from daemon.trace import read_trace
from grammars.model.mission import Waypoint
from tests.benchmarks.measurement import Measurement, Reference
from tests.kernels import load_all
from tests.ros2.environment import DISTRIBUTIONS, environment_python
from tests.ros2.test_runs import ROUND, specified

CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "demo" / "campaign.yaml"
LONG = "needs the environments that make test-ros2 makes"
ERRAND = (*ROUND, Waypoint("hall", 0.0, 0.0), *ROUND)
"""Without a wall in between: the stand-in drives straight."""
LIMIT = 120.0


def measure():
    """Yield a line for every run; the pilot in the same run is the reference."""
    load_all()
    demo = expand(load_campaign(CAMPAIGN))
    pilot = replace(
        specified(demo, Path("python3"), ERRAND, LIMIT, {}),
        sut=SutReference("pilot", "pilot", {}),
    )
    alone, _ = executed("pilot", pilot, demo)
    yield alone
    beside = Reference("the pilot", alone.value)
    for distribution in DISTRIBUTIONS:
        python = environment_python(distribution)
        if python is None:
            print(f"{distribution}: no environment, make test-ros2 makes it")
            continue
        spec = specified(demo, python, ERRAND, LIMIT, {"patience": "1 s"})
        (first, one), (second, other) = (executed(distribution, spec, demo) for _ in range(2))
        same = all(
            getattr(one.command, name).tobytes() == getattr(other.command, name).tobytes()
            for name in ("time", "vx", "vy", "wz")
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
