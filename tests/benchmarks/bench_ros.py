"""What the ROS stack costs: scenario S1 of the published experiment with a2s, a whole run.

Simulated seconds per CPU second, CPU seconds per component. A component's time is what passes
inside its calls from the stack; the stack's own is the rest of its updates; the rest of the run is
the simulator, the trace, reading it back and judging.
``python -m tests.benchmarks flame`` shows the same by function.
"""

import gc
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

from daemon.campaign import expand, load_campaign
from daemon.run import execute
from daemon.stacks.ros1.amcl.node import Amcl
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.dwa.controller import Dwa
from daemon.stacks.ros1.navfn.planner import Navfn
from daemon.stacks.ros1.stack import RosStack
from tests.benchmarks import progress
from tests.benchmarks.measurement import Measurement, Reference, at_least
from tests.kernels import load_all

CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "ortega2024" / "campaign.yaml"
SUT = "a2s"
TIMES = 2
METHODS = (
    ("navfn", Navfn, ("plan",)),
    ("dwa", Dwa, ("set_plan", "goal_reached", "command")),
    ("costmaps", Costmap, ("update", "clear_square")),
    ("amcl", Amcl, ("scan",)),
    ("stack, all", RosStack, ("start", "update")),
)


def case():
    """S1 of the published experiment."""
    submission = expand(load_campaign(CAMPAIGN))
    spec = next(run for run in submission.specs if run.scenario == "S1" and run.sut.name == SUT)
    scene = next(scene for scene in submission.scenes if scene.digest == spec.scene)
    return spec, scene


@contextmanager
def stopwatches():
    """Collect [CPU seconds, calls] of each component while the block runs."""
    spent = {}
    patches = []
    for title, owner, names in METHODS:
        spent[title] = [0.0, 0]
        for name in names:
            timed = _timed(getattr(owner, name), spent[title])
            patches.append(mock.patch.object(owner, name, timed))
    for patch in patches:
        patch.start()
    try:
        yield spent
    finally:
        for patch in patches:
            patch.stop()


def _timed(method, total):
    def wrapper(*arguments, **named):
        begun = time.process_time()
        try:
            return method(*arguments, **named)
        finally:
            total[0] += time.process_time() - begun
            total[1] += 1

    return wrapper


def measure():
    """Whole runs, then where the time of another one goes."""
    load_all()
    spec, scene = case()
    # As in the process that a worker forks for a run.
    gc.collect()
    gc.freeze()
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        for k in range(TIMES):
            progress.say(f"{k + 1} of {TIMES}")
            start = time.process_time()
            result = execute(spec, scene, trace_path=path)
            cpu = time.process_time() - start
            simulated = result.timing.simulated
            size = result.trace.size / 1000 / (simulated / 60)
            note = f"{cpu:.2f} CPU s for {simulated:.0f} s, {result.ended}, {result.outcome}"
            runs.append((simulated / cpu, f"{note}, trace {size:.0f} kB/min"))
        speed, note = max(runs)
        yield Measurement(f"S1, {SUT}", speed, "x real time", None, (at_least(130.0),), note)
        progress.say("with stopwatches")
        with stopwatches() as spent:
            start = time.process_time()
            execute(spec, scene, trace_path=path)
            whole = time.process_time() - start
    yield from components(spent, whole)


def components(spent, whole):
    """A line for each component, the whole run with its stopwatches being the reference."""
    everything = spent.pop("stack, all")
    rows = {title: (seconds, calls) for title, (seconds, calls) in spent.items()}
    rows["stack itself"] = (everything[0] - sum(v[0] for v in spent.values()), everything[1])
    rows["simulator, trace, oracles"] = (whole - everything[0], 1)
    for title, (seconds, calls) in rows.items():
        note = f"{calls:.0f} calls of {1e6 * seconds / calls:.1f} us" if calls > 1 else ""
        yield Measurement(f"  {title}", seconds, "CPU s", Reference("whole", whole), (), note)
