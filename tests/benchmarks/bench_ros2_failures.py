"""Starts and failures of a ROS 2 stack: how many get ready, and how soon a failure is told.

The stand-in of the tests is started twenty times, three at a time. Then it fails in each way that
``tests/ros2/test_runs.py`` knows: the seconds from the fault to the end of the run, as the stack
prints both, and the error. A failure without a moment of its own, such as a stack that is too slow,
has no line.
"""

import re
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from daemon.campaign import expand, load_campaign
from tests.benchmarks.bench_ros2 import CAMPAIGN
from tests.benchmarks.measurement import Measurement, at_least, at_most
from tests.kernels import load_all
from tests.ros2.environment import DISTRIBUTIONS, environment_python
from tests.ros2.test_runs import FAILURES, recorded

LONG = "needs the environments that make test-ros2 makes"
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
    """Yield the starts, then a line for each failure."""
    load_all()
    demo = expand(load_campaign(CAMPAIGN))
    python = environment_python(DISTRIBUTIONS[-1])
    if python is None:
        print(f"{DISTRIBUTIONS[-1]}: no environment, make test-ros2 makes it")
        return
    yield started(demo, python)
    for name, (options, settings, _) in FAILURES.items():
        run = executed(demo, python, options, launcher="launched" in name, **settings)
        end = _END.search(run.output)
        fault = _FAULT.search(run.output, 0, end.start()) if end else None
        if end and fault:
            seconds = float(end[1]) - float(fault[1])
            goals = () if name in TOLD_LATE else (at_most(1.0),)
            error = run.result.note.partition("\n")[0]
            yield Measurement(name, seconds, "s", None, goals, error)


def executed(demo, python, options="", **more):
    """Run the stand-in once."""
    with tempfile.TemporaryDirectory() as folder:
        return recorded(demo, python, Path(folder), options, **more)


def started(demo, python):
    """Start stacks side by side; return how many got ready."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        asked = [pool.submit(executed, demo, python) for _ in range(STARTS)]
        runs = [each.result() for each in asked]
    seconds = [float(found[1]) for run in runs if (found := _READY.search(run.said))]
    note = ", ".join(f"{np.percentile(seconds, share):.1f}" for share in (0, 50, 100))
    return Measurement(
        f"starts that got ready, {AT_ONCE} at a time",
        len(seconds),
        f"of {STARTS}",
        None,
        (at_least(STARTS),),
        f"after {note} s (least, median, most)",
    )
