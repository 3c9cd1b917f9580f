"""Mistakes are found before a run, and the messages say which and by how much."""

import dataclasses

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from grammars.floorplan import load_floorplan
from grammars.model.behaviour import (
    Hold,
    JointActs,
    Jump,
    KeyFrame,
    KeyFrames,
    LegBegins,
    Reaction,
    Servo,
    Spring,
    Trigger,
    Walk,
    WaypointReached,
)
from grammars.model.free_space import inscribed_radius
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.mission_files import load_mission
from grammars.model.robot_files import load_robot
from grammars.preflight import check_run, check_scene
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import Severity, Where
from tests.languages.plans import scene_with, two_rooms

DOOR = "d is a hinged_door in kitchen_doorway, hinge left, opening into kitchen"


ORIGIN = Pose2()


@pytest.fixture(scope="module")
def robot(campaigns):
    return load_robot(campaigns / "robots" / "robile.yaml")


def mission(*points, start=ORIGIN):
    return Mission("m", start, tuple(Waypoint(f"w{i}", x, y) for i, (x, y) in enumerate(points)))


def run(robot, scene, task, *behaviours):
    return check_run(scene, robot, task, behaviours, where=Where("task.yaml"))


def texts(found):
    return [str(d) for d in found]


def test_a_sound_world_and_mission_give_nothing(robot):
    scene = scene_with(DOOR)
    assert check_scene(scene) == ()
    assert run(robot, scene, mission((3, 0), (0.5, 4))) == ()


def test_a_start_that_only_fits_turned_is_found(robot):
    beside = Pose2(4.7, 0.0, 0.0)
    (found,) = run(robot, scene_with(DOOR), mission((3, 0), start=beside))
    assert found.message == "at the start robile stands in hall-wall-1"
    turned = dataclasses.replace(beside, yaw=1.5707963)
    assert run(robot, scene_with(DOOR), mission((3, 0), start=turned)) == ()


def test_places_of_waypoints_are_used(robot):
    where = Where("task.yaml", 7, 5)
    (found,) = check_run(scene_with(DOOR), robot, mission((20, 0)), (), places={"w0": where})
    assert found.where == where


def test_a_narrow_doorway_with_a_way_around_is_no_problem(robot):
    second = two_rooms(
        ("width=1 m, height=2 m", "width=0.4 m, height=2 m"),
        (
            "Entryway way_out:",
            "Entryway other: shape: Rectangle width=0.9 m, height=2 m location: in: hall.walls[0] "
            "and kitchen.walls[2] translation: x: -1 m, z: 1 m\nEntryway way_out:",
        ),
    )
    assert run(robot, compile_scene(second), mission((0, 4))) == ()


def test_a_door_that_can_open_is_no_obstacle_one_that_stays_shut_is(robot):
    scene = scene_with(DOOR)
    task = mission((0.5, 4))
    moving = KeyFrames(
        "d.hinge", (KeyFrame(0, 0.0), KeyFrame(5, scene.objects[0].joints[0].lower)), Jump()
    )
    assert run(robot, scene, task) == ()
    assert [d for d in run(robot, scene, task, moving) if d.severity is Severity.ERROR] == []
    (found,) = run(robot, scene, task, Hold("d.hinge", 0.0))
    assert found.severity is Severity.WARNING
    assert found.message == "waypoint w0 cannot be reached while d stays as told"


def test_doors_that_block_together_are_not_blamed_one_by_one(robot):
    both = DOOR + ", frozen\n" + DOOR.replace("d is", "e is").replace("left", "right") + ", frozen"
    (found,) = run(robot, scene_with(both), mission((0.5, 4)))
    assert found.message == "waypoint w0 cannot be reached while d and e stay as told"


def test_more_than_three_doors_in_the_way_are_counted(robot):
    names = [f"d{i}" for i in range(5)]
    doors = "".join(DOOR.replace("d is", f"{n} is").strip() + ", frozen\n" for n in names)
    (found,) = run(robot, scene_with(doors), mission((0.5, 4)))
    assert found.message == "waypoint w0 cannot be reached while d0, d1, d2 and 2 more stay as told"


