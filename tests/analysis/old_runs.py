"""Recorded runs to judge or execute again: two seconds straight on, past nothing."""

import random
from dataclasses import replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from daemon.model.spec import OracleText, SutReference
from daemon.model.sut import Decision, Progress
from daemon.run import execute
from daemon.stacks import registry
from daemon.trace import TraceWriter
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission, Waypoint
from tests.engine.trace.recordings import scene, specification

WORLD = scene(1)
SLOW = OracleText("slow", "max(speed) <= 0.6 m/s")
THERE = OracleText("there", "reached(mission, 0.1 m)")
MEASURE = OracleText("far", "final(path.length)")
IDLE = SutReference("idle", "idle", {})
EXTERNAL = SutReference("theirs", "erratic", {"repeatable": False})


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


def recorded(folder, **changes):
    """Execute a run of a second, and return its trace and its specification."""
    run = replace(spec(limit=1.0), **changes)
    run = replace(run, oracles=(*run.oracles, MEASURE))
    path = folder / "run.mcap"
    execute(run, WORLD, trace_path=path)
    return path, run


class Erratic:
    """Drives on at a speed it draws, as something does that nobody here controls."""

    period = 0.1
    needs_ground_truth = False

    def __init__(self, parameters):
        self._speed = random.uniform(0.1, 0.5)

    def start(self, briefing):
        self._end = random.uniform(0.4, 1.2)

    def update(self, observation):
        state = "aborted" if observation.time > self._end else "active"
        return Decision(Twist2(self._speed, 0.0, 0.0), Progress(0, 0, state))


@pytest.fixture
def erratic(monkeypatch):
    entry = EntryPoint("erratic", f"{__name__}:Erratic", registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "installed", lambda group: {"erratic": entry})
