"""Samples, trajectories, distances, footprints and memory, against numbers of the original."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest

from daemon.stacks.ros1.base_local_planner.footprint import footprint_cost
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.dwa import DwaParameters
from daemon.stacks.ros1.dwa._distances import allocate_scoring_grid
from daemon.stacks.ros1.dwa._settings import longest_trajectory, settings_of
from daemon.stacks.ros1.dwa.controller import Oscillation
from daemon.stacks.ros1.dwa.samples import footprint_scale
from daemon.stacks.ros1.quirks import FAST, FIXED
from tests.stacks.ros1.dwa.helpers import A2S, OMNI, SMALL, settings


def test_rows_of_an_upright_costmap_all_have_room_for_what_an_outline_encloses():
    upright = CostGrid(0.05, -0.5, -1.5, np.zeros((60, 20), dtype=np.uint8))
    upright.cells[57, 10] = 254
    outline, pose = 2.0 * SMALL, np.array((0.0, 1.3, 0.0, 1.0, 0.0))
    for quirks, expected in ((FAST, 0), (FIXED, -1)):
        none = np.zeros(6, dtype=np.int32)
        grid = allocate_scoring_grid(upright, settings(A2S, quirks), outline, none)
        found = footprint_cost(grid.cells, grid.frame, outline, 1.0, pose, grid.spans)
        assert found == expected


def test_nothing_lies_between_a_scaling_speed_and_an_equal_limit():
    equal = replace(A2S, max_vel_trans=0.25, scaling_speed=0.25, max_scaling_factor=0.2)
    assert footprint_scale(0.26, settings(equal)) == math.inf
    # Who does not want the footprint to grow has a factor of 0.
    assert footprint_scale(0.26, settings(replace(equal, max_scaling_factor=0.0))) == 1.0


def ruled_out(*twists, at=None):
    """Return what is ruled out after commands at one place and, maybe, the last one again."""
    memory = Oscillation(0.5, 0.25)
    for twist in twists:
        memory.chosen((3.0, -2.0, 1.0), twist, 0.125)
    if at is not None:
        memory.chosen(at, twists[-1], 0.125)
    return memory.banned.tolist()


def test_a_change_of_direction_is_final_and_the_sign_before_a_stop_counts():
    ahead, back, stop = (0.2, 0.0, 0.3), (-0.1, 0.0, 0.3), (0.0, 0.0, 0.3)
    assert ruled_out(ahead, stop, ahead) == [0] * 6
    assert ruled_out(ahead, back) == [0, 1, 0, 0, 0, 0]
    assert ruled_out(back, stop, ahead) == [1, 0, 0, 0, 0, 0]
    assert ruled_out(ahead, back, (-0.1, 0.0, -0.3)) == [0, 1, 0, 0, 0, 1]


def test_turning_and_strafing_are_remembered_only_when_slow():
    for vx, remembered in ((0.2, False), (-0.2, False), (0.125, True), (-0.125, True)):
        turned = ruled_out((vx, 0.0, 0.3), (vx, 0.0, -0.3))
        assert turned == [0, 0, 0, 0, 0, int(remembered)]
        strafed = ruled_out((vx, -0.1, 0.0), (vx, 0.1, 0.0))
        assert strafed == [0, 0, int(remembered), 0, 0, 0]


@pytest.mark.parametrize(
    ("step", "free"),
    [
        ((0.5, 0.0, 0.0), False),
        ((0.0, -0.5, 0.0), False),
        ((0.0, 0.0, -0.25), False),
        ((0.501, 0.0, 0.0), True),
        ((0.0, -0.501, 0.0), True),
        ((0.36, 0.36, 0.0), True),
        ((0.0, 0.0, 0.251), True),
    ],
)
def test_what_is_ruled_out_is_free_again_beyond_the_distance_or_the_angle(step, free):
    at = (3.0 + step[0], -2.0 + step[1], 1.0 + step[2])
    banned = ruled_out((0.2, 0.0, 0.0), (-0.2, 0.0, 0.0), at=at)
    assert banned == ([0] * 6 if free else [0, 1, 0, 0, 0, 0])


def test_free_again_a_robot_may_turn_round_once_more():
    memory = Oscillation(0.5, 0.25)
    for x, vx in ((0.0, 0.2), (0.0, -0.2), (1.0, -0.2), (1.0, 0.2)):
        memory.chosen((x, 0.0, 0.0), (vx, 0.0, 0.0), 0.125)
    assert not memory.banned.any()
    memory.chosen((1.0, 0.0, 0.0), (-0.2, 0.0, 0.0), 0.125)
    assert memory.banned.tolist() == [0, 1, 0, 0, 0, 0]


def test_kernels_get_every_parameter_under_its_own_name():
    given = DwaParameters(
        max_vel_trans=0.61, min_vel_trans=0.11, max_vel_x=0.52, min_vel_x=-0.13, max_vel_y=0.24,
        min_vel_y=-0.15, max_vel_theta=1.6, min_vel_theta=0.7, acc_lim_x=2.125, acc_lim_y=1.375,
        acc_lim_theta=3.3, sim_time=1.9, sim_granularity=0.03, angular_sim_granularity=0.07,
        path_distance_bias=30.0, goal_distance_bias=20.0, occdist_scale=0.05, twirling_scale=0.4,
        forward_point_distance=0.3, scaling_speed=0.35, max_scaling_factor=0.25, vx_samples=4,
        vy_samples=0, vth_samples=9, controller_frequency=8.0,
    )  # fmt: skip
    found = settings_of(given, FAST, 0.1, 0.05)._asdict()
    other_names = {
        "acc_lim_theta": float(np.float32(3.3)), "vy_samples": 1, "period": 0.125,
        "path_scale": 0.1 * 30.0, "goal_scale": 0.1 * 20.0,
        "strafe_leaks": True, "perimeter_only": True,
    }  # fmt: skip
    expected = asdict(given) | other_names
    assert found == {name: expected[name] for name in found}
    none = replace(given, vx_samples=0, vth_samples=0, controller_frequency=None)
    other = settings_of(none, FIXED, 0.1, 0.05)
    assert (other.vx_samples, other.vth_samples, other.period) == (1, 1, 0.05)
    assert (other.strafe_leaks, other.perimeter_only) == (False, False)


@pytest.mark.parametrize(
    ("parameters", "speeds", "longest"),
    [
        # Turning at 2.75 rad/s in steps of 0.1 rad, or 0.25 m/s in steps of 25 mm, for 1.5 s.
        (A2S, (0.0, 0.0, 0.0), 42),
        (replace(A2S, max_vel_theta=0.5), (0.0, 0.0, 0.0), 15),
        (replace(A2S, max_vel_theta=0.1, acc_lim_theta=0.0), (0.0, 0.0, -1.2), 18),
        # Faster than the limits: what the robot does now, and what it reaches within 0.1 s.
        (A2S, (0.0, 0.0, -3.0), math.ceil(3.32 * 15)),
        (replace(A2S, max_vel_theta=0.5), (-0.35, 0.0, 0.0), math.ceil(0.6 * 60)),
        (replace(A2S, max_vel_theta=0.5, acc_lim_x=0.0), (0.3, -0.4, 0.0), math.ceil(0.5 * 60)),
        (replace(A2S, use_dwa=False, acc_lim_x=0.0), (0.0, 0.0, 1.01), math.ceil(5.81 * 15)),
        (replace(OMNI, max_vel_theta=0.0, acc_lim_theta=0.0, acc_lim_x=0.0),
         (0.0, -0.4, 0.0), math.ceil(math.hypot(0.22, 0.4625) * 100)),
        (replace(OMNI, max_vel_theta=0.0, acc_lim_theta=0.0, acc_lim_x=0.0, acc_lim_y=0.0),
         (0.0, 0.0, 0.0), math.ceil(math.hypot(0.22, 0.11) * 100)),
    ],
)  # fmt: skip
def test_there_is_room_for_the_longest_trajectory_and_little_more(parameters, speeds, longest):
    assert longest < longest_trajectory(settings(parameters), *speeds) <= longest + 2
