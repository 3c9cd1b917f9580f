"""Bases and movers against plain integrations and formulas: their ways and their odometry."""

import math
import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.simulator._walkers import RouteFollower
from grammars.model.behaviour import Walk
from grammars.model.geometry import Pose2, Twist2, wrap_angle
from grammars.model.kinematics import link_poses
from grammars.model.robot import OdometryNoise
from tests.engine.simulator.scenes import (
    FAR,
    IMPOSED,
    LINE,
    ROBOT,
    box,
    differential,
    driven,
    person,
    true_ranges,
    wall,
    world,
)


@pytest.mark.parametrize(("robot", "deepest"), [(ROBOT, 0.01), (IMPOSED, 0.025)])
@given(
    yaw=st.floats(-math.pi, math.pi),
    vx=st.floats(-1.0, 1.0), vy=st.floats(-1.0, 1.0), wz=st.floats(-2.75, 2.75),
)  # fmt: skip
def test_no_kind_of_base_leaves_a_room_of_thin_walls(robot, deepest, yaw, vx, vy, wz):
    thin = 0.05
    simulated = world(
        wall("e", 1.0, -1.0, 1.0 + thin, 1.0), wall("w", -1.0 - thin, -1.0, -1.0, 1.0),
        wall("n", -1.0, 1.0, 1.0, 1.0 + thin), wall("s", -1.0, -1.0 - thin, 1.0, -1.0),
        robot=robot, start=Pose2(0.0, 0.0, yaw),
    )  # fmt: skip
    simulated.command(Twist2(vx, vy, wz))
    for _ in range(30):
        simulated.advance(20)
        corners = simulated.pose().apply_ring(ROBOT.footprint)
        assert all(max(abs(x), abs(y)) < 1.0 + deepest for x, y in corners)


def test_a_steady_turn_is_a_circle():
    simulated = driven(Twist2(0.5, 0.0, 0.5), 200, robot=differential())
    begin = simulated.pose()
    centre = begin.apply((0.0, 1.0))
    for _ in range(100):
        simulated.advance(13)
        pose = simulated.pose()
        assert math.hypot(pose.x - centre[0], pose.y - centre[1]) == pytest.approx(1.0, abs=1e-4)
        assert abs(simulated.twist().vy) < 1e-6


def test_commands_that_are_not_numbers_are_refused():
    with pytest.raises(ValueError, match="finite"):
        world().command(Twist2(math.nan, 0.0, 0.0))


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
    simulated.advance(300)
    expected = euler(start, twist, 3.0)
    assert gap(simulated.pose(), expected) < 2e-4
    assert math.remainder(simulated.pose().yaw - expected.yaw, math.tau) == pytest.approx(
        0.0, abs=1e-9
    )


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


def test_odometry_without_noise_is_the_true_motion_from_the_start():
    start = Pose2(3.0, -2.0, 2.5)
    simulated = world(start=start)
    simulated.command(Twist2(0.5, 0.2, 0.3))
    for _ in range(100):
        simulated.advance(5)
        sample = simulated.odometry()
        truth = start.inverse() @ simulated.pose()
        assert sample.pose == truth
        assert sample.twist == simulated.twist()
        assert sample.time == simulated.time


def test_a_robot_that_stands_has_perfect_odometry():
    noisy = replace(ROBOT, odometry=OdometryNoise(20.0, 0.1, 0.1, 0.1))
    simulated = world(wall("w", 3.0, -1.0, 3.1, 1.0), robot=noisy)
    for _ in range(20):
        simulated.advance(5)
        assert simulated.odometry().pose == Pose2()


