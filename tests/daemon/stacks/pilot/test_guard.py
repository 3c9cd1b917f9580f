import math

import numpy as np
import pytest

from daemon.stacks.pilot import PilotParameters
from daemon.stacks.pilot.guard import (
    CollisionGuard,
    Surroundings,
    find_escape,
    half_planes,
    outline,
)
from daemon.stacks.pilot.map_field import map_field
from daemon.stacks.pilot.pursuit import DriveLimits
from grammars.model.geometry import Pose2, Twist2
from tests.daemon.stacks.pilot.plans import OUTER, SIZE
from tests.daemon.stacks.pilot.world import a_robot, draw

ROBOT = a_robot()
PARAMETERS = PilotParameters()
LIMITS = DriveLimits.of(ROBOT.drive, PARAMETERS)
GUARD = CollisionGuard(ROBOT, map_field(draw(OUTER, SIZE)), LIMITS, PARAMETERS)
MIDDLE = Pose2(4.5, 2.5, 0.0)
FORWARD = Twist2(0.5, 0.0, 0.0)


def seeing(*points, known=False):
    shown = np.full(len(points), known, dtype=np.uint8)
    return Surroundings(np.array(points).reshape(-1, 2), shown, len(points), len(points))


def test_half_planes_measure_distance_to_the_footprint():
    points = np.array([(0.5495, 0.0), (0.0, -0.333), (0.0, 0.0)])
    for ring in (ROBOT.footprint, ROBOT.footprint[::-1]):
        planes = half_planes(ring)
        outside = (points @ planes[:, :2].T - planes[:, 2]).max(axis=1)
        np.testing.assert_allclose(outside, [0.2, 0.1, -0.233])


def test_the_outline_has_the_corners_and_no_gaps():
    points = outline(ROBOT.footprint)
    assert {tuple(corner) for corner in ROBOT.footprint} <= {tuple(p) for p in points.tolist()}
    steps = np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1)
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
    assert GUARD.ramp(Twist2(), FORWARD, 0.05).vx == pytest.approx(0.025)
    assert GUARD.ramp(FORWARD, Twist2(), 0.05).vx == pytest.approx(0.45)


def test_the_way_out_is_the_free_one():
    ahead = seeing((0.37, 0.0), (0.37, 0.2), (0.37, -0.2))
    escape = find_escape(GUARD, LIMITS, MIDDLE, ahead, now=10.0)
    assert escape is not None
    assert escape.name == "backing off"
    assert 10.0 < escape.until <= 12.5
    corners = [(x * 0.37, y * 0.25) for x in (-1, 0, 1) for y in (-1, 0, 1) if (x, y) != (0, 0)]
    boxed_in = seeing(*corners, *[(math.copysign(0.36, x), y) for x, y in corners])
    assert find_escape(GUARD, LIMITS, MIDDLE, boxed_in, now=0.0) is None
