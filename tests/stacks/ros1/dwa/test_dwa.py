"""What the controller does with plans, goals and obstacles."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.dwa.controller import Dwa
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2, Twist2
from tests.stacks.ros1.dwa.helpers import (
    A2S,
    OMNI,
    SMALL,
    Problem,
    blobs,
    settings,
    singles,
)


def controller(parameters=A2S, quirks=FAST, *, latch=False):
    return Dwa(parameters, quirks, SMALL, 0.05, latch_goal=latch)


def empty(x=0.0, y=0.0):
    return CostGrid(0.05, x - 1.5, y - 1.5, np.zeros((60, 60), dtype=np.uint8))


def straight(length=3.0, yaw=0.0):
    along = np.arange(0.0, length + 1e-9, 0.025)
    plan = np.column_stack([along * math.cos(yaw), along * math.sin(yaw), np.zeros(len(along))])
    plan[-1, 2] = yaw
    return plan


def test_the_plan_is_taken_through_the_correction_of_the_map():
    correction, twist = Pose2(5.0, -3.0, 0.7), Twist2(0.2, 0.0, 0.1)
    plan = straight()
    here = controller()
    here.set_plan(plan)
    moved = controller()
    points = [correction @ Pose2(x, y, yaw) for x, y, yaw in plan.tolist()]
    moved.set_plan(np.array([(p.x, p.y, p.yaw) for p in points]))
    pose = Pose2(0.003, 0.004, 0.1)
    expected = here.command(pose, twist, Pose2(), empty())
    assert moved.command(pose, twist, correction, empty()).twist == expected.twist


def test_no_command_without_a_plan_nearby_or_with_every_sample_illegal():
    dwa = controller()
    assert not dwa.command(Pose2(), Twist2(), Pose2(), empty()).ok
    dwa.set_plan(straight() + np.array((5.0, 5.0, 0.0)))
    assert not dwa.command(Pose2(), Twist2(), Pose2(), empty()).ok
    dwa.set_plan(straight())
    local = empty()
    local.cells[:, 31] = 254
    refused = dwa.command(Pose2(), Twist2(), Pose2(), local)
    assert not refused.ok
    assert refused.twist == Twist2()
    local.cells[:, 31] = 0
    local.touch((0, 0, 60, 60))
    assert dwa.command(Pose2(), Twist2(), Pose2(), local).ok


@pytest.mark.parametrize(
    ("error", "twist", "quirks", "cells", "ok", "expected"),
    [
        # Within the tolerance of 0.5 rad, which belongs to it, it stops.
        (0.49, Twist2(0.22, 0.0, 1.0), FAST, 0, True, (0.0, 0.0)),
        (0.5, Twist2(0.22, 0.0, 1.0), FAST, 0, True, (0.0, 0.0)),
        (-0.5, Twist2(0.22, 0.0, 1.0), FAST, 0, True, (0.0, 0.0)),
        # It slows down before it turns; a stop is legal though slower than both smallest speeds.
        (1.0, Twist2(0.22, 0.0, 1.0), FAST, 0, True, (0.0, 0.68)),
        (1.0, Twist2(0.22, 0.0, 0.0), FAST, 0, True, (0.0, 0.0)),
        # Turning is raised to the minimum after it was limited.
        (2.0, Twist2(), FAST, 0, True, (0.0, 1.37)),
        (-2.0, Twist2(), FAST, 0, True, (0.0, -1.37)),
        (2.0, Twist2(), FIXED, 0, True, (0.0, 0.32)),
        # A turn in collision is refused.
        (2.0, Twist2(), FAST, 254, False, (0.0, 0.0)),
    ],
)
def test_at_the_goal_it_stops_then_turns(error, twist, quirks, cells, ok, expected):
    dwa = controller(A2S, quirks)
    dwa.set_plan(straight(1.0))
    local = empty(1.0)
    local.cells[:] = cells
    answer = dwa.command(Pose2(0.95, 0.0, -error), twist, Pose2(), local)
    assert (answer.ok, answer.local_plan.shape) == (ok, (0, 2))
    assert (answer.twist.vx, answer.twist.wz) == pytest.approx(expected)


def test_each_axis_slows_down_by_what_it_can():
    strafing = replace(OMNI, yaw_goal_tolerance=0.5)
    dwa = controller(strafing)
    dwa.set_plan(straight(1.0))
    twist = Twist2(-0.2, -0.1, 0.9)
    slower = dwa.command(Pose2(1.0, 0.0, -1.0), twist, Pose2(), empty(1.0)).twist
    # Within 0.05 s: 0.125 m/s, 0.0625 m/s and 0.16 rad/s less.
    assert (slower.vx, slower.vy, slower.wz) == pytest.approx((-0.075, -0.0375, 0.74))


def turning(error, wz, parameters=A2S):
    """Return the turning speed at the goal of a robot that turns already."""
    dwa = controller(parameters)
    dwa.set_plan(straight(1.0))
    at = math.copysign(1.0, error)
    assert dwa.command(Pose2(1.0, 0.0, -at), Twist2(), Pose2(), empty(1.0)).ok
    return dwa.command(Pose2(1.0, 0.0, -error), Twist2(0, 0, wz), Pose2(), empty(1.0)).twist.wz


@pytest.mark.parametrize(
    ("error", "wz", "expected"),
    [
        (2.5, 2.4, 2.5),  # as fast as the error is large,
        (2.5, 2.0, 2.32),  # by 3.2 rad/s^2 * 0.1 s faster at most,
        (1.4, 2.0, 1.68),  # or slower,
        (0.6, 2.7, math.sqrt(2.0 * 3.2 * 0.6)),  # so that it can stop in time,
        (3.1, 2.7, 2.75),  # never beyond max_vel_theta,
        (3.1, 3.14, 2.75),
        (0.6, 1.0, 1.37),  # nor below min_vel_theta.
    ],
)
def test_the_speed_of_a_turn_at_the_goal(error, wz, expected):
    assert turning(error, wz) == pytest.approx(expected)
    assert turning(-error, -wz) == pytest.approx(-expected)


def test_after_it_has_turned_far_enough_it_stops_before_it_turns_again():
    dwa = controller()
    dwa.set_plan(straight(1.0))
    answers = [
        dwa.command(Pose2(1.0, 0.0, -yaw), Twist2(0.0, 0.0, wz), Pose2(), empty(1.0)).twist.wz
        for yaw, wz in ((1.0, 0.0), (0.4, 1.37), (1.0, 1.37), (1.0, 0.0))
    ]
    assert answers == pytest.approx([1.37, 0.0, 1.05, 1.37])


def test_turns_are_checked_against_the_distances_of_the_last_sampling_cycle():
    dwa = controller()
    dwa.set_plan(straight(1.0))
    local = empty(1.0)
    assert dwa.command(Pose2(0.8, 0.0, 0.0), Twist2(0.2, 0.0, 0.0), Pose2(), local).ok
    far = dwa.command(Pose2(1.09, 0.0, 2.0), Twist2(), Pose2(), local)
    assert far.ok
    walled = empty(1.0)
    walled.cells[:, 30:34] = 253
    assert dwa.command(Pose2(0.8, 0.0, 0.0), Twist2(0.2, 0.0, 0.0), Pose2(), walled).ok
    stuck = dwa.command(Pose2(1.06, 0.0, 2.0), Twist2(), Pose2(), empty(1.0))
    assert not stuck.ok


def test_the_distances_of_the_last_sampling_cycle_lead_to_every_corner_of_its_costmap():
    dwa = controller(replace(A2S, occdist_scale=0.0, sim_time=0.4))
    dwa.set_plan(straight(1.0))
    # The plan runs from column 30 to column 50 of row 30: cell (0, 0) is the furthest from it.
    assert dwa.command(Pose2(0.8, 0.0, 0.0), Twist2(0.2, 0.0, 0.0), Pose2(), empty()).ok
    # A costmap whose cell (0, 0) the robot stands in, at the goal, looking into the map.
    cornered = CostGrid(0.05, 0.98, -0.02, np.zeros((60, 60), dtype=np.uint8))
    assert dwa.command(Pose2(1.0, 0.0, 0.8), Twist2(), Pose2(), cornered).ok


@pytest.mark.parametrize(
    ("pose", "twist", "reached"),
    [
        # Tolerances belong to the goal: 0.5 m and 0.25 rad.
        (Pose2(0.5, 0.0, -0.25), Twist2(0.1, 0.0, 0.1), True),
        (Pose2(0.499, 0.0, 0.0), Twist2(), False),
        (Pose2(1.0, 0.49, 0.0), Twist2(-0.1, -0.1, -0.1), True),
        (Pose2(1.0, 0.51, 0.0), Twist2(), False),
        (Pose2(0.5, 0.0, -0.251), Twist2(), False),
        (Pose2(1.0, 0.0, 0.251), Twist2(), False),
        (Pose2(1.0), Twist2(0.11), False),
        (Pose2(1.0), Twist2(-0.11), False),
        (Pose2(1.0), Twist2(0.0, -0.11), False),
        (Pose2(1.0), Twist2(0.0, 0.0, -0.11), False),
    ],
)
def test_the_goal_is_reached_when_near_turned_and_standing(pose, twist, reached):
    dwa = controller(replace(A2S, xy_goal_tolerance=0.5, yaw_goal_tolerance=0.25))
    assert not dwa.goal_reached(pose, twist, Pose2())
    dwa.set_plan(straight(1.0))
    assert dwa.goal_reached(pose, twist, Pose2()) is reached
    assert not dwa.goal_reached(pose, twist, Pose2(2.0, 0.0, 0.0))


def test_a_latched_goal_stays_reached_until_the_next_plan():
    for latch in (False, True):
        dwa = controller(latch=latch)
        dwa.set_plan(straight(1.0))
        assert dwa.goal_reached(Pose2(1.0, 0.0, 0.0), Twist2(), Pose2())
        assert dwa.goal_reached(Pose2(0.8, 0.0, 0.0), Twist2(), Pose2()) is latch
        dwa.set_plan(straight(1.0))
        assert not dwa.goal_reached(Pose2(0.8, 0.0, 0.0), Twist2(), Pose2())


@pytest.mark.parametrize(("quirks", "free"), [(FAST, True), (FIXED, False)])
def test_new_plans_make_it_forget_that_it_turned_round(quirks, free):
    parameters = replace(A2S, min_vel_trans=0.0, min_vel_theta=0.0)
    dwa = controller(parameters, quirks)
    for yaw, vx in ((0.0, 0.2), (math.pi, -0.2)):
        dwa.set_plan(straight(yaw=yaw))
        answer = dwa.command(Pose2(), Twist2(vx, 0.0, 0.0), Pose2(), empty())
        assert answer.twist.vx * vx > 0.0
    dwa.set_plan(straight())
    answer = dwa.command(Pose2(), Twist2(0.1, 0.0, 0.0), Pose2(), empty())
    assert (answer.twist.vx > 0.0) is free


def test_pruning_forgets_the_plan_behind_the_robot():
    plan = np.concatenate([straight(2.5), straight(2.5)[::-1]])
    for prune in (False, True):
        dwa = controller(replace(A2S, prune_plan=prune))
        dwa.set_plan(plan)
        dwa.command(Pose2(1.2, 0.0, 0.0), Twist2(), Pose2(), empty(1.2))
        assert dwa._plan.forgotten == (9 if prune else 0)


def chosen(pose, plan, aligned, end):
    """Return what the plain version chooses, with the end of the plan pushed ahead to ``end``."""
    state, few = singles(pose.x, pose.y, pose.yaw, 0.1, 0.0, 0.0), settings(FEW)
    none = np.zeros(6, dtype=np.int32)
    poses = np.ascontiguousarray(plan[:, :2])
    problem = Problem(state, poses, np.array(end), aligned, few, empty(), SMALL, none)
    return Twist2(*problem.plain()[2].tolist())


FEW = replace(A2S, vx_samples=6, vth_samples=9)


def test_the_nose_counts_until_the_end_of_the_plan_is_near():
    plan = straight(0.5)
    answers = []
    for yaw in (-2.0, -1.2, -0.4, 0.4, 1.2, 2.0):
        pose = Pose2(-0.05, 0.1, yaw)
        # The way from the robot to the end, 0.55 m along and 0.1 m down, 0.325 m beyond it.
        way = math.atan2(-0.1, 0.55)
        end = (0.5 + 0.325 * math.cos(way), 0.325 * math.sin(way))
        # 0.3125 m^2 is its square: further than 0.325 m times the root of 2, not times that of 3.
        for factor, aligned in ((2.0, True), (3.0, False)):
            dwa = controller(replace(FEW, cheat_factor=factor))
            dwa.set_plan(plan)
            answer = dwa.command(pose, Twist2(0.1, 0.0, 0.0), Pose2(), empty())
            assert answer.twist == chosen(pose, plan, aligned, end)
            answers.append(answer.twist)
    assert answers[::2] != answers[1::2]


def test_a_costmap_of_another_size_or_place_takes_the_place_of_the_last():
    dwa = controller()
    dwa.set_plan(straight())
    twist = Twist2(0.1, 0.0, 0.0)
    expected = controller()
    expected.set_plan(straight())
    free = expected.command(Pose2(), twist, Pose2(), empty()).twist
    assert dwa.command(Pose2(), twist, Pose2(), empty()).twist == free
    walled = empty()
    walled.cells[:, 31] = 254
    assert not dwa.command(Pose2(), twist, Pose2(), walled).ok
    larger = CostGrid(0.05, -2.0, -2.0, np.zeros((80, 80), dtype=np.uint8))
    larger.cells[:, 41] = 254
    assert not dwa.command(Pose2(), twist, Pose2(), larger).ok
    larger.cells[:, 41] = 0
    larger.touch((0, 0, 80, 80))
    assert dwa.command(Pose2(), twist, Pose2(), larger).ok
    assert dwa.command(Pose2(), twist, Pose2(), empty()).ok


def test_what_is_kept_between_cycles_changes_no_command():
    rng = np.random.default_rng(5)
    kept = Dwa(A2S, FAST, SMALL, 0.1)
    local = CostGrid(0.05, -1.5, -1.5, blobs(rng, (60, 60), 4, 0.0))
    commands = set()
    for cycle in range(24):
        if cycle % 5 == 4:
            local.cells[:] = blobs(rng, (60, 60), 4, 0.0)
            local.touch((0, 0, 60, 60))
        x = 0.02 * cycle
        end = 1.0 if cycle < 16 else 1.2
        plan = np.column_stack([np.linspace(x, end, 40), np.full(40, 0.1), np.zeros(40)])
        pose, twist = Pose2(x, 0.0, 0.05 * cycle), Twist2(0.2, 0.0, rng.normal(0.0, 0.3))
        fresh = Dwa(A2S, FAST, SMALL, 0.1)
        answers = []
        for dwa in (kept, fresh):
            dwa.set_plan(plan)
            answers.append(dwa.command(pose, twist, Pose2(), local))
        assert answers[0].twist == answers[1].twist
        np.testing.assert_array_equal(answers[0].local_plan, answers[1].local_plan)
        commands.add(answers[0].twist)
    assert len(commands) > 8
