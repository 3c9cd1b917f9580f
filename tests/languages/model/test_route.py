"""Routes by arc length, and the profile of speed along them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Walk
from grammars.model.geometry import Pose2
from grammars.model.movers import (
    CORNER,
    Profile,
    Route,
    chain_positions,
    is_mover,
    with_planar_chain,
)
from grammars.model.scene import Joint, Link, SceneObject

positive = st.floats(0.1, 5.0)
points = st.lists(
    st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=3, max_size=6, unique=True
)


@given(length=st.floats(0.0, 20.0), share=st.floats(0.0, 1.0), speed=positive, rate=positive)
def test_a_profile_keeps_its_limits_and_ends_at_rest(length, share, speed, rate):
    entry = share * min(speed, math.sqrt(2.0 * rate * length))
    profile = Profile.plan(length, entry, speed, rate)
    assert profile.at(0.0) == pytest.approx((0.0, entry), abs=1e-9)
    assert profile.at(profile.duration) == pytest.approx((length, 0.0), abs=1e-6)
    times = np.linspace(0.0, profile.duration, 400)
    ways, speeds = np.array([profile.at(t) for t in times.tolist()]).T
    assert speeds.max() <= max(speed, entry) + 1e-9
    assert np.diff(ways).min() >= -1e-9
    step = times[1]
    assert np.abs(np.diff(speeds)).max() <= rate * step + 1e-9
    mean = (speeds[1:] + speeds[:-1]) / 2
    assert np.diff(ways) == pytest.approx(mean * step, abs=rate * step**2 + 1e-12)


def test_a_profile_without_end_cruises():
    profile = Profile.plan(math.inf, 0.0, 2.0, 1.0)
    assert profile.duration == math.inf
    assert profile.at(1002.0) == pytest.approx((2.0 + 2000.0, 2.0))


@given(points, st.sampled_from(["once", "round"]))
def test_ways_are_arc_lengths_and_headings_never_jump(corners, manner):
    route = Route(Walk("v", tuple(corners), 1.0, manner=manner))
    ways = np.arange(0.0, route.length * (2 if manner == "round" else 1), 0.01)
    track = np.array([(*route.point(w), route.yaw(w)) for w in ways.tolist()])
    steps = np.hypot(*np.diff(track[:, :2], axis=0).T)
    assert steps.max() <= 0.01 + 1e-9
    assert [route.point(w) for w in route.stops[:1]] == [corners[0]]
    # A corner of half a turn at most, spread evenly over the way around it.
    sharpest = math.pi * 0.01 / (2.0 * CORNER)
    assert np.abs(np.diff(track[:, 2])).max() <= sharpest + 1e-9


def test_a_closed_route_turns_once_a_lap():
    square = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
    route = Route(Walk("v", square, 1.0, manner="round"))
    assert route.length == pytest.approx(8.0)
    for lap in range(4):
        assert route.yaw(8.0 * lap + 1.0) == pytest.approx(math.tau * lap)
        assert route.point(8.0 * lap + 3.0) == pytest.approx((2.0, 1.0))


def test_the_chain_puts_the_body_anywhere():
    links, joints = with_planar_chain((Link("body", (), 1.0, 0.0, 1.0),), (), "body")
    mover = SceneObject("v", "v", Pose2(1.0, 2.0, 0.7), links, joints, (0.0, 0.0, 0.0))
    positions = chain_positions(mover, Pose2(-3.0, 4.0), 9.0)
    there = mover.pose @ Pose2(*positions)
    assert (there.x, there.y) == pytest.approx((-3.0, 4.0))
    assert math.remainder(there.yaw - 9.0, math.tau) == pytest.approx(0.0)


def test_three_joints_of_the_right_names_are_no_planar_chain():
    _, joints = with_planar_chain((), (), "body")
    assert is_mover(joints)
    other = Joint("yaw", "prismatic", "y_carrier", "body", (0.0, 0.0), (1.0, 0.0), 0.0, 1.0)
    assert not is_mover((*joints[:2], other))
