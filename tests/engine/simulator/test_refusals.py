"""Worlds that cannot be: refused before anything moves."""

from dataclasses import replace

import pytest

from grammars.model.behaviour import (
    Hold,
    Jump,
    KeyFrame,
    KeyFrames,
    Reaction,
    Servo,
    Trigger,
    Walk,
    WaypointReached,
)
from grammars.model.geometry import Pose2
from tests.engine.simulator.scenes import door, folding, world
from tests.engine.simulator.test_walkers import person

FOLDING = folding("f", Pose2())
FOLD, ROOT = FOLDING.joints
WEIGHTLESS = tuple(replace(link, mass=0.0) for link in FOLDING.links)
DOOR = door("d")
HOLD = Hold("d.hinge", 0.0)
LINE = ((-3.0, 0.0), (3.0, 0.0))


@pytest.mark.parametrize(
    ("part", "behaviours", "message"),
    [
        (replace(FOLDING, joints=(FOLD, replace(ROOT, parent="b"))), (), "form a loop"),
        (replace(FOLDING, joints=(FOLD, replace(ROOT, parent="nothing"))), (), "unknown link"),
        (replace(FOLDING, links=WEIGHTLESS), (), "has no mass"),
        (DOOR, (Hold("d.lock", 0.0),), "no joint 'd.lock'"),
        (DOOR, (HOLD, Hold("d.hinge", 1.0)), "more than one"),
        (
            DOOR,
            (Trigger("d.hinge", 0.0, 1.4, 1.3, Jump(), of="doorway"),),
            "stands in no doorway",
        ),
        (replace(DOOR, frozen=True), (HOLD,), "frozen"),
        (
            DOOR,
            (Reaction("d.hinge", 1.5, 0.0, WaypointReached("x"), Jump(), 0.0),),
            "no waypoint 'x'",
        ),
        (DOOR, (Walk("d", LINE, 0.8),), "'d' is no mover"),
        (person(), (Walk("nobody", LINE, 0.8),), "no mover"),
        (person(), (KeyFrames("visitor.x", (KeyFrame(0, 0),), Servo()),), "belongs to a mover"),
        (person(), (Trigger("visitor.yaw", 0.0, 1.0, 1.0, Servo()),), "belongs to a mover"),
    ],
)
def test_what_cannot_be_is_refused(part, behaviours, message):
    with pytest.raises(ValueError, match=message):
        world(part, behaviours=behaviours)
