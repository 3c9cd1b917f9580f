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
from grammars.preflight import check_run, check_scene, places_of
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import Severity, Where
from tests.grammars.plans import layer, scene_with, two_rooms

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


def test_a_waypoint_inside_a_wall_is_found(robot):
    assert texts(run(robot, scene_with(DOOR), mission((3, 2.1)))) == [
        "task.yaml: waypoint w0 is inside of hall-wall-0\n    move it into a room"
    ]


def test_a_waypoint_outside_of_every_room_is_found(robot):
    (found,) = run(robot, scene_with(DOOR), mission((20, 0)))
    assert found.message == "waypoint w0 (20, 0) is outside of every room"


def test_a_waypoint_too_near_to_a_wall_is_found_and_by_how_much(robot):
    assert texts(run(robot, scene_with(DOOR), mission((4.9, 0)))) == [
        "task.yaml: waypoint w0 is 0.10 m from hall-wall-1, robile needs 0.23 m\n"
        "    move it 0.13 m away from the wall"
    ]


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


def test_a_waypoint_without_any_way_is_found(robot):
    closed = two_rooms(
        (
            "in: hall.walls[0] and kitchen.walls[2] translation: x: 0.5 m, z: 1 m",
            "in: hall.walls[1] translation: z: 1 m",
        ),
    )
    (found,) = run(robot, compile_scene(closed), mission((0, 4), (1, 1)))
    assert found.message == "there is no way from the start to waypoint w0"
    assert found.severity is Severity.ERROR


def test_a_doorway_narrower_than_the_robot_is_named_with_both_widths(robot):
    narrow = two_rooms(("width=1 m, height=2 m", "width=0.4 m, height=2 m"))
    assert texts(run(robot, compile_scene(narrow), mission((0, 4)))) == [
        "task.yaml: the way to waypoint w0 leads through kitchen_doorway (0.40 m), "
        "robile is 0.47 m wide\n    widen the doorway or take a narrower robot"
    ]


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


def test_a_gap_that_is_no_doorway_can_be_too_narrow(robot):
    pinched = two_rooms(
        (
            "shape: Rectangle width=0.3 m, length=0.3 m",
            "shape: Rectangle width=3.6 m, length=0.1 m",
        ),
        ("translation: x: 1 m, y: 0.5 m", "translation: x: 0 m, y: 0.5 m"),
    )
    (found,) = run(robot, compile_scene(pinched), mission((0, 5)))
    assert found.message == "the way to waypoint w0 is too narrow, robile is 0.47 m wide"


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


def test_a_frozen_door_blocks_like_a_wall_that_may_be_meant(robot):
    (found,) = run(robot, scene_with(DOOR + ", frozen"), mission((0.5, 4)))
    assert found.severity is Severity.WARNING


def test_doors_that_block_together_are_not_blamed_one_by_one(robot):
    both = DOOR + ", frozen\n" + DOOR.replace("d is", "e is").replace("left", "right") + ", frozen"
    (found,) = run(robot, scene_with(both), mission((0.5, 4)))
    assert found.message == "waypoint w0 cannot be reached while d and e stay as told"


def test_more_than_three_doors_in_the_way_are_counted(robot):
    names = [f"d{i}" for i in range(5)]
    doors = "".join(DOOR.replace("d is", f"{n} is").strip() + ", frozen\n" for n in names)
    (found,) = run(robot, scene_with(doors), mission((0.5, 4)))
    assert found.message == "waypoint w0 cannot be reached while d0, d1, d2 and 2 more stay as told"


def test_a_waypoint_beside_a_standing_object_leaves_no_room(robot):
    table = "object table link top box 1 m x 1 m from 0 m to 0.8 m, mass 9 kg\nt is a table at hall"
    found = run(robot, scene_with(table), mission((-3, 0.1), start=Pose2(3.0, 0.0)))
    assert found == ()
    (near,) = run(robot, scene_with(table), mission((-0.6, 0.1), start=Pose2(3.0, 0.0)))
    assert near.message == "waypoint w0 leaves no room for robile"
    (start,) = run(robot, scene_with(table), mission((3, 0)))
    assert start.message == "the start leaves no room for robile"


def test_a_waypoint_under_a_moving_leaf_gives_a_warning(robot):
    scene = scene_with(DOOR)
    low, high = scene.objects[0].joints[0].lower, scene.objects[0].joints[0].upper
    swing = KeyFrames("d.hinge", (KeyFrame(0, low), KeyFrame(9, high)), Jump())
    (found,) = run(robot, scene, mission((0.4, 2.9)), swing)
    assert found.message == "d sweeps over waypoint w0"


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


def test_a_door_that_starts_in_a_wall_is_found_with_its_place():
    doors = layer("d is a hinged_door at hall.walls[0], x -3 m, y 0.1 m, turned -90 deg")
    scene = compile_scene(two_rooms(), [doors])
    (found,) = check_scene(scene, places=places_of([doors]))
    assert found.message == "the leaf of d starts inside of hall-wall-0"
    assert found.where.file == "objects.scenery"
    assert found.severity is Severity.ERROR


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


