"""Movers walk exactly as told, are seen and felt, and make way where they are told to."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.simulator._walkers import RouteFollower
from grammars.model.behaviour import Walk
from grammars.model.geometry import Pose2
from grammars.model.kinematics import link_poses
from tests.engine.simulator.reference import true_ranges
from tests.engine.simulator.scenes import FAR, LINE, box, person, wall, world


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


def test_velocities_are_those_of_the_walk():
    now = world(person(), start=FAR, behaviours=(LINE,))
    now.advance(300)
    assert now.joint_states()[1] == pytest.approx([0.8, 0.0, 0.0], abs=1e-9)


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
