"""The product's promise: simulated seconds per CPU second of whole runs, and their memory.

A corridor of 60 m with 20 hinged doors, a 500-ray laser, full trace, an idle system under test;
the same with doors that open and close; and the corridor of building C (scenario S2 of the paper)
with the pilot driving. Tracing, reading the trace back and judging are included.
"""

from __future__ import annotations

import resource
import tempfile
import time
from pathlib import Path

from daemon.campaign import expand, load_campaign
from daemon.model.spec import MapSettings, RunSpec, SutReference
from daemon.run import execute, warm_up
from grammars.model.behaviour import KeyFrame, KeyFrames, Servo
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.scene import Scene
from tests.benchmarks import corridor

SECONDS = 300.0
CAMPAIGNS = Path(__file__).parents[2] / "campaigns"


def idle(scene: Scene, *, doors_move: bool) -> RunSpec:
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


def cases() -> list[tuple[str, RunSpec, Scene]]:
    scene = corridor.scene()
    paper = expand(load_campaign(CAMPAIGNS / "ortega2024" / "first.yaml"))
    building = {s.digest: s for s in paper.scenes}
    driven = next(r for r in paper.runs if r.scenario == "S2")
    return [
        ("corridor, idle, doors at rest", idle(scene, doors_move=False), scene),
        ("corridor, idle, doors moving", idle(scene, doors_move=True), scene),
        ("building C, S2, pilot", driven, building[driven.scene]),
    ]


def main() -> None:
    warm_up()
    print(f"{'run':32} {'sim s':>7} {'CPU s':>7} {'sim s / CPU s':>14} {'trace kB/min':>13}")
    with tempfile.TemporaryDirectory() as folder:
        for number, (title, run, scene) in enumerate(cases()):
            best, size, simulated = float("inf"), 0, 0.0
            for k in range(3):
                path = Path(folder) / f"{number}-{k}.mcap"
                start = time.process_time()
                result = execute(run, scene, trace_path=path)
                best = min(best, time.process_time() - start)
                size, simulated = result.trace.size, result.timing.simulated
            rate = size / 1000 / (simulated / 60)
            print(f"{title:32} {simulated:7.0f} {best:7.3f} {simulated / best:14.0f} {rate:13.0f}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory of this process: {peak:.0f} MB")


if __name__ == "__main__":
    main()
