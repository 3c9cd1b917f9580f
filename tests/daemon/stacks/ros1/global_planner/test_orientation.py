"""The yaw of a plan's points in each mode."""

import math

import numpy as np
import pytest

from daemon.stacks.ros1.global_planner.orientation import orient


def a_corner():
    """Ten points east, ten points north, the goal at the end with yaw 2."""
    east = [(0.1 * k, 0.0, 0.0) for k in range(10)]
    north = [(1.0, 0.1 * k, 0.0) for k in range(10)]
    return np.array([*east, *north, (1.0, 1.0, 2.0)])


def oriented(mode, *, window=1, overshoot=True, poses=None):
    given = a_corner() if poses is None else poses.copy()
    orient(given, 0.5, mode, window, overshoot)
    return given[:, 2].tolist()


def test_none_leaves_all_but_the_goal_at_zero():
    assert oriented(0) == [0.0] * 20 + [2.0]


@pytest.mark.parametrize(
    ("mode", "turn"), [(1, 0.0), (4, math.pi), (5, -math.pi / 2), (6, math.pi / 2)]
)
def test_points_look_along_the_path_turned_by_the_mode(mode, turn):
    yaws = oriented(mode)
    assert yaws[3] == pytest.approx(math.remainder(turn, math.tau))
    assert math.remainder(yaws[15] - math.pi / 2 - turn, math.tau) == pytest.approx(0.0)
    assert yaws[10] == pytest.approx(math.remainder(math.pi / 4 + turn, math.tau))
    assert yaws[-1] == 2.0


def test_a_wider_window_smooths_the_corner():
    narrow, wide = oriented(1), oriented(1, window=5)
    assert np.abs(np.diff(wide[:-1])).max() < np.abs(np.diff(narrow[:-1])).max()


def test_interpolation_turns_evenly_the_shorter_way():
    assert oriented(2) == pytest.approx(np.linspace(0.5, 2.0, 21).tolist())
    poses = a_corner()
    poses[-1, 2] = -3.0
    turned = np.unwrap(oriented(2, poses=poses))
    assert turned[-1] == pytest.approx(math.tau - 3.0)


def test_the_last_straight_is_interpolated_and_overshoots_in_the_original():
    sane = oriented(3, overshoot=False)
    assert sane[0] == pytest.approx(0.5)
    assert sane[5] == pytest.approx(0.0)
    first = sane.index(min(sane[10:], key=lambda yaw: abs(yaw - math.pi / 2)))
    assert sane[-1] == pytest.approx(2.0)
    assert np.diff(sane[first:]) == pytest.approx(np.full(20 - first, np.diff(sane[first:])[0]))
    original = oriented(3)
    assert original[5] == pytest.approx(0.0)
    step = original[-1] - original[-2]
    assert step == pytest.approx(sane[-1] - sane[-2])
    assert original[-1] - sane[-1] == pytest.approx(step * first)


def test_two_points_are_interpolated_from_the_first():
    poses = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 1.5)])
    assert oriented(3, poses=poses) == pytest.approx([0.5, 1.5])