def errors(noise, twist, ticks, every):
    """Odometry pose errors at the end of many runs, in the true frame."""
    rows = []
    for seed in range(80):
        simulated = world(robot=replace(ROBOT, odometry=noise), seed=seed)
        simulated.command(twist)
        for _ in range(ticks // every):
            simulated.advance(every)
            sample = simulated.odometry()
        error = simulated.pose().inverse() @ sample.pose
        rows.append((error.x, error.y, error.yaw))
    return np.array(rows)


@pytest.mark.parametrize("every", [5, 25])
def test_noise_grows_with_the_root_of_the_way_at_any_rate(every):
    noise = OdometryNoise(20.0, 0.03, 0.0, 0.0)
    spread = errors(noise, Twist2(0.5, 0.0, 0.0), 400, every).std(axis=0)
    assert spread[0] == pytest.approx(0.03 * math.sqrt(1.87), rel=0.2)
    assert spread[1:] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_driving_straight_drifts_and_turning_errs_in_yaw():
    straight = errors(OdometryNoise(20.0, 0.0, 0.0, 0.02), Twist2(0.5, 0.0, 0.0), 300, 5)
    assert straight[:, 2].std() == pytest.approx(0.02 * math.sqrt(1.37), rel=0.2)
    turning = errors(OdometryNoise(20.0, 0.0, 0.05, 0.0), Twist2(0.0, 0.0, 1.0), 300, 5)
    assert turning[:, 2].std() == pytest.approx(0.05 * math.sqrt(2.87), rel=0.2)
    assert turning[:, :2].std() == pytest.approx(0.0, abs=1e-9)


def test_the_errors_are_two_normal_numbers_a_sample_from_one_stream():
    """However many are drawn at a time: the second of each sample is seen in the yaw."""
    noise = OdometryNoise(20.0, 0.05, 0.03, 0.02)
    simulated = world(robot=replace(ROBOT, odometry=noise))
    one_by_one = np.random.Generator(np.random.PCG64(_stream_of("odometry")))
    simulated.command(Twist2(0.5, 0.0, 0.1))
    truth, last = Pose2(), Pose2()
    for _ in range(300):
        simulated.advance(5)
        turning = one_by_one.standard_normal(2)[1]
        before, truth = truth, simulated.pose()
        sample = simulated.odometry()
        dx, dy, turn = truth.x - before.x, truth.y - before.y, truth.yaw - before.yaw
        error = turning * math.sqrt(0.03**2 * abs(turn) + 0.02**2 * math.hypot(dx, dy))
        assert wrap_angle(sample.pose.yaw - last.yaw) == pytest.approx(turn + error, abs=1e-12)
        last = sample.pose


def _stream_of(name):
    return np.random.SeedSequence(7, spawn_key=(zlib.crc32(name.encode()),))


def body_at(now, who):
    return link_poses(who, now.joint_positions().tolist()[:3])["body"]


def trapezoid(time, length, speed, acceleration):
    """The way after ``time`` from rest to rest, written down independently."""
    speed = min(speed, math.sqrt(length * acceleration))
    ramp = speed / acceleration
    end = length / speed + ramp
    time = min(max(time, 0.0), end)
    if time < ramp:
        return 0.5 * acceleration * time**2
    if time > end - ramp:
        return length - 0.5 * acceleration * (end - time) ** 2
    return speed * (time - ramp / 2)


@pytest.mark.parametrize("start", [0.0, 1.234])
def test_a_walk_is_an_exact_function_of_time(start):
    who = person(pose=Pose2(1.0, -2.0, 0.7))
    now = world(who, start=FAR, behaviours=(replace(LINE, start=start),))
    for _ in range(110):
        pose = body_at(now, who)
        assert pose.x == pytest.approx(-3 + trapezoid(now.time - start, 6.0, 0.8, 1.0), abs=1e-9)
        assert pose.y == pytest.approx(0.0, abs=1e-9)
        assert pose.yaw == pytest.approx(0.0, abs=1e-9)
        now.advance(10)
    assert [e.text for e in now.take_events()] == ["sets out", "has arrived"]


@given(st.floats(0.2, 3.0), st.floats(0.2, 5.0), st.floats(0.0, 3.0), st.floats(0.3, 9.0))
def test_back_and_forth_repeats_itself(speed, acceleration, pause, length):
    walk = Walk("v", ((0.0, 0.0), (length, 0.0)), speed, acceleration, "back-and-forth", pause)
    follower = RouteFollower(walk)
    top = min(speed, math.sqrt(length * acceleration))
    there = length / top + top / acceleration
    rest = max(pause, 1.0)  # turning round takes a second
    for time in np.linspace(0.0, 3 * (there + rest), 200).tolist():
        trip, since = divmod(time, there + rest)
        way = trapezoid(since, length, speed, acceleration)
        expected = way if int(trip) % 2 == 0 else length - way
        assert follower.at(time)[0] == pytest.approx(expected, abs=1e-6 + 1e-9 * length)


def test_a_round_goes_on_without_stopping_and_turns_with_the_way():
    square = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
    follower = RouteFollower(Walk("v", square, 1.0, 1.0, "round"))
    samples = np.array([follower.at(t) for t in np.arange(0.0, 40.0, 0.01)])
    steps = np.diff(samples, axis=0)
    assert np.hypot(steps[:, 0], steps[:, 1])[110:].min() > 0.007  # corners are cut, not stopped at
    assert np.abs(steps[:, 2]).max() < 0.03  # no jump of the heading
    assert samples[-1, 2] == pytest.approx(math.tau * 39.5 / 8, abs=math.pi / 2)


def test_a_round_may_pause_at_every_point():
    square = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
    follower = RouteFollower(Walk("v", square, 1.0, 1.0, "round", 1.0, "points"))
    for corner in range(9):  # three seconds on the way, one at rest
        assert follower.at(4.0 * corner + 3.5)[:2] == pytest.approx(square[(corner + 1) % 4])
    yaws = [follower.at(t)[2] for t in np.arange(36.0, 90.0, 0.05)]
    assert np.abs(np.diff(yaws)).max() < 0.2


def test_who_walks_sideways_keeps_its_heading_on_the_way_back():
    follower = RouteFollower(replace(LINE, manner="back-and-forth", facing="sideways"))
    assert {follower.at(t)[2] for t in np.arange(0.0, 20.0, 0.1)} == {math.pi / 2}
    follower = RouteFollower(replace(LINE, manner="back-and-forth", facing="fixed", yaw=0.3))
    assert {follower.at(t)[2] for t in np.arange(0.0, 20.0, 0.1)} == {0.3}


def test_the_laser_sees_a_mover_where_it_is():
    who = person(ring=box(-0.2, -0.2, 0.2, 0.2))
    now = world(who, wall("wall", 6.0, -9.0, 6.2, 9.0), behaviours=(replace(LINE, start=2.0),),
                start=Pose2(-5.0, 0.0, 0.0))  # fmt: skip
    ranges = true_ranges(now)
    middle = len(ranges) // 2
    assert ranges[middle] == pytest.approx(5.0 - 3.0 - 0.2 - 0.3)
    now.advance(500)
    ranges = true_ranges(now)
    way = trapezoid(3.0, 6.0, 0.8, 1.0)
    assert ranges[middle] == pytest.approx(5.0 - 3.0 - 0.2 - 0.3 + way)
