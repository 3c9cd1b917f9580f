"""What joints are told to do: limits, sweeps, events that never come, triggers out of reach."""

import dataclasses

import pytest

from grammars.model.behaviour import (
    Hold,
    JointActs,
    Jump,
    KeyFrame,
    KeyFrames,
    LegBegins,
    Reaction,
    Servo,
    Trigger,
    Walk,
    WaypointReached,
)
from grammars.scenery.composition import compile_scene
from tests.languages.plans import layer, two_rooms
from tests.scene.preflight.samples import DOOR, OTHER, PERSON, messages, mission, scene_with

TASK = mission((3, 0), (4, 0))
FREE = "d is a hinged_door at kitchen\n"


def frames(joint, *positions):
    told = tuple(KeyFrame(float(i), q) for i, q in enumerate(positions))
    return KeyFrames(joint, told, Jump())


def with_limits(scene, lower, upper):
    (body,) = scene.objects
    joint = dataclasses.replace(body.joints[0], lower=lower, upper=upper)
    changed = dataclasses.replace(body, joints=(joint,), initial=(0.0,))
    return dataclasses.replace(scene, objects=(changed,))


def test_a_frozen_joint_may_only_be_held_where_it_is():
    frozen = FREE.replace("\n", ", frozen")
    moves = "d.hinge is to move, but d is frozen (leave out frozen, or the behaviour)"
    assert messages(frozen, TASK, Hold("d.hinge", 0.0)) == []
    assert messages(frozen, TASK, Hold("d.hinge", 0.1)) == [moves]
    assert messages(frozen, TASK, frames("d.hinge", 0.0)) == [moves]


def test_the_limits_themselves_are_allowed():
    assert messages(FREE, TASK, frames("d.hinge", 0.0, 2.0)) == []
    outside = "outside of its limits (between 0 and 2)"
    assert messages(FREE, TASK, frames("d.hinge", -0.01, 1.0, 2.01, -0.01)) == [
        f"d.hinge is sent to -0.01, {outside}",
        f"d.hinge is sent to 2.01, {outside}",
    ]
    assert messages(FREE, TASK, Hold("d.hinge", 2.5)) == [f"d.hinge is sent to 2.5, {outside}"]


def test_a_joint_without_room_may_only_be_held():
    stuck = with_limits(scene_with(FREE), 0.0, 0.0)
    assert messages(stuck, TASK, Hold("d.hinge", 0.0)) == []
    for told in (
        frames("d.hinge", 0.0),
        Trigger("d.hinge", 0.0, 0.0, 9.0, Servo()),
        Reaction("d.hinge", 0.0, 0.0, LegBegins(1), Jump()),
    ):
        no_room = "d.hinge is to move, but its limits leave no room"
        assert messages(stuck, TASK, told) == [no_room]
    little = with_limits(scene_with(FREE), 0.0, 1e-6)
    assert messages(little, TASK, frames("d.hinge", 0.0)) == []


@pytest.mark.parametrize("joint", ["x", "y", "yaw"])
def test_the_joints_of_a_mover_are_walked(joint):
    belongs = f"v.{joint} belongs to a mover (let v walk)"
    assert messages(PERSON, TASK, frames(f"v.{joint}", 0.0)) == [belongs]
    assert messages(PERSON, TASK, Hold(f"v.{joint}", 0.0)) == []


def test_a_joint_that_is_there_has_one_behaviour():
    twice = (frames("d.hinge", 0.0), Hold("d.hinge", 0.0))
    assert messages(FREE, TASK, *twice) == ["d.hinge has two behaviours (one must go)"]
    assert messages(FREE, TASK, Hold("d.hing", 0.0)) == [
        'there is no joint "d.hing" in the scene (did you mean "d.hinge"?)'
    ]


def test_only_a_door_in_a_doorway_measures_from_it():
    none = (
        "d.hinge measures from its doorway, but d stands in none (measure from its hinge or leaf)"
    )
    for objects, of, expected in (
        (FREE, "doorway", [none]),
        (FREE, "hinge", []),
        (DOOR, "doorway", []),
    ):
        trigger = Trigger("d.hinge", 0.0, 1.0, 9.0, Servo(), of)
        assert messages(objects, TASK, trigger) == expected


