"""Doors and their joints against plain formulas, kinematics, shapely and published figures."""

import math
from dataclasses import replace

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Jump, KeyFrame, KeyFrames, Servo, Spring, Trigger
from grammars.model.geometry import Pose2, Twist2
from grammars.model.kinematics import link_poses
from grammars.model.scene import Doorway, Joint, Link, SceneObject
from tests.engine.simulator.scenes import (
    ROBOT,
    box,
    door,
    folding,
    sliding_door,
    world,
)

AHEAD = Pose2(1.0, 0.5, math.pi)
"""A closed door across the robot's way, opening away from it."""


@given(speed=st.floats(0.2, 1.0), offset=st.floats(-0.2, 0.4), mass=st.floats(1.0, 40.0))
def test_limits_hold_however_a_door_is_pushed(speed, offset, mass):
    simulated = world(door("d", AHEAD, mass=mass), start=Pose2(0.0, offset, 0.0))
    simulated.command(Twist2(speed, 0.0, 0.0))
    for _ in range(80):
        simulated.advance(5)
        assert -0.05 < simulated.joint_positions()[0] < 2.15  # one tick of a fast swing
    simulated.command(Twist2())
    simulated.advance(400)
    # The robot stands where it was told to stop and may still lean on the door: speed 0.336,
    # offset 0.314, 2 kg leaves it 1.8 mrad beyond its limit.
    assert simulated.joint_positions()[0] < 2.005


