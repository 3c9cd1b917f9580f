"""Parameters that contradict each other, robots that never start, and what kernels are given."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest

from daemon.stacks.ros1.dwa import DwaParameters
from daemon.stacks.ros1.dwa._settings import longest_trajectory, settings_of
from daemon.stacks.ros1.quirks import FAST, FIXED
from tests.stacks.ros1.dwa.helpers import A2S, OMNI, settings


def contradictions(parameters):
    return tuple(each for each in parameters.rules() if each.fatal)


def doubts(parameters):
    return tuple(each for each in parameters.rules() if not each.fatal)


@pytest.mark.parametrize(
    ("wrong", "names", "word"),
    [
        ({"min_vel_trans": 0.2203}, "min_vel_trans max_vel_trans", "cannot drive"),
        ({"max_vel_trans": 0.0, "min_vel_trans": 0.0}, "max_vel_trans", "never drive"),
        ({"min_vel_x": 0.3}, "min_vel_x max_vel_x", "no speed between"),
        ({"min_vel_y": 0.3}, "min_vel_y max_vel_y", "no speed between"),
        (
            {"min_vel_x": 0.3, "max_vel_x": 0.4},
            "min_vel_x max_vel_x max_vel_trans",
            "beyond max_vel_trans",
        ),
        (
            {"min_vel_x": -0.4, "max_vel_x": -0.3},
            "min_vel_x max_vel_x max_vel_trans",
            "beyond max_vel_trans",
        ),
        ({"min_vel_theta": 3.0}, "min_vel_theta max_vel_theta", "never turn fast enough"),
        ({"min_vel_theta": 3.0, "min_vel_trans": 0.0}, "min_vel_theta max_vel_theta", "set it low"),
        ({"sim_time": 0.0}, "sim_time", "no points"),
        ({"acc_lim_x": 0.0}, "acc_lim_x acc_lim_y", "no other speed"),
        ({"acc_lim_theta": 0.0}, "acc_lim_theta", "no other turning speed"),
        (
            {"scaling_speed": 0.22},
            "scaling_speed max_vel_trans max_scaling_factor",
            "without bound",
        ),
    ],
)
def test_each_contradiction_is_named_alone(wrong, names, word):
    (found,) = contradictions(replace(A2S, **wrong))
    assert found.names == tuple(names.split())
    assert word in found.text


@pytest.mark.parametrize(
    "sound",
    [
        {},
        {"min_vel_trans": 0.2201},
        {"min_vel_x": 0.22},
        {"min_vel_y": 0.0},
        {"min_vel_x": -0.3, "max_vel_x": 0.4},
        {"min_vel_x": 0.22, "max_vel_x": 0.4},
        {"min_vel_x": 0.2200999, "max_vel_x": 0.4},
        {"min_vel_theta": 2.75},
        {"acc_lim_x": 0.0, "acc_lim_y": 0.1},
        {"acc_lim_x": 0.0, "use_dwa": False},
        {"scaling_speed": 0.22, "max_scaling_factor": 0.0},
        {"scaling_speed": 0.2201},
    ],
)
def test_what_only_looks_like_a_contradiction_is_none(sound):
    assert contradictions(replace(A2S, **sound)) == ()
    assert contradictions(OMNI) == ()
    assert contradictions(DwaParameters()) == ()


SLOW_START = replace(
    A2S,
    acc_lim_x=1.0,
    acc_lim_y=0.0,
    acc_lim_theta=2.0,
    min_vel_trans=0.11,
    min_vel_theta=0.5,
    controller_frequency=10.0,
)
"""Reaches 0.1 m/s and 0.2 rad/s within a period of 0.1 s: too little of both."""


def test_a_robot_that_can_never_start_is_remarked_on():
    (found,) = doubts(SLOW_START)
    assert found.names == (
        "acc_lim_x", "min_vel_trans", "acc_lim_theta", "min_vel_theta", "controller_frequency",
    )  # fmt: skip
    assert "within 0.1 s it reaches 0.1 m/s and 0.2 rad/s" in found.text
    assert doubts(A2S) == doubts(OMNI) == doubts(DwaParameters()) == ()


@pytest.mark.parametrize(
    ("changed", "starts"),
    [
        ({"min_vel_trans": 0.1001}, True),
        ({"min_vel_trans": 0.1002}, False),
        ({"min_vel_theta": 0.2}, True),
        ({"min_vel_theta": 0.2001}, True),
        ({"min_vel_theta": 0.2002}, False),
        # Both ways along an axis count, and both axes together.
        ({"max_vel_x": 0.05}, False),
        ({"max_vel_x": 0.05, "min_vel_x": -0.22, "acc_lim_x": 1.2}, True),
        ({"min_vel_x": 0.0, "acc_lim_x": 1.2}, True),
        ({"min_vel_x": -0.05, "max_vel_x": 0.05, "acc_lim_x": 1.2}, False),
        ({"acc_lim_y": 0.5, "max_vel_y": 0.3}, True),
        ({"acc_lim_y": 0.5, "min_vel_y": -0.3}, True),
        ({"acc_lim_y": 0.5, "max_vel_y": 0.01, "min_vel_y": -0.01}, False),
        ({"acc_lim_y": 9.0, "max_vel_y": 0.04, "min_vel_y": 0.0}, False),
        ({"acc_lim_y": 9.0, "max_vel_y": 0.05, "min_vel_y": 0.0}, True),
        ({"max_vel_theta": 0.1, "acc_lim_theta": 9.0, "min_vel_theta": 0.2}, False),
        # The period is longer, or it is the time that trajectories look ahead.
        ({"controller_frequency": 8.0}, True),
        ({"controller_frequency": None}, False),
        ({"use_dwa": False}, True),
        ({"use_dwa": False, "sim_time": 0.1}, False),
    ],
)
def test_a_robot_starts_when_it_reaches_either_smallest_speed(changed, starts):
    assert (doubts(replace(SLOW_START, **changed)) == ()) is starts


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
    theta = float(np.float32(3.3))
    assert found == {
        "max_vel_trans": 0.61, "min_vel_trans": 0.11, "max_vel_x": 0.52, "min_vel_x": -0.13,
        "max_vel_y": 0.24, "min_vel_y": -0.15, "max_vel_theta": 1.6, "min_vel_theta": 0.7,
        "acc_lim_x": 2.125, "acc_lim_y": 1.375, "acc_lim_theta": theta, "sim_time": 1.9,
        "sim_granularity": 0.03, "angular_sim_granularity": 0.07, "occdist_scale": 0.05,
        "twirling_scale": 0.4, "forward_point_distance": 0.3, "scaling_speed": 0.35,
        "max_scaling_factor": 0.25, "vx_samples": 4, "vy_samples": 1, "vth_samples": 9,
        "use_dwa": True, "sum_scores": False, "period": 0.125, "path_scale": 0.1 * 30.0,
        "goal_scale": 0.1 * 20.0, "strafe_leaks": True, "perimeter_only": True,
    }  # fmt: skip
    none = replace(given, vx_samples=0, vth_samples=0, controller_frequency=None, sum_scores=True)
    other = settings_of(replace(none, use_dwa=False), FIXED, 0.1, 0.05)
    assert (other.vx_samples, other.vth_samples, other.period) == (1, 1, 0.05)
    assert (other.use_dwa, other.sum_scores) == (False, True)
    assert (other.strafe_leaks, other.perimeter_only) == (False, False)


def test_defaults_are_those_of_noetic():
    """``DWAPlanner.cfg`` of dwa_local_planner and ``add_generic_localplanner_params``."""
    assert asdict(DwaParameters()) == {
        "max_vel_trans": 0.55, "min_vel_trans": 0.1, "max_vel_x": 0.55, "min_vel_x": 0.0,
        "max_vel_y": 0.1, "min_vel_y": -0.1, "max_vel_theta": 1.0, "min_vel_theta": 0.4,
        "acc_lim_x": 2.5, "acc_lim_y": 2.5, "acc_lim_theta": 3.2, "prune_plan": False,
        "xy_goal_tolerance": 0.1, "yaw_goal_tolerance": 0.1, "trans_stopped_vel": 0.1,
        "theta_stopped_vel": 0.1, "sim_time": 1.7, "sim_granularity": 0.025,
        "angular_sim_granularity": 0.1, "path_distance_bias": 32.0, "goal_distance_bias": 24.0,
        "occdist_scale": 0.01, "twirling_scale": 0.0, "oscillation_reset_dist": 0.05,
        "oscillation_reset_angle": 0.2, "forward_point_distance": 0.325, "scaling_speed": 0.25,
        "max_scaling_factor": 0.2, "vx_samples": 3, "vy_samples": 10, "vth_samples": 20,
        "use_dwa": True, "sum_scores": False, "cheat_factor": 1.0, "controller_frequency": None,
    }  # fmt: skip


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
