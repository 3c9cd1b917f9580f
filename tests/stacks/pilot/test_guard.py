import numpy as np
import pytest

from daemon.stacks.pilot import PilotParameters
from daemon.stacks.pilot.maps import map_field
from daemon.stacks.pilot.motion import CollisionGuard, DriveLimits, hull_of
from daemon.stacks.pilot.sensing import Surroundings
from grammars.model.geometry import Pose2, Twist2
from tests.stacks.pilot.plans import OUTER, SIZE
from tests.stacks.pilot.world import a_robot, draw

ROBOT = a_robot()
PARAMETERS = PilotParameters()
LIMITS = DriveLimits(ROBOT.drive, PARAMETERS)
BODY = hull_of(ROBOT.footprint)
GUARD = CollisionGuard(BODY, map_field(draw(OUTER, SIZE)), LIMITS, PARAMETERS)
MIDDLE = Pose2(4.5, 2.5, 0.0)
FORWARD = Twist2(0.5, 0.0, 0.0)


def seeing(*points):
    """Return surroundings with points that are given in the base frame at ``MIDDLE``."""
    known = np.zeros(len(points), dtype=np.uint8)
    return Surroundings(np.add(np.reshape(points, (-1, 2)), (4.5, 2.5)), known)


def test_edges_measure_distance_to_the_footprint():
    points = np.array([(0.5495, 0.0), (0.0, -0.333), (0.0, 0.0)])
    outside = (points @ BODY.planes[:, :2].T - BODY.planes[:, 2]).max(axis=1)
    np.testing.assert_allclose(outside, [0.2, 0.1, -0.233])


def test_the_rim_has_the_corners_and_no_gaps():
    assert {tuple(corner) for corner in ROBOT.footprint} <= {tuple(p) for p in BODY.rim.tolist()}
    steps = np.linalg.norm(BODY.rim - np.roll(BODY.rim, -1, axis=0), axis=1)
    assert steps.max() <= 0.1 + 1e-9


def test_nothing_around_lets_the_command_through():
    assert GUARD.limit(FORWARD, MIDDLE, seeing()) == FORWARD


def test_an_obstacle_in_the_stop_zone_stops_the_robot():
    assert GUARD.limit(FORWARD, MIDDLE, seeing((0.41, 0.0))).vx < 0.05
    assert GUARD.limit(FORWARD, MIDDLE, seeing((0.36, 0.1))) == Twist2()


def test_the_nearer_the_obstacle_the_slower():
    speeds = [GUARD.limit(FORWARD, MIDDLE, seeing((x, 0.1))).vx for x in (0.5, 0.7, 0.9, 1.4)]
    assert speeds == sorted(speeds)
    assert speeds[0] < 0.2
    assert speeds[-1] == pytest.approx(0.5)


def test_it_can_always_stop_in_time():
    """Braking from the speed it allows ends before the obstacle, wherever that is."""
    for x in np.arange(0.36, 1.5, 0.03):
        speed = GUARD.limit(FORWARD, MIDDLE, seeing((float(x), 0.0))).vx
        assert speed**2 / (2.0 * LIMITS.braking) <= max(0.0, x - 0.3495)


def test_an_obstacle_beside_the_way_slows_but_does_not_stop():
    beside = GUARD.limit(FORWARD, MIDDLE, seeing((0.6, 0.35)))
    assert 0.1 < beside.vx < 0.5
    assert GUARD.limit(FORWARD, MIDDLE, seeing((0.6, 0.7))) == FORWARD


def test_what_touches_the_robot_does_not_keep_it_from_leaving():
    touching = seeing((0.36, 0.0))
    assert GUARD.limit(FORWARD, MIDDLE, touching) == Twist2()
    assert GUARD.limit(Twist2(-0.1, 0.0, 0.0), MIDDLE, touching).vx == pytest.approx(-0.1)


def test_turning_is_stopped_by_what_a_corner_would_hit():
    spin = Twist2(0.0, 0.0, 0.8)
    assert GUARD.limit(spin, MIDDLE, seeing((0.30, 0.25))).wz == pytest.approx(0.0, abs=0.05)
    assert GUARD.limit(spin, MIDDLE, seeing((0.0, 0.5))) == spin


def test_walls_of_the_map_stop_motion_the_laser_does_not_see():
    back_to_the_wall = Pose2(0.2 + 0.3495 + 0.02, 2.5, 0.0)
    assert GUARD.limit(Twist2(-0.3, 0.0, 0.0), back_to_the_wall, seeing()) == Twist2()
    assert GUARD.limit(FORWARD, back_to_the_wall, seeing()).vx > 0.1


def test_accelerations_are_bounded_and_braking_is_harder():
    assert LIMITS.ramp(Twist2(), FORWARD, 0.05).vx == pytest.approx(0.025)
    assert LIMITS.ramp(FORWARD, Twist2(), 0.05).vx == pytest.approx(0.45)


def test_a_way_out_is_free_until_something_is_near():
    back, ahead = Twist2(-0.15, 0.0, 0.0), Twist2(0.15, 0.0, 0.0)
    around = seeing((0.47, 0.0), (-0.6, 0.0))
    assert GUARD.free(back, MIDDLE, around, 2.5) == pytest.approx((0.2505 - 0.02) / 0.15, abs=0.3)
    assert GUARD.free(ahead, MIDDLE, around, 2.5) < 1.0
    assert GUARD.free(back, MIDDLE, seeing(), 2.5) == 2.5


def test_it_knows_the_nearest_thing_that_the_map_does_not_show():
    GUARD.limit(Twist2(), MIDDLE, seeing((0.5495, 0.0), (0.0, -0.5)))
    assert GUARD.nearest == pytest.approx(0.2)
