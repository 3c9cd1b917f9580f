"""Movers, reactions and waiting times become concrete when layers meet a scene."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import (
    Behaviour,
    JointActs,
    KeyFrames,
    LegBegins,
    Reaction,
    Walk,
    WaypointReached,
)
from grammars.model.kinematics import link_poses
from grammars.scenery.composition import RandomWaits, compile_scene
from grammars.text import codec
from tests.languages.plans import PEOPLE, behaviours_of, layer, resolved, scene_with, two_rooms

DOORS = """
a is a hinged_door in kitchen_doorway, hinge right, opening into kitchen
b is a hinged_door in way_out, hinge left, opening inwards
"""
OBJECTS = DOORS + PEOPLE[: PEOPLE.index("visitor walks")]


def one(*sentences):
    (behaviour,) = behaviours_of(OBJECTS, *sentences)
    return behaviour


def test_routes_are_put_into_the_world():
    walk = one("visitor walks along (1 m, 0 m), (1 m, 1 m) of hall, (0 m, 0 m) of kitchen.pillar")
    assert isinstance(walk, Walk)
    assert walk.route[:2] == ((1.0, 0.0), (1.0, 1.0))
    pillar = two_rooms().features[0].frame
    assert walk.route[2] == pytest.approx((pillar.x, pillar.y), abs=1e-9)
    assert (walk.speed, walk.acceleration, walk.manner) == (1.0, 1.0, "once")


def test_a_fixed_facing_is_meant_in_the_frame_of_the_last_point():
    walk = one("visitor walks along (0 m, 0 m), (1 m, 0 m) of hall.walls[1], facing 90 deg")
    assert isinstance(walk, Walk)
    frame = two_rooms().spaces[0].walls[1].frame
    assert math.remainder(walk.yaw - frame.yaw - math.pi / 2, math.tau) == pytest.approx(0.0)


def test_frames_are_kept_only_where_something_walks():
    assert scene_with(DOORS).frames == ()
    frames = dict(scene_with(OBJECTS).frames)
    assert {"hall", "hall.walls[3]", "kitchen.pillar", "kitchen_doorway"} <= set(frames)


def test_a_later_layer_gives_another_walk():
    layers = [
        layer(OBJECTS),
        layer("visitor walks along (0 m, 0 m), (1 m, 0 m)", "first", models=False),
        layer("visitor walks along (0 m, 0 m), (0 m, 1 m)", "second", models=False),
    ]
    result = resolved(compile_scene(two_rooms(), layers), layers)
    (walk,) = result.behaviours
    assert isinstance(walk, Walk)
    assert walk.route[1] == (0.0, 1.0)
    (warning,) = result.overridden
    assert str(warning).startswith("second.scenery:1:1: warning: visitor follows this sentence")
    assert "first.scenery:1:1" in str(warning)
    assert [name for name, _ in result.places] == ["visitor.x", "visitor.y", "visitor.yaw"]


def test_walks_survive_the_way_through_json():
    kinds = tuple[Behaviour, ...]
    behaviours = behaviours_of(
        OBJECTS,
        "visitor walks along (0 m, 0 m), (1 m, 0 m), when leg 1 begins, yielding within 1 m\n"
        "a goes from open to closed when visitor starts to move",
    )
    assert codec.from_plain(kinds, codec.to_plain(behaviours, kinds)) == behaviours


def test_events_become_concrete():
    leg = one("a goes from open to closed when leg 2 begins, after 2 s")
    assert isinstance(leg, Reaction)
    assert (leg.joint, leg.event, leg.delay) == ("a.hinge", LegBegins(2), 2.0)
    assert abs(leg.start) == pytest.approx(1.7)
    reached = one("b goes from open to closed when waypoint home is reached")
    assert isinstance(reached, Reaction)
    assert reached.event == WaypointReached("home")
    fires = one("b goes from open to closed when a fires")
    assert isinstance(fires, Reaction)
    assert fires.event == JointActs(("a.hinge",), "fires")
    moves = one("b goes from open to closed when visitor starts to move")
    assert isinstance(moves, Reaction)
    assert moves.event == JointActs(("visitor.x", "visitor.y", "visitor.yaw"), "moves")


def test_a_mirrored_door_reacts_the_other_way():
    one_side, other = (
        behaviours_of(
            f"d is a hinged_door in kitchen_doorway, hinge {side}, opening into kitchen",
            "d goes from open to closed when leg 1 begins",
        )[0]
        for side in ("left", "right")
    )
    assert isinstance(one_side, Reaction)
    assert isinstance(other, Reaction)
    assert one_side.start == -other.start


def test_furniture_stands_where_it_is_said_to():
    (table,) = [o for o in scene_with(OBJECTS).objects if o.name == "table_1"]
    kitchen = two_rooms().spaces[1].frame
    assert (table.pose.x, table.pose.y) == pytest.approx((kitchen.x + 1.0, kitchen.y + 0.5))
    poses = link_poses(table, table.initial)
    assert poses["foot"] == poses["top"] == table.pose


def test_a_door_with_a_handle_still_fits_its_doorway():
    handled = """
    object office_door
        link post   box 4 cm x 4 cm                   from 0 m to 1.9 m, mass 50 kg
        link leaf   box 4 cm x 88 cm at (0 m, 47 cm)  from 0 m to 1.9 m, mass 15 kg
        link handle box 12 cm x 10 cm at (0 m, 80 cm) from 1 m to 1.05 m, mass 500 g
        joint grip  fixed from leaf to handle
        joint hinge revolute from post to leaf at (-2 cm, 2.5 cm), between 0 deg and 110 deg
        state open: hinge 90 deg
    d is a office_door in kitchen_doorway, hinge left, opening into kitchen, starts open
    """
    (door,) = scene_with(handled).objects
    poses = link_poses(door, door.initial)
    assert poses["handle"] == poses["leaf"] != poses["post"]
    assert abs(door.initial[1]) == pytest.approx(math.pi / 2)


def test_waiting_times_follow_their_distribution():
    for kind, second, mean, spread in (
        ("uniform", 40.0, 25.0, 30.0 / math.sqrt(12)),
        ("exponential", 0.0, 10.0, 10.0),
        ("normal", 2.0, 10.0, 2.0),
    ):
        pauses = RandomWaits(kind, 10.0, second, 5.0, 30_000.0)
        frames = pauses.draw(np.random.SeedSequence(1), 0.0, 1.0)
        waits = np.diff([5.0, *(frame.time for frame in frames[1:])])
        assert np.mean(waits) == pytest.approx(mean, rel=0.1)
        assert np.std(waits) == pytest.approx(spread, rel=0.1)
        assert [f.position for f in frames[:4]] == [0.0, 1.0, 0.0, 1.0]


@given(
    st.sampled_from(
        ["uniform 0 s to 2 s", "exponential with mean 1 s", "normal mean 1 s and deviation 3 s"]
    ),
    st.integers(0, 2**32),
)
def test_changes_are_in_order_and_end_with_the_run(words, seed):
    (frames,) = behaviours_of(
        DOORS, f"a toggles between closed and open after {words} from 3 s until 50 s",
        seed=seed, limit=40.0,
    )  # fmt: skip
    assert isinstance(frames, KeyFrames)
    times = [frame.time for frame in frames.frames]
    assert times[0] == 0.0
    assert all(3.0 <= time <= 40.0 for time in times[1:])
    assert all(b - a >= 0.009 for a, b in itertools.pairwise(times))


def test_a_draw_depends_on_the_name_of_the_joint_alone():
    words = "after exponential with mean 9 s"
    (alone,) = behaviours_of(DOORS, f"a toggles between closed and open {words}")
    both = behaviours_of(DOORS, f"every hinged_door toggles between closed and open {words}")
    assert alone == both[0]
    assert isinstance(both[0], KeyFrames)
    assert isinstance(both[1], KeyFrames)
    assert [f.time for f in both[0].frames] != [f.time for f in both[1].frames]
