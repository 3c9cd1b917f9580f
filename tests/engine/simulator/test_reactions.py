"""Joints react, once, to the mission and to each other."""

import numpy as np
import pytest

from daemon.simulator import World
from grammars.model.behaviour import (
    JointActs,
    Jump,
    KeyFrame,
    KeyFrames,
    LegBegins,
    Reaction,
    Servo,
    Trigger,
    WaypointReached,
)
from grammars.model.geometry import Pose2, Twist2
from tests.engine.simulator.scenes import ROBOT, door, driven, scene, world

AWAY = Pose2(5.0, 5.0, 0.0)
OTHER = Pose2(0.0, -6.0, 0.0)


def closes(event, delay=0.0, joint="door.hinge"):
    return Reaction(joint, 1.5, 0.0, event, Jump(), delay)


@pytest.mark.parametrize(
    ("event", "delay", "before", "news"),
    [
        (LegBegins(2), 0.5, [(0, 0)], [(1, 1)]),
        (LegBegins(1), 0.0, [], [(0, 0)]),
        (WaypointReached("b"), 0.0, [(1, 1)], [(2, 2), (2, 2)]),
    ],
    ids=["a leg", "the first leg", "a waypoint of two that are called so"],
)
def test_news_of_the_mission_move_a_door_once(event, delay, before, news):
    seed, behaviours = np.random.SeedSequence(1), (closes(event, delay),)
    now = World(scene(door()), ROBOT, AWAY, behaviours, seed, ("a", "b", "b"))
    for report in before:
        now.progress(*report)
    now.advance(100)
    for report in news:
        now.progress(*report)
    if delay:
        now.advance(round(delay * 100))
    assert now.joint_positions()[0] == pytest.approx(1.5)
    now.advance(1)
    assert now.joint_positions()[0] == pytest.approx(0.0, abs=1e-6)
    (moved,) = now.take_events()
    assert (moved.time, moved.source, moved.text) == (1.0 + delay, "door.hinge", "reacts: to 0")


def test_doors_fire_one_after_another():
    first = Trigger("other.hinge", 0.0, 1.0, 1.0, Jump())
    second = closes(JointActs(("other.hinge",), "fires"), 0.2)
    third = closes(JointActs(("door.hinge",), "fires"), 0.0, "last.hinge")
    doors = (door(), door("other", OTHER), door("last", Pose2(0.0, 9.0, 0.0)))
    now = world(*doors, start=Pose2(2.0, -6.0, 0.0), behaviours=(first, second, third))
    now.advance(50)
    assert now.take_events() == ()
    now.command(Twist2(-1.0, 0.0, 0.0))
    now.advance(400)
    sources = [event.source for event in now.take_events() if "stopped" not in event.text]
    assert sources == ["other.hinge", "door.hinge", "last.hinge"]
    assert now.joint_positions()[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-6)


def test_a_joint_that_starts_to_move_is_noticed_whatever_moves_it():
    behaviours = (
        KeyFrames("other.hinge", (KeyFrame(1.0, 1.0),), Servo(1.0, 40.0)),
        closes(JointActs(("other.hinge",), "moves")),
    )
    now = world(door(), door("other", OTHER), start=AWAY, behaviours=behaviours)
    now.advance(100)
    assert now.joint_positions()[0] == pytest.approx(1.5)
    now.advance(30)
    assert now.joint_positions()[0] == pytest.approx(0.0, abs=1e-6)


def test_a_pushed_door_starts_to_move():
    behaviours = (closes(JointActs(("other.hinge",), "moves")),)
    now = driven(
        Twist2(-0.5, 0.0, 0.0),
        300,
        door(),
        door("other", OTHER),
        start=Pose2(1.0, -5.5, 0.0),
        behaviours=behaviours,
    )
    assert now.joint_positions()[0] == pytest.approx(0.0, abs=1e-6)


def test_a_held_door_never_starts_to_move():
    frozen = door("other", OTHER, frozen=True)
    now = world(door(), frozen, behaviours=(closes(JointActs(("other.hinge",), "moves")),))
    now.advance(50)
    assert now.take_events() == ()