def test_a_leaf_sweeps_from_its_least_to_its_greatest_angle():
    # The leaf, 0.94 m long, opens into the kitchen from (0.05, 2.4), away from the doorway.
    task = mission((0.4, 3.1))
    over = ["? d sweeps over waypoint w0 (the robot may be hit there)"]
    angle = 0.55  # where the leaf covers it, seen from the closed leaf
    swept = [
        messages(DOOR, task, frames("d.hinge", *angles)) == over
        for angles in ((0.0, 2.0), (2.0, 0.0), (0.0, 2.0, 1.9), (angle + 0.7, 2.0), (0.0, angle))
    ]
    assert swept == [True, True, True, False, False]
    # Told to stay elsewhere than the scene has it, it sweeps nothing in between.
    assert messages(DOOR, task, frames("d.hinge", 1.9, 2.0)) == []


def test_a_leaf_meets_walls_and_other_leaves_only_as_far_as_it_is_told_to_move():
    corner = "d is a hinged_door at hall, x 4.5 m, y 1.5 m, turned 180 deg"
    assert messages(corner, TASK, frames("d.hinge", 0.0, 0.2)) == []
    (wall,) = messages(corner, mission((0, 0)), frames("d.hinge", 0.0, 1.5))
    assert wall.startswith("? the leaf of d sweeps through hall-wall-1 as it is told to move")
    pair = DOOR + "e is a hinged_door at kitchen, x 0.2 m, y -0.9 m"
    assert messages(pair, TASK, frames("d.hinge", 0.0, 0.1)) == []
    (meet,) = messages(pair, TASK, frames("d.hinge", 0.0, 2.0), frames("e.hinge", 0.0, 2.0))
    assert meet.startswith("? d and e can run into each other as they are told to move")


def test_a_mover_that_stands_in_a_wall_is_found_unless_it_walks():
    inside = PERSON.replace("x -4 m", "x -5 m")
    assert any("starts inside" in text for text in messages(inside, TASK))
    assert messages(inside, TASK, Walk("v", ((-4, 1), (0, 1)), 1.0)) == []
    thin = PERSON.replace("25 cm", "7 cm").replace("x -4 m", "x -5.1 m")
    (text,) = messages(thin, TASK)
    assert "the body of v starts inside of hall-wall-3" in text


# Events that never come.


def reaction(joint, event):
    # The leaf of the other door opens the other way.
    return Reaction(joint, 1.5 if joint == "d.hinge" else -1.5, 0.0, event, Jump())


def fires(*joints):
    return JointActs(joints, "fires")


def moves(*joints):
    return JointActs(joints, "moves")


def found(*behaviours, objects=DOOR + OTHER + PERSON):
    return messages(objects, TASK, *behaviours)


NEVER = "say what makes it happen, or wait for something else"
LEGS = "mission m has 2 (legs are counted from 1)"


@pytest.mark.parametrize(
    ("event", "expected"),
    [
        (LegBegins(0), [f"there is no leg 0, {LEGS}"]),
        (LegBegins(3), [f"there is no leg 3, {LEGS}"]),
        (WaypointReached("w7"), ['mission m has no waypoint "w7" (known here: w0, w1)']),
        (
            moves("e.hinge", "e.hing"),
            ['there is no joint "e.hing" in the scene (did you mean "e.hinge"?)'],
        ),
        (LegBegins(1), []),
        (LegBegins(2), []),
        (WaypointReached("w1"), []),
        (moves("e.hinge"), []),
    ],
)
def test_events_name_legs_waypoints_and_joints_that_are_there(event, expected):
    assert found(reaction("d.hinge", event)) == expected


def test_what_sets_off_what_is_followed_to_its_end():
    first = Trigger("d.hinge", 1.5, 0.0, 2.0, Servo())
    second = reaction("e.hinge", fires("d.hinge"))
    third = Walk("v", ((-4, -1), (-2, -1)), 1.0, event=fires("e.hinge"))
    assert found(first, second, third) == []
    waits = f"waits for d.hinge to fire, which never happens ({NEVER})"
    assert found(second, third) == [
        f"? e.hinge {waits}",
        f"? v waits for e.hinge to fire, which never happens ({NEVER})",
    ]
    # The one that does fire is enough, and who waits for nothing in particular always comes.
    assert found(first, reaction("e.hinge", fires("d.hinge", "v.x"))) == []
    assert found(reaction("d.hinge", LegBegins(1)), second, third) == []


def test_what_moves_is_a_free_door_or_a_mover_that_walks():
    waiting = reaction("d.hinge", moves("e.hinge"))
    never = f"? d.hinge waits for e.hinge to move, which never happens ({NEVER})"
    assert found(waiting, Hold("e.hinge", 0.0)) == [never]
    frozen = DOOR + OTHER.replace("\n", ", frozen\n") + PERSON
    assert found(waiting, objects=frozen) == [never]
    for_the_mover = reaction("d.hinge", moves("v.x", "v.y"))
    assert found(for_the_mover) == [
        f"? d.hinge waits for v.x or v.y to move, which never happens ({NEVER})"
    ]
    route = ((-4, -1), (-2, -1))
    assert found(for_the_mover, Walk("v", route, 1.0)) == []
    # A walk that itself waits in vain moves nothing.
    in_vain = found(for_the_mover, Walk("v", route, 1.0, event=fires("e.hinge")))
    assert [text.split(" waits")[0] for text in in_vain] == ["? d.hinge", "? v"]