def test_a_chain_of_joints_folds_when_pushed_and_agrees_with_kinematics():
    item = folding("f", Pose2(1.0, -0.5, 0.2))
    simulated = world(item)
    assert simulated.joint_names == ("f.fold", "f.root")
    assert simulated.joint_positions().tolist() == pytest.approx([0.3, 0.0])
    simulated.command(Twist2(0.4, 0.0, 0.0))
    simulated.advance(300)
    positions = simulated.joint_positions()
    assert abs(positions[1]) > 0.1
    poses = link_poses(item, positions.tolist())
    slots = {p.owner: p.slot for p in simulated._assembly.placements}
    table = simulated._bodies.at(simulated.tick)
    for name, pose in poses.items():
        row = table[slots[f"f.{name}"]]
        assert row[:2].tolist() == pytest.approx([pose.x, pose.y], abs=0.01)
        assert math.remainder(row[2] - pose.yaw, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_velocities_are_the_rate_of_positions():
    simulated = world(
        door("d", AHEAD), sliding_door("s", Pose2(1.8, -1.5, 0.0)), folding("f", Pose2(2.6, -0.4))
    )
    simulated.command(Twist2(0.6, 0.0, 0.0))
    moved, exact = set(), 0
    for _ in range(500):
        before = simulated.joint_positions()
        velocity = simulated.joint_states()[1]
        simulated.advance(1)
        rate = (simulated.joint_positions() - before) / 0.01
        # Only while Chipmunk pushes penetrating bodies apart is there motion without velocity.
        assert rate == pytest.approx(velocity, abs=0.3)
        exact += rate == pytest.approx(velocity, abs=1e-3)
        moved |= {i for i in range(4) if abs(velocity[i]) > 0.1}
    assert {0, 2, 3} <= moved
    assert exact > 300


def test_the_velocity_of_what_slides_on_a_turning_leaf_is_its_own():
    # The drawer is heavy beside its rail, so that its centre turns with the leaf at another speed.
    leaf = Link("leaf", (box(-0.02, 0.0, 0.02, 0.9),), 8.0, 0.0, 2.0)
    drawer = Link("drawer", (box(0.1, 0.2, 0.5, 0.4),), 3.0, 0.0, 2.0)
    hinge = Joint("hinge", "revolute", "world", "leaf", (0.0, 0.0), (0.0, 0.0), -2.0, 2.0)
    rail = Joint("rail", "prismatic", "leaf", "drawer", (0.0, 0.0), (0.6, 0.8), -0.5, 0.5)
    cabinet = SceneObject(
        "c", "cabinet", Pose2(3.0, 1.0, 0.7), (leaf, drawer), (hinge, rail), (0.0, 0.0)
    )
    swing = KeyFrames("c.hinge", (KeyFrame(0.0, 0.0), KeyFrame(0.1, 1.5)), Servo(1.5, 400.0))
    simulated = world(cabinet, behaviours=(swing,))
    simulated.advance(20)
    slid = 0.0
    for _ in range(60):
        before = simulated.joint_positions()
        simulated.advance(1)
        now, velocity = simulated.joint_positions(), simulated.joint_states()[1]
        assert (now - before) * 100.0 == pytest.approx(velocity, abs=0.02)
        slid = max(slid, abs(velocity[1]))
    assert slid > 0.1


coordinates = st.floats(-5.0, 5.0).map(lambda v: round(v, 6))
poses = st.builds(Pose2, coordinates, coordinates, st.floats(-3.0, 3.0))
WAY = box(2.9, 0.5, 3.1, 1.5)


@given(at=poses, start=poses, of=st.sampled_from(["hinge", "foot", "leaf", "doorway"]))
def test_a_trigger_measures_from_what_it_names(at, start, of):
    item = door("d", at, doorway="way")
    things = {
        "hinge": shapely.Point(at.apply((-0.025, 0.025))),
        "foot": shapely.Point(at.x, at.y),
        "leaf": shapely.Polygon(at.apply_ring(item.links[1].polygons[0])),
        "doorway": shapely.Polygon(WAY).centroid,
    }
    robot = {
        "base": shapely.Point(start.x, start.y),
        "footprint": shapely.Polygon(start.apply_ring(ROBOT.footprint)),
    }
    for to, outline in robot.items():
        trigger = Trigger("d.hinge", 0.0, 1.4, 30.0, Jump(), of=of, to=to)
        doorway = Doorway("way", Pose2(3.0, 0.0, 0.0), WAY, 1.0, 0.0, 2.0)
        simulated = world(item, doorway, start=start, behaviours=(trigger,))
        simulated.advance(1)
        event = simulated.take_events()[0]
        expected = shapely.distance(things[of], outline)
        assert float(event.text.split()[2]) == pytest.approx(expected, abs=6e-4)


def swing(pieces, mass):
    """The angle of a leaf of these pieces, drawn to 1.4 rad by a spring, at every tick."""
    item = door("d", Pose2(5.0, 0.0, 0.0), mass=mass)
    post, leaf = item.links
    item = replace(item, links=(post, replace(leaf, polygons=pieces)))
    spring = KeyFrames("d.hinge", (KeyFrame(0.0, 0.0), KeyFrame(0.05, 1.4)), Spring(2.0))
    simulated = world(item, behaviours=(spring,))
    for _ in range(150):
        simulated.advance(1)
        yield float(simulated.joint_positions()[0])


def test_a_leaf_in_pieces_swings_like_the_leaf_in_one_and_as_its_inertia_says():
    whole = box(-0.025, 0.035, 0.025, 0.965)
    pieces = box(-0.025, 0.035, 0.025, 0.4), box(-0.025, 0.4, 0.025, 0.965)[::-1]
    angles = list(swing((whole,), 10.0))
    assert list(swing(pieces, 10.0)) == pytest.approx(angles, abs=1e-6)
    # A beam about its hinge, 0.475 m along and 0.025 m beside its middle.
    inertia = 10.0 * ((0.93**2 + 0.05**2) / 12.0 + 0.475**2 + 0.025**2)
    for tick, angle in enumerate(angles[:100], start=1):
        turned = 1.4 * (1.0 - math.cos(math.sqrt(2.0 / inertia) * max(0.0, tick / 100 - 0.05)))
        assert angle == pytest.approx(turned, abs=0.02)
