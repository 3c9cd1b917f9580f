"""Where behaviours put joints at the start, and values of behaviours that are refused."""

import math

import pytest
from pydantic import TypeAdapter

from grammars.model.behaviour import (
    Hold,
    Jump,
    KeyFrame,
    KeyFrames,
    LegBegins,
    Reaction,
    Servo,
    Trigger,
    Walk,
    start_positions,
)
from grammars.model.geometry import Pose2
from grammars.model.scene import Joint, Link, Scene, SceneObject

RING = ((0.0, 0.0), (1.0, 0.0), (1.0, 0.1), (0.0, 0.1))
LEAF = Joint("hinge", "revolute", "world", "leaf", (0.0, 0.0), (0.0, 0.0), 0.0, 2.0)
LINK = Link("leaf", (RING,), 5.0, 0.0, 2.0)
DOOR = SceneObject("door", "door", Pose2(), (LINK,), (LEAF,), (0.4,))
SCENE = Scene("house", (), (), (), (DOOR,))
NAME = "door.hinge"


def frames(*pairs):
    return KeyFrames(NAME, tuple(KeyFrame(time, position) for time, position in pairs), Jump())


@pytest.mark.parametrize(
    ("behaviour", "start", "positions"),
    [
        (Hold(NAME, 1.0), 1.0, (1.0,)),
        (frames((0.0, 0.1), (0.0, 0.2), (3.0, 1.5)), 0.2, (0.1, 0.2, 1.5)),
        (frames((2.0, 1.5)), 0.4, (1.5,)),
        (frames((2.0, 1.5), (0.0, 0.1)), 0.4, (1.5, 0.1)),
        (Trigger(NAME, 0.3, 1.2, 2.0, Jump()), 0.3, (0.3, 1.2)),
        (Trigger(NAME, 0.3, 1.2, 2.0, Servo(), begin=0.9), 0.9, (0.9, 0.3, 1.2)),
        (Reaction(NAME, 0.6, 1.1, LegBegins(2), Jump()), 0.6, (0.6, 1.1)),
    ],
)
def test_a_behaviour_says_where_its_joint_starts_and_is_sent(behaviour, start, positions):
    assert start_positions(SCENE, [behaviour]) == {NAME: start}
    assert behaviour.positions == positions


@pytest.mark.parametrize("behaviours", [[], [Walk("someone", ((0.0, 0.0), (1.0, 0.0)), 1.0)]])
def test_joints_without_a_behaviour_start_as_the_scene_says(behaviours):
    assert start_positions(SCENE, behaviours) == SCENE.initial_joints == {NAME: 0.4}


WALK = {"object": "someone", "route": ((0.0, 0.0), (1.0, 0.0)), "speed": 1.0}
TRIGGER = {"joint": NAME, "start": 0.0, "end": 1.0, "distance": 1.5, "motion": {"kind": "jump"}}


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (KeyFrames, {"frames": [{"time": 2.0, "position": 0.0}, {"time": -1.0, "position": 1.0}]},
         "before 0 s, or never"),
        (KeyFrames, {"frames": [{"time": math.nan, "position": 0.0}]}, "before 0 s, or never"),
        (KeyFrames, {"frames": [{"time": math.inf, "position": 0.0}]}, "before 0 s, or never"),
        (Trigger, {"rearm": 1.5}, "rearm must exceed distance"),
        (Trigger, {"begin": 1.0}, "a jump begins at its start"),
        (Walk, {"route": ((0.0, 0.0),)}, "needs a route"),
        (Walk, {"route": ((0.0, 0.0), (0.0, 0.0))}, "needs a route"),
        (Walk, {"speed": 0.0}, "needs a route"),
        (Walk, {"route": ((0.0, 0.0), (1.0, 0.0), (0.0, 0.0)), "manner": "round"}, "closes by"),
        (Walk, {"start": -1.0}, "never negative"),
    ],
)  # fmt: skip
def test_values_that_make_no_sense_are_refused_wherever_they_are_read(kind, values, message):
    """A run's specification may come from anywhere, not only from files that were checked."""
    sound = {KeyFrames: {"joint": NAME, "motion": {"kind": "jump"}}, Trigger: TRIGGER, Walk: WALK}
    with pytest.raises(ValueError, match=message):
        TypeAdapter(kind).validate_python(sound[kind] | values)
