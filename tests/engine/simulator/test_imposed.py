"""A base whose velocity is imposed, held to a plain integration a millisecond at a time."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Hold
from grammars.model.geometry import Pose2, Twist2
from grammars.model.robot import Drive, OdometryNoise
from tests.engine.simulator.scenes import ROBOT, door, driven, world

INF = math.inf
DRIVE = Drive(
    "omnidirectional", INF, INF, INF, INF, INF, INF, INF, INF, 0.0, "imposed", 0.0098, 0.047
)
ODOMETRY = OdometryNoise(1.0 / 0.051, 0.0, 0.0, 0.0, 0.051, "mean", "map")
IMPOSED = replace(ROBOT, drive=DRIVE, odometry=ODOMETRY)


def less(value, loss):
    return math.copysign(max(0.0, abs(value) - loss), value)


def euler(start, twist, seconds):
    """Integrate as the planar-move plugin and its physics do: a step of 1 ms after the other."""
    x, y, yaw = start.x, start.y, start.yaw
    for _ in range(round(seconds * 1000)):
        c, s = math.cos(yaw), math.sin(yaw)
        x += less(c * twist.vx - s * twist.vy, 0.0098) * 1e-3
        y += less(s * twist.vx + c * twist.vy, 0.0098) * 1e-3
        yaw += less(twist.wz, 0.047) * 1e-3
    return Pose2(x, y, yaw)


def gap(first, second):
    return math.hypot(first.x - second.x, first.y - second.y)


@given(
    yaw=st.floats(-math.pi, math.pi),
    vx=st.floats(-0.25, 0.25),
    vy=st.sampled_from([0.0, 0.005, -0.11]),
    wz=st.one_of(st.just(0.0), st.floats(-2.75, 2.75)),
)
def test_a_constant_command_is_followed_to_a_millimetre(yaw, vx, vy, wz):
    start, twist = Pose2(0.3, -0.2, yaw), Twist2(vx, vy, wz)
    simulated = world(robot=IMPOSED, start=start)
    simulated.command(twist)
    simulated.advance(1000)
    expected = euler(start, twist, 10.0)
    assert gap(simulated.pose(), expected) < 2e-4
    assert math.remainder(simulated.pose().yaw - expected.yaw, math.tau) == pytest.approx(
        0.0, abs=1e-9
    )


def test_commands_act_at_once_and_hold_without_limit():
    simulated = driven(Twist2(5.0098, -3.0098, 0.0), 1, robot=IMPOSED)
    assert simulated.pose() == Pose2(pytest.approx(0.05), pytest.approx(-0.03), 0.0)
    simulated.advance(999)
    assert simulated.pose().x == pytest.approx(50.0)


def test_the_ground_takes_its_share_along_each_axis_of_the_world():
    simulated = driven(
        Twist2(0.22, 0.0, 0.0), 100, robot=IMPOSED, start=Pose2(0.0, 0.0, math.radians(55.0))
    )
    assert gap(simulated.pose(), Pose2()) == pytest.approx(0.2064, abs=1e-4)
    simulated.command(Twist2(0.0, 0.009, 0.04))
    held = simulated.pose()
    simulated.advance(300)
    assert simulated.pose() == held


def test_the_twist_is_that_of_the_motion():
    simulated = world(robot=replace(IMPOSED, drive=replace(DRIVE, friction_loss=0.0)))
    simulated.command(Twist2(0.2, -0.1, 1.047))
    for _ in range(50):
        simulated.advance(3)
        twist = simulated.twist()
        assert (twist.vx, twist.vy, twist.wz) == pytest.approx((0.2, -0.1, 1.0), abs=1e-9)


def test_limits_and_a_time_out_bind_when_they_are_given():
    drive = replace(DRIVE, max_vx=0.5, timeout=0.1, friction_loss=0.0, kind="differential")
    simulated = driven(Twist2(2.0, 1.0, 0.0), 100, robot=replace(IMPOSED, drive=drive))
    assert simulated.pose() == Pose2(pytest.approx(0.05), pytest.approx(0.0), 0.0)


def facing_a_door(*behaviours):
    """A closed leaf of 1 kg from (1, 0) to (1, 1), which swings away from the robot."""
    leaf = door("d", Pose2(1.0, 0.5, math.pi), mass=1.0)
    return driven(Twist2(0.2298, 0.0, 0.0), 800, leaf, robot=IMPOSED, behaviours=behaviours)


def test_it_pushes_a_free_door_without_slowing_down():
    simulated = facing_a_door()
    assert simulated.pose().x == pytest.approx(0.22 * 8.0, abs=0.01)
    assert simulated.joint_positions()[0] > 0.8
    assert {contact.second for contact in simulated.take_contacts()} == {"d.leaf"}


def test_a_held_door_is_a_wall():
    simulated = facing_a_door(Hold("d.hinge", 0.0))
    assert simulated.pose().x + 0.35 == pytest.approx(1.0 - 0.025, abs=0.002)
    assert simulated.joint_positions()[0] == pytest.approx(0.0, abs=1e-3)


def test_it_stands_where_nothing_is_commanded_even_when_a_door_hits_it():
    leaf = door("d", Pose2(1.0, 0.5, math.pi), 1.5, mass=1.0, stiffness=5.0)
    simulated = world(leaf, robot=IMPOSED, start=Pose2(0.9, 0.0, 0.0))
    simulated.advance(1000)
    assert gap(simulated.pose(), Pose2(0.9, 0.0, 0.0)) < 0.01
    assert [contact.second for contact in simulated.take_contacts()] == ["d.leaf"]
    simulated.command(Twist2(-0.2098, 0.0, 0.0))
    simulated.advance(500)
    assert simulated.pose().x == pytest.approx(-0.1, abs=0.02)


def test_odometry_is_the_true_pose_at_its_own_instant_and_the_mean_twist_before():
    start, twist = Pose2(2.0, 1.0, 0.4), Twist2(0.22, 0.0, 1.0)
    simulated = world(robot=IMPOSED, start=start)
    first = simulated.odometry()
    assert (first.time, first.pose, first.twist) == (0.0, start, Twist2())
    simulated.command(twist)
    before = start
    for k in range(1, 60):
        at = k * 0.051
        simulated.advance(math.ceil(at * 100 - 1e-9) - simulated.tick)
        sample = simulated.odometry(at)
        expected = euler(start, twist, at)
        assert sample.time == pytest.approx(at, abs=1e-12)
        assert gap(sample.pose, expected) < 5e-5
        assert sample.pose.yaw == pytest.approx(math.remainder(expected.yaw, math.tau))
        c, s = math.cos(expected.yaw), math.sin(expected.yaw)
        dx, dy = (expected.x - before.x) / 0.051, (expected.y - before.y) / 0.051
        mean = (c * dx + s * dy, c * dy - s * dx, 1.0 - 0.047)
        assert (sample.twist.vx, sample.twist.vy, sample.twist.wz) == pytest.approx(mean, abs=4e-4)
        before = expected