def test_two_doors_that_meet_give_one_warning():
    scene = scene_with(DOOR + "\ne is a hinged_door at kitchen, x 0.2 m, y -0.9 m")
    (found,) = check_scene(scene)
    assert found.message == "d and e can run into each other somewhere in its range"


def test_a_door_set_in_its_doorway_touches_but_does_not_sweep_through_its_wall():
    for side in ("left", "right"):
        for recess in ("0 cm", "10 cm"):
            scene = scene_with(
                f"d is a hinged_door in kitchen_doorway, hinge {side}, opening inwards, "
                f"recessed {recess}"
            )
            assert check_scene(scene) == ()


def test_an_entryway_that_forgets_a_wall_gives_a_warning():
    one = two_rooms(("in: hall.walls[0] and kitchen.walls[2]", "in: hall.walls[0]"))
    (found,) = check_scene(compile_scene(one), places=places_of([], one))
    assert found.where.file == "two_rooms.fpm"
    assert found.message == "kitchen_doorway is closed by kitchen-wall-2"
    assert found.severity is Severity.WARNING


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
TABLE = """
object table
    link top box 1 m x 1 m from 0 m to 0.7 m, mass 9 kg
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


def test_a_route_through_a_wall_is_found(robot):
    assert walking(robot, PERSON, Walk("v", ((-1, 0), (-1, 4)), 1.0)) == [
        "task.yaml: v walks through hall-wall-0 and kitchen-wall-2\n"
        "    lead the route through a doorway"
    ]


def test_points_in_walls_and_outside_are_found_with_their_number(robot):
    assert walking(robot, PERSON, Walk("v", ((-1, 2.1), (9, 9), (1, 0)), 1.0)) == [
        "task.yaml: point 1 of the route of v (-1, 2.1) is inside of hall-wall-0\n    move it",
        "task.yaml: point 2 of the route of v (9, 9) is outside of every room\n"
        "    check its frame and the signs of x and y",
    ]


def test_a_mover_that_brushes_a_wall_or_a_table_gives_a_warning(robot):
    walk = Walk("v", ((-3, 1.9), (3, 1.9)), 1.0)
    brush, meet = run(
        robot, scene_with(PERSON + TABLE + "t is a table in hall, y 1.2 m"),
        mission((3, -1.5), start=Pose2(-4, -1.5)), walk,
    )  # fmt: skip
    assert brush.severity is meet.severity is Severity.WARNING
    assert brush.message == "v brushes hall-wall-0 on its way"
    assert meet.message == "v walks through t on its way"


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


def test_a_mover_at_rest_may_be_in_the_way(robot):
    scene = scene_with(PERSON.replace("in hall, x -4 m", "in kitchen, x 0.5 m, y -1.7 m"))
    (found,) = run(robot, scene, mission((0.5, 4)))
    assert found.message == "waypoint w0 cannot be reached while v stands in the way"
    walk = Walk("v", ((0.5, 2.2), (0.5, 4.0)), 1.0)
    assert run(robot, scene, mission((0.5, 4)), walk) == ()


def test_furniture_in_a_wall_gives_a_warning():
    (found,) = check_scene(scene_with(TABLE + "t is a table in hall, y 1.8 m"))
    assert (found.severity, found.message) == (
        Severity.WARNING,
        "t stands in hall-wall-0 and kitchen-wall-2",
    )


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


def test_an_event_that_never_comes_gives_a_warning(robot):
    fires, moves = JointActs(("e.hinge",), "fires"), JointActs(("e.hinge",), "moves")
    (found,) = reacting(robot, fires)
    assert found.startswith(
        "task.yaml: warning: d.hinge waits for e.hinge to fire, which never happens"
    )
    assert reacting(robot, moves, Hold("e.hinge", 0.0)) != []
    assert reacting(robot, JointActs(("v.x", "v.y"), "moves")) != []
    walk = Walk("v", ((-4, -1), (-2, -1)), 1.0, event=LegBegins(1))
    assert reacting(robot, JointActs(("v.x", "v.y"), "moves"), walk) == []


def test_doors_that_wait_for_each_other_wait_for_ever(robot):
    other = Reaction("e.hinge", -1.5, 0.0, JointActs(("d.hinge",), "fires"), Jump())
    found = reacting(robot, JointActs(("e.hinge",), "fires"), other)
    assert len(found) == 2


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


def test_a_trigger_behind_a_held_door_never_fires(robot):
    objects = f"{DOOR}\ne is a hinged_door at kitchen, x -1 m"
    trigger = Trigger("e.hinge", 0.0, 1.0, 1.0, Servo())
    assert run(robot, scene_with(objects), mission((3, 0)), trigger) == ()
    (found,) = run(robot, scene_with(objects), mission((3, 0)), trigger, Hold("d.hinge", 0.0))
    assert "e.hinge never fires" in found.message
