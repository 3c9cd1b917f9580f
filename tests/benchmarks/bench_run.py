"""The product's promise: simulated seconds per CPU second of whole runs.

A corridor of 60 m with 20 hinged doors, a 500-ray laser, full trace, an idle system under test;
the same with doors that open and close; and the corridor of building C (scenario S2 of the paper)
with the pilot driving. Tracing, reading the trace back and judging are included.
"""

import gc
import tempfile
import time
from pathlib import Path

from daemon.campaign import expand, load_campaign
from daemon.model.spec import MapSettings, RunSpec, SutReference
from daemon.run import execute
from grammars.model.behaviour import KeyFrame, KeyFrames, Servo
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from tests.benchmarks import corridor, progress
from tests.benchmarks.measurement import Measurement, Reference, at_least
from tests.kernels import load_all

SECONDS = 300.0
TIMES = 4
AT_REST, MOVING = "corridor, doors at rest", "corridor, doors moving"
GOALS = {AT_REST: (at_least(1000.0),), MOVING: (at_least(750.0),)}
CAMPAIGNS = Path(__file__).parents[2] / "campaigns"


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
    paper = expand(load_campaign(CAMPAIGNS / "ortega2024" / "first.yaml"))
    building = {s.digest: s for s in paper.scenes}
    driven = next(r for r in paper.specs if r.scenario == "S2")
    return [
        (AT_REST, idle(scene, doors_move=False), scene),
        (MOVING, idle(scene, doors_move=True), scene),
        ("building C, S2, pilot", driven, building[driven.scene]),
    ]


def measure():
    """Each run several times, all of them in turns; the corridor at rest is the reference."""
    load_all()
    found = cases()
    # As in the process that a worker forks for a run: the collection at the end of a run looks at
    # the objects of that run alone.
    gc.collect()
    gc.freeze()
    best = {}
    with tempfile.TemporaryDirectory() as folder:
        for k in range(TIMES):
            progress.say(f"{k + 1} of {TIMES}")
            for title, run, scene in found:
                start = time.process_time()
                result = execute(run, scene, trace_path=Path(folder) / "run.mcap")
                used = time.process_time() - start
                simulated = result.timing.simulated
                rate = result.trace.size / 1000 / (simulated / 60)
                note = f"{used:.3f} CPU s for {simulated:.0f} s, trace {rate:.0f} kB/min"
                best[title] = max(best.get(title, (0.0, "")), (simulated / used, note))
    base = Reference(found[0][0], best[found[0][0]][0])
    for title, (speed, note) in best.items():
        beside = None if title == base.name else base
        yield Measurement(title, speed, "x real time", beside, GOALS.get(title, ()), note)