def test_behaviours_of_joints_that_cannot_follow_are_found(robot):
    frozen = scene_with("d is a hinged_door at kitchen, frozen")
    trigger = Trigger("d.hinge", 0.0, 1.0, 1.0, Spring())
    task = mission((3, 0))
    (found,) = run(robot, frozen, task, trigger)
    assert found.message == "d.hinge is to move, but d is frozen"
    assert run(robot, frozen, task, Hold("d.hinge", 0.0)) == ()
    loose = scene_with("d is a hinged_door at kitchen")
    (found,) = run(robot, loose, task, Hold("d.hing", 0.0))
    assert str(found).endswith('no joint "d.hing" in the scene\n    did you mean "d.hinge"?')
    (found,) = run(robot, loose, task, Hold("d.hinge", 2.5))
    assert found.message == "d.hinge is sent to 2.5, outside of its limits"
    (found,) = run(robot, loose, task, Hold("d.hinge", 0.0), Hold("d.hinge", 1.0))
    assert found.message == "d.hinge has two behaviours"
    (found,) = run(robot, loose, task, dataclasses.replace(trigger, of="doorway"))
    assert found.message == "d.hinge measures from its doorway, but d stands in none"


def test_two_objects_of_one_name_are_found():
    scene = scene_with(DOOR)
    twice = dataclasses.replace(scene, objects=scene.objects * 2)
    assert 'there are two objects called "d"' in [d.message for d in check_scene(twice)]


def test_a_joint_that_starts_outside_of_its_limits_is_found():
    scene = scene_with(DOOR)
    wrong = dataclasses.replace(scene.objects[0], initial=(3.0,))
    found = check_scene(dataclasses.replace(scene, objects=(wrong,)))
    assert found[0].message == "d.hinge starts at 3, outside of its limits"
    assert found[0].severity is Severity.ERROR


def test_a_door_that_sweeps_through_a_wall_gives_a_warning(robot):
    # a leaf along the east wall's face turns from the corner into the north wall
    text = "d is a hinged_door at hall, x 4.5 m, y 1.5 m, turned 180 deg"
    scene = scene_with(text)
    (found,) = check_scene(scene)
    assert found.message == "the leaf of d sweeps through hall-wall-1 somewhere in its range"
    assert found.severity is Severity.WARNING
    swing = KeyFrames("d.hinge", (KeyFrame(0, 0.0), KeyFrame(5, 1.5)), Jump())
    (found,) = run(robot, scene, mission((0, 0)), swing)
    assert found.message == "the leaf of d sweeps through hall-wall-1 as it is told to move"
    little = KeyFrames("d.hinge", (KeyFrame(0, 0.0), KeyFrame(5, 0.2)), Jump())
    assert run(robot, scene, mission((0, 0)), little) == ()


def test_a_door_set_in_its_doorway_touches_but_does_not_sweep_through_its_wall():
    for side in ("left", "right"):
        for recess in ("0 cm", "10 cm"):
            scene = scene_with(
                f"d is a hinged_door in kitchen_doorway, hinge {side}, opening inwards, "
                f"recessed {recess}"
            )
            assert check_scene(scene) == ()


def test_the_inscribed_radius_is_that_of_the_narrow_side():
    assert inscribed_radius(((0.3, 0.2), (-0.4, 0.2), (-0.4, -0.2), (0.3, -0.2))) == (
        pytest.approx(0.2)
    )


def test_building_c_with_its_doors_has_no_errors(campaigns, robot):
    folder = campaigns / "ortega2024"
    doors = load_scenery(folder / "doors.scenery")
    scene = compile_scene(load_floorplan(folder / "building_c.fpm"), [doors])
    task, _ = load_mission(folder / "corridor.mission.yaml")
    found = (*check_scene(scene), *check_run(scene, robot, task, ()))
    assert [d for d in found if d.severity is Severity.ERROR] == []


coordinates = st.floats(-9, 9)
positions = st.floats(-4, 4)
motions = st.sampled_from([Jump(), Spring()])
frames = st.lists(st.builds(KeyFrame, st.floats(0, 99), positions), min_size=1, max_size=4).map(
    tuple
)
told = st.lists(
    st.one_of(
        st.builds(Hold, st.sampled_from(["d.hinge", "e.rail", "f.left", "g.h"]), positions),
        st.builds(KeyFrames, st.sampled_from(["d.hinge", "f.right"]), frames, motions),
        st.builds(
            Trigger,
            st.sampled_from(["d.hinge", "e.rail"]),
            positions,
            positions,
            st.floats(0.1, 5),
            motions,
            st.sampled_from(["hinge", "foot", "leaf", "doorway"]),
        ),
    ),
    max_size=4,
)
CROWDED = scene_with(
    DOOR + "\ne is a slider in way_out, sliding left\nf is a lift_door at hall, x 2 m, frozen"
)


