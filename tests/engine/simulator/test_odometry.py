import math
import zlib
from dataclasses import replace

import numpy as np
import pytest

from grammars.model.geometry import Pose2, Twist2, wrap_angle
from grammars.model.robot import OdometryNoise
from tests.engine.simulator.scenes import ROBOT, wall, world


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


def test_a_sample_before_the_first_step_is_the_origin():
    noisy = replace(ROBOT, odometry=OdometryNoise(20.0, 0.1, 0.1, 0.1))
    sample = world(robot=noisy).odometry()
    assert (sample.time, sample.pose, sample.twist) == (0.0, Pose2(), Twist2())


def errors(noise, twist, ticks, every):
    """Odometry pose errors at the end of many runs, in the true frame."""
    rows = []
    for seed in range(150):
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


def test_a_robot_that_stands_has_perfect_odometry():
    noisy = replace(ROBOT, odometry=OdometryNoise(20.0, 0.1, 0.1, 0.1))
    simulated = world(wall("w", 3.0, -1.0, 3.1, 1.0), robot=noisy)
    for _ in range(20):
        simulated.advance(5)
        assert simulated.odometry().pose == Pose2()


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
