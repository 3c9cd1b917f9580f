"""What lock step with a genuine ROS 2 stack costs: wall time per cycle, and per simulated second.

A run in the demo's flat by the stand-in of the tests (rclpy, all nodes in one process), twice for
each ROS 2 environment that ``make test-ros2`` has made: time to come up, latency of the answers
as the trace has them, cycles that were late, simulated time per wall time with a goal under way,
and whether both runs were given the same commands. Beside it the pilot in the same run.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from daemon.campaign import expand, load_campaign
from daemon.model.spec import RunSpec, Snapshot, SutReference
from daemon.model.status import Submission
from daemon.run import execute, warm_up
from daemon.trace import Trace, read_trace
from grammars.model.mission import Waypoint
from tests.ros2.environment import DISTRIBUTIONS, environment_python
from tests.ros2.test_runs import specified

CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "demo" / "campaign.yaml"
ERRAND = (
    Waypoint("kitchen", 0.2, -2.1),
    Waypoint("living-room", 0.6, 2.6),
    Waypoint("hall", 0.0, 0.0),
)
LIMIT = 120.0


def main() -> None:
    """Print a line for every run."""
    warm_up()
    demo = expand(load_campaign(CAMPAIGN))
    print("system          up s   cycles  late  median ms   95 % ms   x real time  commands")
    pilot = replace(
        specified(demo, Path("python3"), "", ERRAND, LIMIT, {}),
        sut=SutReference("pilot", "pilot", {}),
    )
    measure("pilot", pilot, demo)
    for distribution in DISTRIBUTIONS:
        python = environment_python(distribution)
        if python is None:
            print(f"{distribution}: no environment, make test-ros2 makes it")
            continue
        spec = specified(demo, python, "", ERRAND, LIMIT, {"patience": "1 s"})
        first, second = (measure(distribution, spec, demo) for _ in range(2))
        same = all(
            getattr(first.command, name).tobytes() == getattr(second.command, name).tobytes()
            for name in ("time", "vx", "vy", "wz")
        )
        print(f"{'':14}  both were given {'the same' if same else 'different'} commands")


def measure(name: str, spec: RunSpec, demo: Submission) -> Trace:
    """Run it once, print what it took, return its trace."""
    began = time.perf_counter()
    up = began

    def hear(snapshot: Snapshot) -> None:
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
    median, most = (
        (f"{1e3 * np.percentile(seconds, share):9.2f}" if len(seconds) else f"{'-':>9}")
        for share in (50, 95)
    )
    print(
        f"{name:14} {up - began:5.1f} {len(seconds):8} {late:5} {median:>10} {most:>9} "
        f"{result.timing.simulated / took:13.1f}  {len(trace.command.time)}"
        f"{'' if result.ended == 'finished' else '  ' + result.note.partition(chr(10))[0]}",
        flush=True,
    )
    return trace