@given(st.lists(st.tuples(coordinates, coordinates), max_size=4), coordinates, coordinates, told)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
def test_any_mission_and_any_behaviours_are_checked(robot, points, x, y, behaviours):
    found = run(robot, CROWDED, mission(*points, start=Pose2(x, y, x)), *behaviours)
    assert all(d.message for d in found)
    assert len(set(found)) == len(found)


PERSON = """
mover person
    link body circle radius 25 cm from 0 m to 1.7 m, mass 75 kg
v is a person in hall, x -4 m
"""


def walking(robot, objects, walk, *others):
    task = mission((3, 1.5), start=Pose2(-4, -1.5))
    return texts(run(robot, scene_with(objects), task, walk, *others))


def test_a_walk_through_a_doorway_is_sound(robot):
    task = mission((3, 1.5), start=Pose2(-4, -1.5))
    scene = scene_with(PERSON)
    walk = Walk("v", ((-3, 0), (0.5, 0), (0.5, 4)), 1.0)
    assert run(robot, scene, task, walk) == ()
    assert check_scene(scene) == ()


def test_only_movers_that_are_there_and_free_walk(robot):
    line = ((0.0, 0.0), (1.0, 0.0))
    assert walking(robot, DOOR, Walk("w", line, 1.0))[0].startswith(
        'task.yaml: there is no object "w"'
    )
    assert "an object, not a mover" in walking(robot, DOOR, Walk("d", line, 1.0))[0]
    assert "it is frozen" in walking(robot, PERSON + "v is frozen", Walk("v", line, 1.0))[0]
    twice = walking(robot, PERSON, Walk("v", line, 1.0), Hold("v.x", 0.0))
    assert twice[0] == "task.yaml: v.x has two behaviours\n    one must go"


def test_a_mover_that_stands_in_a_wall_is_found_unless_it_walks(robot):
    scene = scene_with(PERSON.replace("x -4 m", "x -5 m"))
    task = mission((3, 0))
    assert any("starts inside" in text for text in texts(run(robot, scene, task)))
    walk = Walk("v", ((-4, 1), (0, 1)), 1.0)
    assert run(robot, scene, task, walk) == ()


def test_a_thin_mover_in_a_wall_turns_in_no_rebate(robot):
    thin = PERSON.replace("25 cm", "7 cm").replace("x -4 m", "x -5.1 m")
    (text,) = texts(run(robot, scene_with(thin), mission((3, 0))))
    assert "the body of v starts inside of hall-wall-3" in text


def test_a_mover_at_rest_may_be_in_the_way(robot):
    scene = scene_with(PERSON.replace("in hall, x -4 m", "in kitchen, x 0.5 m, y -1.7 m"))
    (found,) = run(robot, scene, mission((0.5, 4)))
    assert found.message == "waypoint w0 cannot be reached while v stands in the way"
    walk = Walk("v", ((0.5, 2.2), (0.5, 4.0)), 1.0)
    assert run(robot, scene, mission((0.5, 4)), walk) == ()


def reacting(robot, event, *others):
    objects = DOOR + "\ne is a hinged_door in way_out, hinge left, opening inwards" + PERSON
    reaction = Reaction("d.hinge", 1.5, 0.0, event, Jump())
    return texts(run(robot, scene_with(objects), mission((3, 0), (4, 0)), reaction, *others))


@pytest.mark.parametrize(
    ("event", "why"),
    [
        (LegBegins(3), "there is no leg 3, mission m has 2"),
        (WaypointReached("w7"), 'mission m has no waypoint "w7"'),
        (JointActs(("f.hinge",), "moves"), 'there is no joint "f.hinge" in the scene'),
    ],
)
def test_events_that_name_what_is_not_there_are_errors(robot, event, why):
    (found,) = reacting(robot, event)
    assert why in found


@pytest.mark.parametrize(
    "event",
    [LegBegins(2), WaypointReached("w1"), JointActs(("e.hinge",), "moves")],
)
def test_events_that_may_come_are_sound(robot, event):
    assert reacting(robot, event) == []


def test_a_trigger_the_robot_never_gets_near_to_gives_a_warning(robot):
    task = mission((3, 0))
    near = Trigger("d.hinge", 1.5, 0.0, 0.1, Servo(), "hinge")
    (found,) = run(robot, scene_with(DOOR), task, near)
    assert found.severity is Severity.WARNING
    assert found.message.startswith("d.hinge never fires: robile gets no nearer to d's hinge than")
    for sound in (
        dataclasses.replace(near, distance=0.5),
        dataclasses.replace(near, to="footprint"),
        dataclasses.replace(near, of="leaf"),
    ):
        assert run(robot, scene_with(DOOR), task, sound) == ()
