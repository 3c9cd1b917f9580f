"""Short recorded runs to judge again: two seconds straight on, past nothing."""

import numpy as np

from daemon.model.spec import OracleText
from daemon.trace import TraceWriter
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission, Waypoint
from tests.engine.trace.recordings import scene, specification

WORLD = scene(1)
SLOW = OracleText("slow", "max(speed) <= 0.6 m/s")
THERE = OracleText("there", "reached(mission, 0.1 m)")


def spec(repeat=0, **changes):
    mission = Mission("on", Pose2(10.0, 1.0), (Waypoint("end", 11.0, 1.0),))
    return specification(WORLD, repeat=repeat, mission=mission, oracles=(SLOW, THERE), **changes)


def drive(path, run, speed=0.5):
    """Record two seconds straight on."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with TraceWriter(path, run, WORLD) as trace:
        trace.static(OccupancyGrid(0.5, 0.0, 0.0, np.zeros((4, 20), np.int8)))
        for step in range(41):
            now = step * 0.05
            trace.ground_truth(now, Pose2(10.0 + speed * now, 1.0), Twist2(speed, 0.0, 0.0))
            trace.joints(now, np.array([0.4]), np.array([0.0]))
        trace.close("finished", "")
    return path
