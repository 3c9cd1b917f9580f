"""What the controller does with plans, goals, blocked ways and obstacles."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.quirks import FAST, FIXED
from daemon.stacks.ros1.trajectory_planner import (
    TrajectoryPlannerParameters,
)
from daemon.stacks.ros1.trajectory_planner._parameters import slowest_turn_at_goal, strafe_speeds
from daemon.stacks.ros1.trajectory_planner._rollout import count_points, normalize_angle
from daemon.stacks.ros1.trajectory_planner._search import (
    velocity_window,
)
from daemon.stacks.ros1.trajectory_planner._settings import (
    longest_trajectory,
    settings_of,
)
from daemon.stacks.ros1.trajectory_planner.controller import TrajectoryPlanner
from grammars.model.geometry import Pose2, Twist2, wrap_angle
from tests.stacks.ros1.trajectory_planner import plain
from tests.stacks.ros1.trajectory_planner.helpers import (
    ROBOTS,
    costs_around,
    rectangle,
    straight,
)

HUSKY = ROBOTS["husky"].parameters
OUTLINE = rectangle(-0.3, 0.3, 0.2)


def controller(parameters=HUSKY, quirks=FAST):
    return TrajectoryPlanner(parameters, quirks, OUTLINE, 0.2)


def around(pose=Pose2(), *boxes):  # noqa: B008
    return costs_around(pose, 80, 0.05, *boxes)


def first(
    planner,
    twist=Twist2(),  # noqa: B008
    *boxes,
    yaw=0.0,
):
    pose = Pose2(yaw=yaw)
    return planner.command(pose, twist, Pose2(), around(pose, *boxes))


def test_the_period_is_that_of_move_base_unless_it_has_one_of_its_own():
    planner = controller(replace(HUSKY, controller_frequency=None))
    planner.set_plan(straight(1.5))
    assert first(planner).twist.vx == 0.5
    planner = controller(replace(HUSKY, controller_frequency=-1.0))
    planner.set_plan(straight(1.5))
    assert first(planner).twist.vx == 0.125


def test_the_plan_is_taken_through_the_correction_of_the_map():
    correction, twist = Pose2(5.0, -3.0, 0.7), Twist2(0.2, 0.0, 0.1)
    here, moved = controller(), controller()
    here.set_plan(straight(1.5))
    points = [correction @ Pose2(x, y, yaw) for x, y, yaw in straight(1.5).tolist()]
    moved.set_plan(np.array([(p.x, p.y, p.yaw) for p in points]))
    pose = Pose2(0.003, 0.004, 0.1)
    expected = here.command(pose, twist, Pose2(), around())
    assert moved.command(pose, twist, correction, around()).twist == expected.twist


def test_no_command_without_a_plan_nearby():
    planner = controller()
    assert not first(planner).ok
    planner.set_plan(straight(1.5) + np.array((9.0, 9.0, 0.0)))
    assert not first(planner).ok
    assert first(planner).twist == Twist2()


def at_goal(
    yaw_error,
    twist=Twist2(),  # noqa: B008
    parameters=HUSKY,
    quirks=FAST,
    *boxes,
):
    planner, pose = controller(parameters, quirks), Pose2(0.9, 0.0, -yaw_error)
    planner.set_plan(straight(1.0))
    answer = planner.command(pose, twist, Pose2(), around(pose, *boxes))
    assert answer.local_plan.shape == (0, 2)
    return planner, answer


def test_within_tolerance_it_stands_and_the_goal_is_reached():
    planner, answer = at_goal(0.09, Twist2(0.3, 0.0, 0.2))
    assert (answer.ok, answer.twist) == (True, Twist2())
    assert planner.goal_reached(Pose2(), Twist2(), Pose2())
    planner.set_plan(straight(1.0))
    assert not planner.goal_reached(Pose2(0.9), Twist2(), Pose2())


SLOW = replace(HUSKY, acc_lim_theta=0.1, min_in_place_vel_theta=0.1)
QUICK = replace(HUSKY, acc_lim_theta=20.0)
LIMITED = replace(QUICK, max_vel_theta=0.5, min_vel_theta=-0.3)


@pytest.mark.parametrize(
    ("error", "wz", "parameters", "quirks", "expected"),
    [
        # Within its acceleration, and so that it can stop.
        (2.0, 0.0, HUSKY, FAST, 0.2),
        (-0.2, 0.01, SLOW, FAST, -0.1),
        (-0.2, 0.01, SLOW, FIXED, -0.015),
        (0.5, 0.0, QUICK, FAST, 0.5),
        (2.0, 0.0, QUICK, FAST, 1.0),
        # With a limit of its own.
        (2.0, 0.0, LIMITED, FAST, 1.0),
        (2.0, 0.0, replace(LIMITED, max_rotational_vel=0.7), FAST, 0.7),
        (2.0, 0.0, LIMITED, FIXED, 0.5),
        (-2.0, 0.0, LIMITED, FIXED, -0.3),
    ],
)
def test_the_speed_of_a_turn_at_the_goal(error, wz, parameters, quirks, expected):
    twist = at_goal(error, Twist2(0.0, 0.0, wz), parameters, quirks)[1].twist
    assert (twist.vx, twist.vy, twist.wz) == (0.0, 0.0, pytest.approx(expected))


def test_it_slows_down_before_it_turns():
    planner, answer = at_goal(1.0, Twist2(0.3, 0.02, -0.4))
    twist = answer.twist
    assert answer.ok
    assert (twist.vx, twist.vy, twist.wz) == pytest.approx((0.175, 0.0, -0.24))
    assert not planner.goal_reached(Pose2(), Twist2(), Pose2())


def test_once_turning_it_goes_on_turning_though_it_moves():
    planner, _ = at_goal(2.0)
    answer = planner.command(Pose2(0.9, 0.0, -1.9), Twist2(0.0, 0.0, 0.2), Pose2(), around())
    assert answer.twist.wz == pytest.approx(0.36)


def test_a_turn_in_collision_is_refused():
    _, answer = at_goal(2.0, Twist2(), HUSKY, FAST, (0.5, -1.0, 1.5, 1.0))
    assert (answer.ok, answer.twist) == (False, Twist2())


@pytest.mark.parametrize("latch", [False, True])
def test_a_latched_goal_is_only_turned_to_until_the_next_plan(latch):
    planner, _ = at_goal(2.0, Twist2(), replace(HUSKY, latch_xy_goal_tolerance=latch))
    off = Pose2(0.5, 0.0, -2.0)
    answer = planner.command(off, Twist2(), Pose2(), around(off))
    assert (len(answer.local_plan) == 0) is latch
    planner.set_plan(straight(1.0))
    assert len(planner.command(off, Twist2(), Pose2(), around(off)).local_plan) > 0


def test_the_goal_it_turns_at_is_the_end_of_the_window():
    planner = controller()
    planner.set_plan(straight(4.0, end=1.0))
    # A window of half a metre either way ends beside the robot, where the plan looks ahead.
    near = costs_around(Pose2(0.0), 6, 0.05)
    answer = planner.command(Pose2(0.05), Twist2(), Pose2(), near)
    assert (answer.ok, answer.twist) == (True, Twist2())
    assert planner.goal_reached(Pose2(), Twist2(), Pose2())


@pytest.mark.parametrize("prune", [False, True])
def test_pruning_forgets_the_plan_behind_the_robot(prune):
    plan = np.concatenate([straight(2.5), straight(2.5)[::-1]])
    planner = controller(replace(HUSKY, prune_plan=prune))
    planner.set_plan(plan)
    pose = Pose2(1.5)
    planner.command(pose, Twist2(), Pose2(), around(pose))
    assert planner._plan.forgotten == (11 if prune else 0)


def test_a_costmap_of_another_shape_is_taken():
    planner = controller()
    planner.set_plan(straight(1.5))
    for cells in (80, 60, 100):
        local = costs_around(Pose2(), cells, 0.05)
        assert planner.command(Pose2(), Twist2(), Pose2(), local).twist.vx == 0.125
    other = CostGrid(0.05, local.x, local.y, local.cells.copy())
    other.cells[:] = 254
    assert planner.command(Pose2(), Twist2(), Pose2(), other).twist.vx <= 0.0


DEFAULT = TrajectoryPlannerParameters()
HUSKY = ROBOTS["husky"].parameters


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
        assert normalize_angle(angle) == plain.between(0.0, angle)
