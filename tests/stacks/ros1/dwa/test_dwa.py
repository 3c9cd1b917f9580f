"""What the controller does with plans, goals and obstacles; its parts against numbers of ROS."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest

from daemon.stacks.ros1.base_local_planner.footprint import footprint_cost
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.dwa import DwaParameters
from daemon.stacks.ros1.dwa._scoring import allocate_scoring_grid
from daemon.stacks.ros1.dwa.controller import Dwa, Oscillation
from daemon.stacks.ros1.dwa.samples import footprint_scale, longest_trajectory, settings_of
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2, Twist2
from tests.stacks.ros1.dwa.helpers import A2S, OMNI, SMALL, Problem, blobs, settings, singles


def controller(parameters=A2S, quirks=FAST, *, latch=False):
    return Dwa(parameters, quirks, SMALL, 0.05, latch_goal=latch)


def empty(x=0.0, y=0.0):
    return CostGrid(0.05, x - 1.5, y - 1.5, np.zeros((60, 60), dtype=np.uint8))


def straight(length=3.0, yaw=0.0):
    along = np.arange(0.0, length + 1e-9, 0.025)
    plan = np.column_stack([along * math.cos(yaw), along * math.sin(yaw), np.zeros(len(along))])
    plan[-1, 2] = yaw
    return plan


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
    walled, larger = empty(), CostGrid(0.05, -2.0, -2.0, np.zeros((80, 80), dtype=np.uint8))
    walled.cells[:, 31] = larger.cells[:, 41] = 254
    for local, ok in ((empty(), True), (walled, False), (larger, False)):
        assert dwa.command(Pose2(), Twist2(0.1), Pose2(), local).ok is ok
    larger.cells[:, 41] = 0
    larger.touch((0, 0, 80, 80))
    for local in (larger, empty()):
        assert dwa.command(Pose2(), Twist2(0.1), Pose2(), local).ok


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
        memory.record((3.0, -2.0, 1.0), twist, 0.125)
    if at is not None:
        memory.record(at, twists[-1], 0.125)
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
    memory, banned = Oscillation(0.5, 0.25), []
    for x, vx in ((0.0, 0.2), (0.0, -0.2), (1.0, -0.2), (1.0, 0.2), (1.0, -0.2)):
        memory.record((x, 0.0, 0.0), (vx, 0.0, 0.0), 0.125)
        banned.append(memory.banned.tolist())
    assert banned[3:] == [[0] * 6, [0, 1, 0, 0, 0, 0]]


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
