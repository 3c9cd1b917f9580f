import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Hold, KeyFrame, KeyFrames, Servo
from grammars.model.geometry import Pose2, Twist2
from grammars.model.kinematics import link_poses
from grammars.model.scene import Joint, Link, SceneObject
from tests.engine.simulator.scenes import box, door, driven, folding, sliding_door, wall, world

AHEAD = Pose2(1.0, 0.5, math.pi)
"""A closed door across the robot's way, opening away from it."""


@pytest.mark.parametrize(
    ("part", "behaviours", "rest", "stops"),
    [
        (door("d", Pose2(1.0, -0.5, 0.0)), (), 0.0, 0.975),
        (door("d", AHEAD), (Hold("d.hinge", 0.0),), 0.0, 0.975),
        (door("d", AHEAD, initial=0.4, frozen=True), (), 0.4, 1.173),
    ],
    ids=["opens the other way", "held", "frozen"],
)
def test_a_door_that_does_not_give_way_stops_the_robot(part, behaviours, rest, stops):
    simulated = driven(Twist2(0.5, 0.0, 0.0), 500, part, behaviours=behaviours)
    assert simulated.joint_positions()[0] == pytest.approx(rest, abs=0.01)
    assert simulated.joint_states()[1][0] == pytest.approx(0.0, abs=0.01)
    assert simulated.pose().x + 0.35 == pytest.approx(stops, abs=0.01)
    assert simulated.take_contacts()[0].second == "d.leaf"


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


def test_dry_friction_stops_a_swinging_door():
    simulated = driven(Twist2(0.3, 0.0, 0.0), 250, door("d", AHEAD, friction=4.0))
    simulated.command(Twist2(-0.5, 0.0, 0.0))
    simulated.advance(200)
    rest = simulated.joint_positions()[0]
    simulated.advance(200)
    assert 0.1 < rest < 1.9
    assert simulated.joint_positions()[0] == pytest.approx(rest, abs=1e-6)


def test_a_closer_shuts_the_door_behind_the_robot():
    simulated = world(door("d", AHEAD, initial=1.5, stiffness=10.0, damping=15.0))
    simulated.advance(100)
    assert 0.3 < simulated.joint_positions()[0] < 1.2
    assert simulated.joint_states()[1][0] < -0.1
    simulated.advance(2000)
    assert simulated.joint_positions()[0] == pytest.approx(0.0, abs=0.01)


def test_a_sliding_door_moves_along_its_rail_only():
    simulated = driven(
        Twist2(0.0, 0.3, 0.0), 100, sliding_door("s", Pose2(0.6, 0.1, 0.0), initial=0.3)
    )
    assert simulated.joint_positions()[0] == pytest.approx(0.3, abs=1e-9)
    pushed = driven(Twist2(0.0, 0.3, 0.0), 800, sliding_door("s", Pose2(0.0, 0.5, 0.0)))
    assert pushed.joint_positions()[0] == pytest.approx(1.0, abs=0.01)
    assert pushed.pose().y == pytest.approx(1.5 - 0.233, abs=0.01)


def test_a_sliding_door_resists_being_pushed_across():
    simulated = driven(
        Twist2(0.5, 0.0, 0.0), 600, sliding_door("s", Pose2(1.0, -0.5, 0.0), friction=20.0)
    )
    assert simulated.pose().x + 0.35 == pytest.approx(0.975, abs=0.01)
    assert simulated.joint_positions()[0] == pytest.approx(0.0, abs=0.01)


def test_a_leaf_passes_through_walls_beside_it():
    jamb = wall("jamb", 0.9, 0.45, 1.3, 3.0)
    simulated = driven(Twist2(0.4, -0.1, 0.0), 400, door("d", AHEAD), jamb)
    assert simulated.joint_positions()[0] > 1.0


def test_leaves_of_two_doors_push_each_other():
    first = door("a", Pose2(1.0, 0.5, math.pi))
    second = door("b", Pose2(1.5, 0.45, math.pi))
    simulated = driven(Twist2(0.3, 0.0, 0.0), 400, first, second)
    a, b = simulated.joint_positions()
    assert a > 0.3
    assert b > 0.05


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


def test_a_link_on_a_held_joint_is_part_of_what_it_hangs_on():
    simulated = driven(
        Twist2(0.4, 0.0, 0.0),
        200,
        folding("f", Pose2(1.0, -0.5, 0.2)),
        behaviours=(Hold("f.fold", 1.2),),
    )
    fold, root = simulated.joint_positions()
    assert fold == 1.2
    assert abs(root) > 0.05


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


def test_sleeping_doors_do_not_change_the_outcome():
    def drive(sleep):
        simulated = world(door("d", Pose2(2.5, 0.5, math.pi), friction=0.5))
        simulated._space.sleep_time_threshold = sleep
        simulated.command(Twist2(0.5, 0.0, 0.0))
        simulated.advance(900)
        return simulated.pose(), simulated.joint_positions().tolist()

    (pose, positions), (other_pose, other_positions) = drive(0.5), drive(math.inf)
    assert (pose.x, pose.y, pose.yaw) == pytest.approx(
        (other_pose.x, other_pose.y, other_pose.yaw), abs=1e-3
    )
    assert positions == pytest.approx(other_positions, abs=1e-2)
