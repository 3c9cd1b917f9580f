"""The product's promise: simulated seconds per CPU second of whole runs, and where those of S1 go.

A corridor of 60 m with 20 hinged doors, a 500-ray laser, full trace, an idle system under test;
the same with doors that open and close; the corridor of building C (scenario S2 of the paper)
with the pilot driving; and S1 of the published experiment with a2s, the ROS stack. Tracing,
reading the trace back and judging are included.

A component's time is what passes inside its calls from the stack; the stack's own is the rest of
its updates; the rest of the run is the simulator, the trace and judging.
"""

import gc
import tempfile
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path
from unittest import mock

from daemon.model.spec import MapSettings, RunSpec, SutReference
from daemon.run import execute
from daemon.stacks.ros1.amcl.node import Amcl
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.dwa.controller import Dwa
from daemon.stacks.ros1.navfn.planner import Navfn
from daemon.stacks.ros1.stack import RosStack
from grammars.model.behaviour import KeyFrame, KeyFrames, Servo
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from tests.benchmarks import corridor, progress
from tests.benchmarks.case_process import run_of
from tests.benchmarks.measurement import Measurement, Reference, at_least
from tests.kernels import load_all
from tests.parts import ROOT

SECONDS = 300.0
TIMES = 3
AT_REST, MOVING, S1 = "corridor, doors at rest", "corridor, doors moving", "S1, a2s"
GOALS = {AT_REST: (at_least(1000.0),), MOVING: (at_least(750.0),), S1: (at_least(130.0),)}
PAPER = ROOT / "campaigns" / "ortega2024"
METHODS = (
    ("navfn", Navfn, ("plan",)),
    ("dwa", Dwa, ("set_plan", "goal_reached", "command")),
    ("costmaps", Costmap, ("update", "clear_square")),
    ("amcl", Amcl, ("scan",)),
    ("stack, all", RosStack, ("start", "update")),
)


def idle(scene, *, doors_move):
    """A run in which the robot stands still and every door may swing each 15 s."""
    behaviours = []
    if doors_move:
        for i, name in enumerate(scene.joint_names):
            times = range(5 + i % 7, int(SECONDS), 15)
            frames = tuple(KeyFrame(float(t), 1.5 * (k % 2)) for k, t in enumerate(times, 1))
            behaviours.append(KeyFrames(name, frames, Servo(1.0, 40.0)))
    mission = Mission("stand", Pose2(), (Waypoint("far", corridor.LENGTH - 2.0, 0.0),))
    return RunSpec(
        "bench", "corridor", SutReference("idle", "idle", {}), 0, scene.digest, corridor.robot(),
        mission, tuple(behaviours), (), MapSettings(), 7, SECONDS,
    )  # fmt: skip


def cases():
    scene = corridor.scene()
    return [
        (AT_REST, idle(scene, doors_move=False), scene),
        (MOVING, idle(scene, doors_move=True), scene),
        ("building C, S2, pilot", *run_of(PAPER / "first.yaml", "S2")),
    ]


def measure():
    """Each run several times, all of them in turns; the corridor at rest is the reference."""
    load_all()
    found = [*cases(), (S1, *run_of(PAPER / "campaign.yaml", "S1", "a2s"))]
    # As in the process that a worker forks for a run: the collection at the end of a run looks at
    # the objects of that run alone.
    gc.collect()
    gc.freeze()
    best = {}
    for k in range(TIMES):
        progress.say(f"{k + 1} of {TIMES}")
        for title, run, scene in found:
            used, result = executed(run, scene)
            simulated = result.timing.simulated
            rate = result.trace.size / 1000 / (simulated / 60)
            note = f"{used:.3f} CPU s for {simulated:.0f} s, trace {rate:.0f} kB/min"
            best[title] = max(best.get(title, (0.0, "")), (simulated / used, note))
    base = Reference(AT_REST, best[AT_REST][0])
    for title, (speed, note) in best.items():
        beside = None if title == base.name else base
        yield Measurement(title, speed, "x real time", beside, GOALS.get(title, ()), note)
    progress.say("with stopwatches")
    with stopwatches() as spent:
        whole, _ = executed(*found[-1][1:])
    yield from components(spent, whole)


def executed(run, scene):
    """Return CPU seconds and the result of a run."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.process_time()
        result = execute(run, scene, trace_path=Path(folder) / "run.mcap")
        return time.process_time() - start, result


@contextmanager
def stopwatches():
    """Collect [CPU seconds, calls] of each component while the block runs."""
    spent = {title: [0.0, 0] for title, _, _ in METHODS}
    with ExitStack() as stack:
        for title, owner, names in METHODS:
            for name in names:
                timed = _timed(getattr(owner, name), spent[title])
                stack.enter_context(mock.patch.object(owner, name, timed))
        yield spent


def _timed(method, total):
    def wrapper(*arguments, **named):
        begun = time.process_time()
        try:
            return method(*arguments, **named)
        finally:
            total[0] += time.process_time() - begun
            total[1] += 1

    return wrapper


def components(spent, whole):
    """A line for each component, the whole run with its stopwatches being the reference."""
    everything, calls = spent.pop("stack, all")
    spent["stack itself"] = everything - sum(seconds for seconds, _ in spent.values()), calls
    spent["simulator, trace, oracles"] = whole - everything, 1
    for title, (seconds, calls) in spent.items():
        note = f"{calls:.0f} calls of {1e6 * seconds / calls:.1f} us" if calls > 1 else ""
        yield Measurement(f"  {title}", seconds, "CPU s", Reference("S1", whole), (), note)
