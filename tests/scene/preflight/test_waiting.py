"""Events that never come and triggers out of reach, to the centimetre."""

import pytest

from grammars.model.behaviour import (
    Hold,
    JointActs,
    Jump,
    LegBegins,
    Reaction,
    Servo,
    Trigger,
    Walk,
    WaypointReached,
)
from grammars.scenery.composition import compile_scene
from tests.languages.plans import layer, two_rooms
from tests.scene.preflight.samples import DOOR, PERSON, messages, mission, scene_with

OTHER = "e is a hinged_door in way_out, hinge left, opening inwards\n"
TASK = mission((3, 0), (4, 0))


def reaction(joint, event):
    # The leaf of the other door opens the other way.
    return Reaction(joint, 1.5 if joint == "d.hinge" else -1.5, 0.0, event, Jump())


def fires(*joints):
    return JointActs(joints, "fires")


def moves(*joints):
    return JointActs(joints, "moves")


def found(robot, *behaviours, objects=DOOR + OTHER + PERSON):
    return messages(robot, scene_with(objects), TASK, *behaviours)


NEVER = "say what makes it happen, or wait for something else"


@pytest.mark.parametrize("leg", [0, 3])
def test_legs_are_counted_from_one_to_the_last_waypoint(robile, leg):
    assert found(robile, reaction("d.hinge", LegBegins(leg))) == [
        f"there is no leg {leg}, mission m has 2 (legs are counted from 1)"
    ]
    for there in (1, 2):
        assert found(robile, reaction("d.hinge", LegBegins(there))) == []


def test_names_that_are_not_there_are_corrected(robile):
    assert found(robile, reaction("d.hinge", WaypointReached("w7"))) == [
        'mission m has no waypoint "w7" (known here: w0, w1)'
    ]
    assert found(robile, reaction("d.hinge", moves("e.hinge", "e.hing"))) == [
        'there is no joint "e.hing" in the scene (did you mean "e.hinge"?)'
    ]


def test_what_sets_off_what_is_followed_to_its_end(robile):
    first = Trigger("d.hinge", 1.5, 0.0, 2.0, Servo())
    second = reaction("e.hinge", fires("d.hinge"))
    third = Walk("v", ((-4, -1), (-2, -1)), 1.0, event=fires("e.hinge"))
    assert found(robile, first, second, third) == []
    waits = f"waits for d.hinge to fire, which never happens ({NEVER})"
    assert found(robile, second, third) == [
        f"? e.hinge {waits}",
        f"? v waits for e.hinge to fire, which never happens ({NEVER})",
    ]
    # The one that does fire is enough, and who waits for nothing in particular always comes.
    assert found(robile, first, reaction("e.hinge", fires("d.hinge", "v.x"))) == []
    assert found(robile, reaction("d.hinge", LegBegins(1)), second, third) == []


def test_what_moves_is_a_free_door_or_a_mover_that_walks(robile):
    waiting = reaction("d.hinge", moves("e.hinge"))
    assert found(robile, waiting) == []
    never = f"? d.hinge waits for e.hinge to move, which never happens ({NEVER})"
    assert found(robile, waiting, Hold("e.hinge", 0.0)) == [never]
    frozen = DOOR + OTHER.replace("\n", ", frozen\n") + PERSON
    assert found(robile, waiting, objects=frozen) == [never]
    for_the_mover = reaction("d.hinge", moves("v.x", "v.y"))
    assert found(robile, for_the_mover) == [
        f"? d.hinge waits for v.x or v.y to move, which never happens ({NEVER})"
    ]
    route = ((-4, -1), (-2, -1))
    assert found(robile, for_the_mover, Walk("v", route, 1.0)) == []
    # A walk that itself waits in vain moves nothing.
    in_vain = found(robile, for_the_mover, Walk("v", route, 1.0, event=fires("e.hinge")))
    assert [text.split(" waits")[0] for text in in_vain] == ["? d.hinge", "? v"]


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
def test_a_trigger_fires_only_within_what_the_robot_gets_near_to(
    robile, model, joint, of, to, nearest
):
    scene = compile_scene(two_rooms(*NARROW), [layer(BEHIND[model])])

    def asked(distance):
        trigger = Trigger(f"e.{joint}", 0.0, 1.0, distance, Servo(), of, to)
        return messages(robile, scene, TASK, trigger)

    assert asked(nearest + 0.01) == []
    (text,) = asked(nearest - 0.01)
    assert text == (
        f"? e.{joint} never fires: robile gets no nearer to e's {of} than {nearest:.2f} m, it must "
        f"be within {nearest - 0.01:g} m (take a larger distance, or look for what is in the way)"
    )


def test_a_doorway_is_measured_from_its_middle(robile):
    text = "d is a slider in kitchen_doorway, sliding left"
    scene = compile_scene(two_rooms(*NARROW), [layer(text)])
    near = Trigger("d.rail", 0.0, 1.0, 0.2, Servo(), "doorway")
    (never,) = messages(robile, scene, TASK, near)
    assert "gets no nearer to d's doorway than 0.27 m" in never
    assert messages(robile, scene, TASK, Trigger("d.rail", 0, 1, 0.3, Servo(), "doorway")) == []
    # A robot that stands in no free space is told that, and nothing about triggers.
    lost = messages(robile, scene, mission((3, 0), start=mission((20, 0)).start), near)
    assert len(lost) == 1


def test_a_trigger_is_reached_through_doors_that_are_not_held(robile):
    scene = scene_with(DOOR + BEHIND["door"])
    trigger = Trigger("e.hinge", 0.0, 1.0, 0.5, Servo())
    assert messages(robile, scene, TASK, trigger) == []
    held = messages(robile, scene, TASK, trigger, Hold("d.hinge", 0.0))
    assert [t.split(":")[0] for t in held] == ["? e.hinge never fires"]
    assert messages(robile, scene, TASK, trigger, Hold("d.hinge", 1.9)) == []
