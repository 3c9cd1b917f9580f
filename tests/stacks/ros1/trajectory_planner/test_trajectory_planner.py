"""The fast search commands what the plain one does, to the last bit, cycle after cycle."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.quirks import FAST, FIXED
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlannerParameters
from daemon.stacks.ros1.trajectory_planner._parameters import slowest_turn_at_goal, strafe_speeds
from daemon.stacks.ros1.trajectory_planner._rollout import (
    count_points,
    longest_trajectory,
    normalize_angle,
    settings_of,
)
from daemon.stacks.ros1.trajectory_planner._search import velocity_window
from daemon.stacks.ros1.trajectory_planner.controller import TrajectoryPlanner
from grammars.model.geometry import Pose2, Twist2, wrap_angle
from tests.stacks.ros1.dwa.helpers import LARGE, SMALL, blobs
from tests.stacks.ros1.trajectory_planner.helpers import ROBOTS, costs_around, drive, straight
from tests.stacks.ros1.trajectory_planner.plain import PlainPlanner, between

FEW = TrajectoryPlannerParameters(
    vx_samples=3, vtheta_samples=6, sim_time=1.2, sim_granularity=0.05, xy_goal_tolerance=0.0,
    angular_sim_granularity=0.08, controller_frequency=10.0, prune_plan=False,
)  # fmt: skip
VARIANTS = (
    FEW,
    replace(FEW, dwa=True, acc_lim_x=1.0, acc_lim_theta=2.0),
    replace(FEW, holonomic_robot=False, occdist_scale=0.1, meter_scoring=True),
    replace(FEW, heading_scoring=True, heading_scoring_timestep=0.6),
    replace(FEW, heading_scoring=True, meter_scoring=True, occdist_scale=0.5, dwa=True),
    replace(FEW, y_vels="-0.3, -0.1, 0.1, 0.3", oscillation_reset_dist=0.4, acc_lim_y=0.8),
    replace(FEW, max_vel_theta=0.0, min_vel_theta=0.0, oscillation_reset_dist=0.4),
    replace(FEW, path_distance_bias=0.0, goal_distance_bias=0.0, occdist_scale=0.0),
    replace(FEW, min_vel_x=0.2, escape_vel=-0.3, escape_reset_theta=0.1),
    replace(FEW, heading_lookahead=1.4, min_in_place_vel_theta=0.9),
)


def winding(rng, start):
    """Return a plan from about ``start``."""
    heading = start.yaw + rng.normal(0.0, 0.9) + np.cumsum(rng.normal(0.0, 0.08, 60))
    step = 0.04 if rng.random() < 0.8 else 0.12
    way = np.cumsum(step * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    plan = way[: int(rng.integers(2, 60))] + np.array((start.x, start.y)) + rng.normal(0, 0.05, 2)
    return np.column_stack([plan, np.zeros(len(plan))])


def near(plan, pose, reach):
    """Return the points of a plan from the first near one to the first that is not any more."""
    far = np.hypot(plan[:, 0] - pose.x, plan[:, 1] - pose.y) > reach
    first = int(np.argmin(far))
    beyond = np.flatnonzero(far[first:])
    last = first + int(beyond[0]) + 1 if beyond.size else len(plan)
    return np.ascontiguousarray(plan[first:last, :2])


@given(seed=st.integers(0, 2**32 - 1), variant=st.sampled_from(range(len(VARIANTS))))
def test_fast_and_plain_command_the_same(seed, variant):
    rng = np.random.default_rng(seed)
    parameters, quirks = VARIANTS[variant], FAST if rng.random() < 0.7 else FIXED
    outline = (SMALL, 2.0 * SMALL, LARGE, SMALL[:2])[int(rng.integers(4))]
    pose = Pose2(*rng.uniform(-80, 80, 2).tolist(), float(rng.uniform(-3, 3)))
    cells = 60 if rng.random() < 0.7 else 70
    local = costs_around(pose, cells, 0.05)
    local.cells[:] = blobs(rng, (cells, cells), int(rng.integers(0, 9)), 0.002)
    local.x, local.y = local.x + rng.uniform(-0.2, 0.2), local.y + rng.uniform(-0.2, 0.2)
    fast = TrajectoryPlanner(parameters, quirks, outline, 0.1)
    s = settings_of(parameters, quirks, 0.05, 0.1)
    plain = PlainPlanner(s, strafe_speeds(parameters), outline)
    plain.reset_after = parameters.oscillation_reset_dist
    plain.escape_after = parameters.escape_reset_dist
    plain.escape_turn = parameters.escape_reset_theta
    plan = winding(rng, pose)
    fast.set_plan(plan)
    twist = Twist2(float(rng.uniform(-0.1, 0.5)), 0.0, float(rng.normal(0.0, 0.5)))
    for _ in range(4):
        state = np.array(
            (pose.x, pose.y, pose.yaw, twist.vx, twist.vy, twist.wz), dtype=np.float32
        ).astype(np.float64)
        answer = fast.command(pose, twist, Pose2(), local)
        expected = plain.best(state, near(plan, pose, cells * 0.025), local)
        assert answer.ok == (expected.cost >= 0.0)
        if answer.ok:
            assert (answer.twist.vx, answer.twist.vy, answer.twist.wz) == expected.velocity
            points = np.array(expected.points).reshape(-1, 3)
            np.testing.assert_array_equal(answer.local_plan, points[:, :2])
        twist = answer.twist
        pose = pose @ Pose2(0.2 * twist.vx, 0.2 * twist.vy, 0.2 * twist.wz)


SLALOM = ((1.2, -0.9, 1.5, -0.3),)


@pytest.mark.parametrize("name", list(ROBOTS))
def test_commands_are_those_of_the_original(name):
    robot = ROBOTS[name]
    period = 1.0 / robot.frequency
    planner = TrajectoryPlanner(robot.parameters, FAST, robot.outline, period)
    planner.set_plan(straight(3.0, end=1.0))
    answers = [answer for _, answer in drive(planner, robot, Pose2(yaw=0.6), 10, *SLALOM)]
    assert all(answer.ok and answer.twist.vy == 0.0 for answer in answers)
    got = [(answer.twist.vx, answer.twist.wz) for answer in answers]
    np.testing.assert_allclose(got, robot.measured, atol=2e-9)


DEFAULT = TrajectoryPlannerParameters()


def settings(parameters=DEFAULT):
    return settings_of(parameters, FAST, 0.05, 0.1)


def test_the_older_name_of_the_slowest_turn_is_heard_at_the_goal_only():
    older = replace(DEFAULT, min_in_place_rotational_vel=0.7)
    assert (settings(older).slowest_turn, slowest_turn_at_goal(older)) == (0.4, 0.7)
    both = replace(older, min_in_place_vel_theta=0.2)
    assert (settings(both).slowest_turn, slowest_turn_at_goal(both)) == (0.2, 0.2)


@pytest.mark.parametrize(
    ("text", "speeds"),
    [
        ("0.2, -0.2", (0.2, -0.2)),
        ("[-0.3, 1e-1]", (0.0, 0.1)),
        ("0.1 ,, x", (0.1, 0.0)),
        ("", (0.0,)),
    ],
)
def test_strafe_speeds_are_read_as_c_reads_numbers(text, speeds):
    assert strafe_speeds(replace(DEFAULT, y_vels=text)) == speeds


def test_no_trajectory_is_longer_than_there_is_room():
    for robot in ROBOTS.values():
        p, s = robot.parameters, settings(robot.parameters)
        for vx, wz in ((0.0, 0.0), (0.9, 2.0), (-0.4, -3.0)):
            most = longest_trajectory(p, s, (vx, 0.0, wz))
            edges = np.zeros((2, 2))
            velocity_window(np.array((0.0, 0.0, 0.0, vx, 0.0, wz)), 9.0, s, edges)
            for sample in (*edges[1].tolist(), -s.slowest_turn, 1.0):
                for speed in (*edges[0].tolist(), s.escape_vel):
                    assert count_points(speed, 0.0, sample, s) <= most


def test_angles_are_wrapped_as_others_do_but_for_rounding():
    for angle in np.linspace(-9.0, 9.0, 181).tolist():
        assert normalize_angle(angle) == pytest.approx(wrap_angle(angle), abs=1e-14)
        assert normalize_angle(angle) == between(0.0, angle)