# Triggers, to the centimetre.

NARROW = (("width=1 m, height=2 m", "width=0.4 m, height=2 m"),)
ARM = """
object arm
    link post  box 10 cm x 10 cm from 0 m to 1 m, mass 9 kg
    link upper box 1 m x 10 cm at (0.5 m, 0 m) from 0.5 m to 0.7 m, mass 2 kg
    link hand  box 20 cm x 10 cm at (1.1 m, 0 m) from 0.5 m to 0.7 m, mass 1 kg
    joint shoulder revolute from post to upper at (0 m, 0 m), between -90 deg and 90 deg
    joint elbow revolute from upper to hand at (1 m, 0 m), between -90 deg and 90 deg
"""
# In the kitchen, which the robot does not get into: its centre gets to y = 2 - 0.233 = 1.767 m
# and counts as 5 cm nearer, its farthest corner is hypot(0.3495, 0.233) = 0.420 m from the centre.
BEHIND = {
    "door": "e is a hinged_door at kitchen, x -1 m",
    "slider": "e is a slider at kitchen, x -0.4 m",
    "arm": ARM + "e is a arm at kitchen, x -1 m",
}


@pytest.mark.parametrize(
    ("model", "joint", "of", "to", "nearest"),
    [
        ("door", "hinge", "hinge", "base", 3.925 - 1.767 - 0.05),
        ("door", "hinge", "foot", "base", 3.9 - 1.767 - 0.05),
        ("door", "hinge", "foot", "footprint", 3.9 - 1.767 - 0.05 - 0.42),
        # Opened to 2 rad the end of the leaf, 0.94 m from the hinge, is nearest.
        ("door", "hinge", "leaf", "base", 3.925 + 0.94 * -0.41615 - 1.767 - 0.05),
        # What slides from the world has no hinge but where it stands.
        ("slider", "rail", "hinge", "base", 3.9 - 1.767 - 0.05),
        ("arm", "shoulder", "hinge", "base", 3.9 - 1.767 - 0.05),
        # The elbow moves with the upper arm, whose end is 1 m (5 cm beside) from the shoulder.
        ("arm", "elbow", "hinge", "base", 3.9 - 1.0 - 1.767 - 0.05),
        ("arm", "elbow", "foot", "base", 3.9 - 1.0 - 1.767 - 0.05),
    ],
)
def test_a_trigger_fires_only_within_what_the_robot_gets_near_to(model, joint, of, to, nearest):
    scene = compile_scene(two_rooms(*NARROW), [layer(BEHIND[model])])

    def asked(distance):
        trigger = Trigger(f"e.{joint}", 0.0, 1.0, distance, Servo(), of, to)
        return messages(scene, TASK, trigger)

    assert asked(nearest + 0.01) == []
    (text,) = asked(nearest - 0.01)
    assert text == (
        f"? e.{joint} never fires: robile gets no nearer to e's {of} than {nearest:.2f} m, it must "
        f"be within {nearest - 0.01:g} m (take a larger distance, or look for what is in the way)"
    )


def test_a_doorway_is_measured_from_its_middle():
    text = "d is a slider in kitchen_doorway, sliding left"
    scene = compile_scene(two_rooms(*NARROW), [layer(text)])
    near = Trigger("d.rail", 0.0, 1.0, 0.2, Servo(), "doorway")
    (never,) = messages(scene, TASK, near)
    assert "gets no nearer to d's doorway than 0.27 m" in never
    assert messages(scene, TASK, Trigger("d.rail", 0, 1, 0.3, Servo(), "doorway")) == []
    # A robot that stands in no free space is told that, and nothing about triggers.
    lost = messages(scene, mission((3, 0), start=mission((20, 0)).start), near)
    assert len(lost) == 1


def test_a_trigger_is_reached_through_doors_that_are_not_held():
    objects = DOOR + BEHIND["door"]
    trigger = Trigger("e.hinge", 0.0, 1.0, 0.5, Servo())
    assert messages(objects, TASK, trigger) == []
    held = messages(objects, TASK, trigger, Hold("d.hinge", 0.0))
    assert [t.split(":")[0] for t in held] == ["? e.hinge never fires"]
    assert messages(objects, TASK, trigger, Hold("d.hinge", 1.9)) == []
