"""The guard before collisions, the limits of a drive, and localisation."""

import math

import numpy as np
import pytest

from daemon.model.sut import Odometry
from daemon.stacks.pilot import PilotParameters
from daemon.stacks.pilot.localisation import Localiser, Surroundings
from daemon.stacks.pilot.maps import map_field
from daemon.stacks.pilot.motion import CollisionGuard, DriveLimits, hull_of
from grammars.model.geometry import Pose2, Twist2, wrap_angle
from grammars.model.robot import OdometryNoise
from tests.stacks.pilot.world import DOOR, ONE_DOORWAY, OUTER, SIZE, a_robot, cast, draw, edges

ROBOT = a_robot()
PARAMETERS = PilotParameters()
LIMITS = DriveLimits(ROBOT.drive, PARAMETERS)
BODY = hull_of(ROBOT.footprint)
MIDDLE = Pose2(4.5, 2.5, 0.0)
FORWARD = Twist2(0.5, 0.0, 0.0)


@pytest.fixture(scope="module")
def guard():
    return CollisionGuard(BODY, map_field(draw(OUTER, SIZE)), LIMITS, PARAMETERS)


def seeing(*points):
    """Return surroundings with points that are given in the base frame at ``MIDDLE``."""
    known = np.zeros(len(points), dtype=np.uint8)
    return Surroundings(np.add(np.reshape(points, (-1, 2)), (4.5, 2.5)), known)


def test_the_rim_has_the_corners_and_no_gaps():
    assert {tuple(corner) for corner in ROBOT.footprint} <= {tuple(p) for p in BODY.rim.tolist()}
    steps = np.linalg.norm(BODY.rim - np.roll(BODY.rim, -1, axis=0), axis=1)
    assert steps.max() <= 0.1 + 1e-9


def test_an_obstacle_in_the_stop_zone_stops_the_robot(guard):
    assert guard.limit(FORWARD, MIDDLE, seeing()) == FORWARD
    assert guard.limit(FORWARD, MIDDLE, seeing((0.41, 0.0))).vx < 0.05
    assert guard.limit(FORWARD, MIDDLE, seeing((0.36, 0.1))) == Twist2()
    # The nearest thing that the map does not show, from the footprint.
    guard.limit(Twist2(), MIDDLE, seeing((0.5495, 0.0), (0.0, -0.5)))
    assert guard.nearest == pytest.approx(0.2)


def test_it_can_always_stop_in_time(guard):
    """Braking from the speed it allows ends before the obstacle, wherever that is."""
    for x in np.arange(0.36, 1.5, 0.03):
        speed = guard.limit(FORWARD, MIDDLE, seeing((float(x), 0.0))).vx
        assert speed**2 / (2.0 * LIMITS.braking) <= max(0.0, x - 0.3495)


def test_an_obstacle_beside_the_way_slows_but_does_not_stop(guard):
    beside = guard.limit(FORWARD, MIDDLE, seeing((0.6, 0.35)))
    assert 0.1 < beside.vx < 0.5
    assert guard.limit(FORWARD, MIDDLE, seeing((0.6, 0.7))) == FORWARD


def test_what_touches_the_robot_does_not_keep_it_from_leaving(guard):
    touching = seeing((0.36, 0.0))
    assert guard.limit(FORWARD, MIDDLE, touching) == Twist2()
    assert guard.limit(Twist2(-0.1, 0.0, 0.0), MIDDLE, touching).vx == pytest.approx(-0.1)


def test_turning_is_stopped_by_what_a_corner_would_hit(guard):
    spin = Twist2(0.0, 0.0, 0.8)
    assert guard.limit(spin, MIDDLE, seeing((0.30, 0.25))).wz == pytest.approx(0.0, abs=0.05)
    assert guard.limit(spin, MIDDLE, seeing((0.0, 0.5))) == spin


def test_walls_of_the_map_stop_motion_the_laser_does_not_see(guard):
    back_to_the_wall = Pose2(0.2 + 0.3495 + 0.02, 2.5, 0.0)
    assert guard.limit(Twist2(-0.3, 0.0, 0.0), back_to_the_wall, seeing()) == Twist2()
    assert guard.limit(FORWARD, back_to_the_wall, seeing()).vx > 0.1


def test_accelerations_are_bounded_and_braking_is_harder():
    assert LIMITS.ramp(Twist2(), FORWARD, 0.05).vx == pytest.approx(0.025)
    assert LIMITS.ramp(FORWARD, Twist2(), 0.05).vx == pytest.approx(0.45)


def test_a_way_out_is_free_until_something_is_near(guard):
    back, ahead = Twist2(-0.15, 0.0, 0.0), Twist2(0.15, 0.0, 0.0)
    around = seeing((0.47, 0.0), (-0.6, 0.0))
    assert guard.free(back, MIDDLE, around, 2.5) == pytest.approx((0.2505 - 0.02) / 0.15, abs=0.3)
    assert guard.free(ahead, MIDDLE, around, 2.5) < 1.0
    assert guard.free(back, MIDDLE, seeing(), 2.5) == 2.5


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
