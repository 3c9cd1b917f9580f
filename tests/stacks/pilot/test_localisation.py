import math

import numpy as np
import pytest

from daemon.model.sut import Odometry
from daemon.stacks.pilot import PilotParameters
from daemon.stacks.pilot.localisation import Localiser
from daemon.stacks.pilot.maps import map_field
from grammars.model.geometry import Pose2, Twist2, wrap_angle
from grammars.model.robot import OdometryNoise
from tests.stacks.pilot.plans import DOOR, ONE_DOORWAY, SIZE
from tests.stacks.pilot.world import a_robot, cast, draw, drive, edges

ROBOT = a_robot(rays=150)
ANGLES = np.linspace(ROBOT.laser.angle_min, ROBOT.laser.angle_max, 150)


def returns(walls, pose, seed):
    """Noisy ranges at ``pose`` (rays,)."""
    segments = np.vstack([edges(box) for box in walls])
    ranges = cast(segments, pose @ ROBOT.laser.mount, ANGLES, ROBOT.laser.range_max)
    ranges += 0.01 * np.random.default_rng(seed).standard_normal(len(ranges))
    return ranges


def correct(localiser, ranges):
    """Match ranges from where the localiser believes to be."""
    eye = localiser.pose @ ROBOT.laser.mount
    seen, angles = ranges[np.isfinite(ranges)], ANGLES[np.isfinite(ranges)] + eye.yaw
    points = np.column_stack((eye.x + seen * np.cos(angles), eye.y + seen * np.sin(angles)))
    localiser.correct(points, ROBOT.laser)


def a_localiser(start, walls, **parameters):
    field = map_field(draw(walls, SIZE))
    settings = PilotParameters(**parameters)
    return Localiser(field, OdometryNoise(20.0, 0.0, 0.0, 0.0), start, settings)


def error(localiser, truth):
    pose = localiser.pose
    away = math.hypot(pose.x - truth.x, pose.y - truth.y)
    return away, abs(wrap_angle(pose.yaw - truth.yaw))


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("yaw", [-2.5, 0.3, 1.9])
def test_matching_converges_from_an_offset(side, yaw):
    truth = Pose2(2.3, 2.4, yaw)
    told = Pose2(2.3 + 0.2 * side, 2.4 - 0.15, yaw + 0.1 * side)
    localiser = a_localiser(told, ONE_DOORWAY, start_sigma=0.2, start_yaw_sigma=0.1)
    for seed in range(5):
        correct(localiser, returns(ONE_DOORWAY, truth, seed))
    away, turned = error(localiser, truth)
    assert away < 0.0355  # half a cell both ways: these walls are not behind their edge
    assert turned < 0.01


def test_a_door_the_map_does_not_show_does_not_move_the_estimate():
    truth = Pose2(2.9, 1.6, 0.2)
    localiser = a_localiser(truth, ONE_DOORWAY)
    open_leaf = (3.5, 1.05, 4.4, 1.1)
    for seed in range(20):
        correct(localiser, returns([*ONE_DOORWAY, DOOR, open_leaf], truth, seed))
    away, turned = error(localiser, truth)
    assert away < 0.0355
    assert turned < 0.01


def test_odometry_is_extrapolated_beyond_its_last_sample():
    localiser = a_localiser(Pose2(2.0, 2.0, math.pi / 2), ONE_DOORWAY)
    localiser.move(Odometry(0.0, Pose2(), Twist2(0.4)))
    localiser.move_until(0.5)
    assert localiser.pose.y == pytest.approx(2.2)
    localiser.move(Odometry(1.0, Pose2(0.6, 0.0, 0.0), Twist2(0.4)))
    assert localiser.pose.y == pytest.approx(2.6)


def test_uncertainty_grows_with_the_way_and_shrinks_with_a_scan():
    field = map_field(draw(ONE_DOORWAY, SIZE))
    noise = OdometryNoise(20.0, 0.05, 0.05, 0.05)
    truth = Pose2(2.0, 2.4, 0.0)
    localiser = Localiser(field, noise, truth, PilotParameters())
    localiser.move(Odometry(0.0, Pose2(), Twist2()))
    before = localiser.estimate(0.0).covariance
    localiser.move(Odometry(1.0, Pose2(0.5), Twist2()))
    moved = localiser.estimate(1.0).covariance
    correct(localiser, returns(ONE_DOORWAY, Pose2(2.5, 2.4, 0.0), 0))
    matched = localiser.estimate(1.0).covariance
    assert (np.diag(moved) > np.diag(before)).all()
    assert (np.diag(matched) < np.diag(moved)).all()
    np.testing.assert_allclose(matched, matched.T)
    assert (np.linalg.eigvalsh(matched) > 0.0).all()


def inside_two_sigma(log):
    rows = []
    for truth, estimate in log.estimates:
        pose, sigma = estimate.pose, np.sqrt(np.diag(estimate.covariance))
        off = (pose.x - truth.x, pose.y - truth.y, wrap_angle(pose.yaw - truth.yaw))
        rows.append(np.abs(off) <= 2.0 * sigma)
    return np.array(rows)


def test_the_reported_covariance_holds_what_it_promises():
    shares, sigmas = [], []
    for seed in range(3):
        log = drive(ONE_DOORWAY, SIZE, Pose2(1.0, 3.5), [(7.5, 3.5), (1.2, 1.0)], seed=seed)
        assert log.state == "succeeded"
        shares.append(inside_two_sigma(log).mean(axis=0))
        sigmas += [math.sqrt(estimate.covariance[0, 0]) for _, estimate in log.estimates]
    assert (np.mean(shares, axis=0) >= 0.95).all()
    assert np.mean(sigmas) < 0.05
