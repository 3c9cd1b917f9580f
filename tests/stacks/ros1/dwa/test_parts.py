"""Samples, trajectories, distances, footprints and memory, against numbers of the original."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from daemon.stacks.ros1.base_local_planner.followed_plan import transform_plan_window
from daemon.stacks.ros1.base_local_planner.footprint import footprint_cost
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.dwa import DwaParameters
from daemon.stacks.ros1.dwa._distances import allocate_scoring_grid
from daemon.stacks.ros1.dwa.controller import Oscillation
from daemon.stacks.ros1.dwa.samples import (
    count_points,
    dynamic_window,
    footprint_scale,
    sample_axis,
    simulate_trajectory,
)
from daemon.stacks.ros1.quirks import FAST, FIXED
from tests.stacks.ros1.dwa import plain
from tests.stacks.ros1.dwa.helpers import A2S, OMNI, SMALL, settings, singles


def counts(parameters, vx):
    """Return how many samples there are, and how many of them are legal."""
    s = settings(parameters)
    samples = plain.raw_samples(singles(0, 0, 0, vx, 0, 0), 5.0, s)
    legal = [count_points(math.hypot(x, y), w, s) > 0 for x, y, w in samples.tolist()]
    return len(samples), sum(legal)


@pytest.mark.parametrize(
    ("parameters", "vx", "expected"),
    [
        (A2S, 0.0, (861, 410)),
        (A2S, 0.22, (861, 369)),
        (OMNI, 0.22, (1155, 945)),
    ],
)
def test_numbers_of_samples(parameters, vx, expected):
    assert counts(parameters, vx) == expected


def test_spread_has_both_ends_and_a_zero():
    out = np.zeros(10)
    expected = singles(-0.3, 0.0, 0.1, 0.5).tolist()
    assert out[: sample_axis(-0.3, 0.5, 3, out)].tolist() == expected
    assert out[: sample_axis(0.2, 0.4, 1, out)].tolist() == singles(0.2, 0.4).tolist()
    assert out[: sample_axis(0.2, 0.2, 5, out)].tolist() == singles(0.2).tolist()


def test_a_measured_strafe_leaks_into_the_samples():
    state, out = singles(0, 0, 0, 0.1, 0.003, 0), np.zeros((3, 2))
    dynamic_window(state, 5.0, settings(), out)
    values = np.zeros(4)
    assert values[: sample_axis(out[1, 0], out[1, 1], 1, values)].tolist() == [
        float(np.float32(0.003)),
        0.0,
    ]
    dynamic_window(state, 5.0, settings(A2S, FIXED), out)
    assert out[1].tolist() == [0.0, 0.0]


def test_without_the_dynamic_window_all_that_is_reached_within_the_simulated_time_is_tried():
    out = np.zeros((3, 2))
    s = settings(replace(OMNI, use_dwa=False, sim_time=0.5, acc_lim_x=0.25, acc_lim_theta=3.0))
    # 0.125 m/s, 0.625 m/s and 1.5 rad/s from what it drives, and no further than to the goal.
    dynamic_window(singles(0, 0, 0, 0.25, 0.0, 0.5), 5.0, s, out)
    assert out.tolist() == [
        singles(*axis).tolist() for axis in ((0.125, 0.22), (-0.11, 0.11), (-1.0, 2.0))
    ]
    dynamic_window(singles(0, 0, 0, 0.25, 0.0, 0.5), 0.03125, s, out)
    assert out[:2].tolist() == [
        singles(*axis).tolist() for axis in ((0.125, 0.11), (-0.11, 0.0625))
    ]


@pytest.mark.parametrize(
    ("vx", "wz", "sim_time", "points"),
    [(0.22, 0.0, 1.5, 14), (0.22, 0.0, 2.5, 22), (0.0, 2.75, 1.5, 42), (0.0, 2.75, 2.5, 69)],
)
def test_numbers_of_points(vx, wz, sim_time, points):
    s = settings(replace(A2S, sim_time=sim_time))
    row, moving = np.zeros((80, 5)), np.zeros(3)
    vx, wz = singles(vx, wz).tolist()
    assert simulate_trajectory(singles(1, 2, 0, 0, 0, 0), vx, 0.0, wz, s, row, moving) == points
    assert row[0, :3].tolist() == [1.0, 2.0, 0.0]
    assert row[points - 1, 0] == pytest.approx(1.0 + vx * sim_time * (points - 1) / points)
    assert row[points - 1, 2] == pytest.approx(wz * sim_time * (points - 1) / points, abs=1e-5)


def test_slow_samples_and_fast_ones_are_illegal():
    s = settings()
    assert count_points(0.1, 1.36, s) == 0
    assert count_points(0.1, 1.37, s) > 0
    assert count_points(0.1099999, 0.0, s) > 0
    assert count_points(0.2202, 0.0, s) == 0


def footprint(cells, outline=SMALL, *, inside=False):
    pose = np.array((1.51, 1.51, 0.0, 1.0, 0.0))
    spans = np.zeros((60 if inside else 0, 2), dtype=np.int32)
    frame = np.array((0.0, 0.0, 0.05))
    return footprint_cost(cells.astype(np.uint8), frame, outline, 1.0, pose, spans)


def test_lethal_and_unknown_under_the_outline_reject_and_inscribed_does_not():
    for value, expected in ((254, -1), (255, -1), (253, 253), (7, 7)):
        cells = np.zeros((60, 60))
        cells[28, 30] = value
        assert footprint(cells) == expected


def test_what_the_outline_encloses_counts_only_without_the_quirk():
    cells, large = np.zeros((60, 60)), 3.0 * SMALL
    cells[32, 32] = 254
    assert footprint(cells, large) == 0
    assert footprint(cells, large, inside=True) == -1
    cells[32, 32] = 200
    assert footprint(cells, large, inside=True) == 200


def test_rows_of_an_upright_costmap_all_have_room_for_what_an_outline_encloses():
    upright = CostGrid(0.05, -0.5, -1.5, np.zeros((60, 20), dtype=np.uint8))
    upright.cells[57, 10] = 254
    outline, pose = 2.0 * SMALL, np.array((0.0, 1.3, 0.0, 1.0, 0.0))
    for quirks, expected in ((FAST, 0), (FIXED, -1)):
        none = np.zeros(6, dtype=np.int32)
        grid = allocate_scoring_grid(upright, settings(A2S, quirks), outline, none)
        found = footprint_cost(grid.cells, grid.frame, outline, 1.0, pose, grid.spans)
        assert found == expected


def test_the_centre_counts_and_a_corner_off_the_window_rejects():
    cells = np.zeros((60, 60))
    cells[30, 30] = 254
    assert footprint(cells, 3.0 * SMALL) == 254
    assert footprint(np.zeros((60, 60)), 20.0 * SMALL) == -1


def test_two_corners_are_a_circle_that_inscribed_cells_stop():
    cells = np.zeros((60, 60))
    cells[30, 30] = 252
    assert footprint(cells, SMALL[:2]) == 252
    cells[30, 30] = 253
    assert footprint(cells, SMALL[:2]) == -1


def test_the_footprint_grows_beyond_the_scaling_speed():
    s = settings(replace(A2S, max_vel_trans=0.45, scaling_speed=0.25, max_scaling_factor=0.2))
    assert footprint_scale(0.25, s) == 1.0
    assert footprint_scale(0.35, s) == pytest.approx(1.1)
    assert footprint_scale(0.45, s) == pytest.approx(1.2)
    # Nothing lies between two equal speeds; who does not want it to grow has a factor of 0.
    equal = replace(A2S, max_vel_trans=0.25, scaling_speed=0.25, max_scaling_factor=0.2)
    assert footprint_scale(0.26, settings(equal)) == math.inf
    assert footprint_scale(0.26, settings(replace(equal, max_scaling_factor=0.0))) == 1.0


def test_the_window_of_a_plan_ends_behind_the_first_pose_too_far_away():
    plan = np.column_stack([np.arange(-4.0, 4.01, 0.5), np.zeros(17), np.zeros(17)])
    out, turned = np.zeros((17, 2)), (1.0, 0.0, 0.0, 1.0)
    first, n, behind = transform_plan_window(plan, 0, turned, (0.0, 0.0), (1.0, 0.75), 1.2, out)
    assert first == 6
    # Less than 1 m from the robot is the pose at 0, the third.
    assert behind == 2
    np.testing.assert_allclose(out[:n, 1], [-1.0, -0.5, 0.0, 0.5, 1.0, 1.5], atol=1e-12)
    np.testing.assert_allclose(out[:n, 0], 1.0, atol=1e-12)


def test_a_change_of_direction_is_final_until_the_robot_has_moved():
    memory, here = Oscillation(0.05, 0.2), (0.0, 0.0, 0.0)
    memory.chosen(here, (0.2, 0.0, 0.3), 0.11)
    assert not memory.banned.any()
    memory.chosen(here, (-0.1, 0.0, 0.3), 0.11)
    assert memory.banned.tolist() == [0, 1, 0, 0, 0, 0]
    memory.chosen(here, (-0.1, 0.0, -0.3), 0.11)
    assert memory.banned.tolist() == [0, 1, 0, 0, 0, 1]
    memory.chosen((0.051, 0.0, 0.0), (-0.1, 0.0, -0.3), 0.11)
    assert not memory.banned.any()


def ruled_out(*twists, at=None):
    """Return what is ruled out after commands at one place and, maybe, the last one again."""
    memory = Oscillation(0.5, 0.25)
    for twist in twists:
        memory.chosen((3.0, -2.0, 1.0), twist, 0.125)
    if at is not None:
        memory.chosen(at, twists[-1], 0.125)
    return memory.banned.tolist()


def test_turning_and_strafing_are_remembered_only_when_slow():
    for vx, remembered in ((0.2, False), (-0.2, False), (0.125, True), (-0.125, True)):
        turned = ruled_out((vx, 0.0, 0.3), (vx, 0.0, -0.3))
        assert turned == [0, 0, 0, 0, 0, int(remembered)]
        strafed = ruled_out((vx, -0.1, 0.0), (vx, 0.1, 0.0))
        assert strafed == [0, 0, int(remembered), 0, 0, 0]


def test_the_sign_before_a_stop_counts():
    assert ruled_out((-0.2, 0.0, 0.0), (0.0, 0.0, 0.0), (0.2, 0.0, 0.0)) == [1, 0, 0, 0, 0, 0]
    assert ruled_out((0.2, 0.0, 0.0), (0.0, 0.0, 0.0), (0.2, 0.0, 0.0)) == [0] * 6


def test_what_is_ruled_out_is_free_again_beyond_the_distance_or_the_angle():
    turn_round = ((0.2, 0.0, 0.0), (-0.2, 0.0, 0.0))
    for dx, dy, dyaw, free in (
        (0.5, 0.0, 0.0, False),
        (0.0, -0.5, 0.0, False),
        (0.0, 0.0, -0.25, False),
        (0.501, 0.0, 0.0, True),
        (0.0, -0.501, 0.0, True),
        (0.36, 0.36, 0.0, True),
        (0.0, 0.0, 0.251, True),
    ):
        at = (3.0 + dx, -2.0 + dy, 1.0 + dyaw)
        assert (ruled_out(*turn_round, at=at) == [0] * 6) is free
    # Free again, the robot may turn round once more before that is ruled out.
    memory = Oscillation(0.5, 0.25)
    for x, vx in ((0.0, 0.2), (0.0, -0.2), (1.0, -0.2), (1.0, 0.2)):
        memory.chosen((x, 0.0, 0.0), (vx, 0.0, 0.0), 0.125)
    assert not memory.banned.any()
    memory.chosen((1.0, 0.0, 0.0), (-0.2, 0.0, 0.0), 0.125)
    assert memory.banned.tolist() == [0, 1, 0, 0, 0, 0]


def test_values_out_of_range_and_unknown_names_are_refused():
    for wrong in ({"sim_granularity": 0.0}, {"sim_time": math.nan}, {"max_rot_vel": 1.0}):
        with pytest.raises(ValidationError):
            DwaParameters(**wrong)
    assert "stop_time_buffer" in DwaParameters.without_effect
    assert "scaling_speed" not in DwaParameters.without_effect
