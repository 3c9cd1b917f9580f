"""What the search knows of samples before it follows any: where they end, what they cost."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.stacks.ros1.cost_grid import CostGrid
from tests.daemon.stacks.ros1.dwa import plain
from tests.daemon.stacks.ros1.dwa.helpers import A2S, OMNI, SMALL, random_problem, singles

FEW = replace(A2S, vx_samples=6, vth_samples=7, twirling_scale=0.3)


def problems(parameters, number, seed=3):
    rng = np.random.default_rng(seed)
    return [random_problem(rng, parameters) for _ in range(number)]


def over(problem, cost, radius=np.inf):
    """Return ``problem`` with one cost everywhere, or up to ``radius`` [m] from the robot."""
    local = problem.local
    rows, columns = np.indices(local.cells.shape)
    x = local.x + (columns + 0.5) * local.resolution - problem.state[0]
    y = local.y + (rows + 0.5) * local.resolution - problem.state[1]
    cells = np.where(np.hypot(x, y) <= radius, cost, 0).astype(np.uint8)
    return replace(problem, local=replace(local, cells=cells), outline=SMALL)


def assert_followed_in_order(problem):
    """Only samples that win, or were as good as the winner, were followed; the others' bounds
    are their costs, so that nothing better would have been known by following them.
    """
    n, room = problem.search()
    costs = problem.costs()
    assert (n > 0) == bool(np.isfinite(costs).any())
    bounds = room.lower[: len(costs)]
    left = np.isfinite(bounds)
    np.testing.assert_array_equal(bounds[left], costs[left])
    assert (costs[~left] <= costs.min())[np.isfinite(costs[~left])].all()


@pytest.mark.parametrize(
    "parameters",
    [
        FEW,
        replace(OMNI, vy_samples=3, vth_samples=5),
        replace(FEW, goal_distance_bias=0.0),
        replace(FEW, path_distance_bias=0.0, forward_point_distance=-0.2),
        replace(FEW, use_dwa=False),
    ],
)
@pytest.mark.parametrize("cost", [0, 50])
def test_bounds_are_costs_where_every_pose_costs_the_same(parameters, cost):
    for problem in problems(parameters, 6):
        if not parameters.use_dwa:
            # Which way an accelerating sample moves is known only once it was followed.
            problem.banned[:] = 0
        assert_followed_in_order(over(problem, cost))


def test_the_footprint_where_the_robot_is_counts_for_all_that_do_not_grow():
    parameters = replace(FEW, occdist_scale=1.0)
    for problem in problems(parameters, 4):
        assert_followed_in_order(over(problem, 90, radius=0.3))
    # Grown footprints may touch something else: nothing is known of them but where they end.
    growing = replace(parameters, max_vel_trans=0.25, max_vel_x=0.25, scaling_speed=0.12)
    for problem in problems(growing, 4):
        free = over(problem, 0)
        _, room = over(problem, 90, radius=0.1).search()
        costs = free.costs()
        speeds = np.abs(free.samples()[:, 0])
        left = np.isfinite(room.lower[: len(costs)]) & (speeds > 0.12)
        np.testing.assert_array_equal(room.lower[: len(costs)][left], costs[left])


def test_bounds_are_never_above_costs():
    for problem in problems(replace(FEW, occdist_scale=0.3), 12, seed=5):
        _, room = problem.search()
        costs = problem.costs()
        bounds = room.lower[: len(costs)]
        left = np.isfinite(bounds)
        assert (bounds[left] <= costs[left]).all()
        # What was dropped, or followed, is not better than the winner.
        assert (costs[~left] >= costs.min()).all()


def assert_ends_hold(problem):
    """Compare where samples end with where they were said to; return how many were unsure, sure."""
    unsure, known = 0, 0
    _, room = problem.search()
    local = problem.local
    frame = np.array((local.x, local.y, local.resolution))
    for sample, (centre, nose) in zip(problem.samples(), room.ends.tolist(), strict=False):
        points, _ = plain.trajectory(problem.state, sample, problem.settings)
        if centre == -3:
            assert len(points) == 0 or plain.oscillates(problem.banned, sample)
            continue
        x, y, yaw = points[-1].tolist()
        ahead = problem.settings.forward_point_distance
        spots = ((x, y), (x + ahead * np.cos(yaw), y + ahead * np.sin(yaw)))
        for end, spot in zip((centre, nose), spots, strict=True):
            row, column = plain.cell(*spot, local.cells, frame)
            unsure += end == -2
            known += end != -2
            place = row * local.cells.shape[1] + column if row >= 0 else -1
            assert end in (place, -2)
    return unsure, known


@pytest.mark.parametrize("parameters", [A2S, OMNI])
def test_ends_are_sure_or_said_to_be_unsure(parameters):
    counts = [assert_ends_hold(problem) for problem in problems(parameters, 6, seed=11)]
    unsure, known = np.sum(counts, axis=0)
    # Coordinates of 80 m have steps of 8e-6 m in single precision, cells are 0.05 m wide.
    assert unsure < 0.05 * known


def far_away(problem):
    """Return ``problem`` 1024 m further, where single precision has steps of 1.2e-4 m."""
    local, state = problem.local, problem.state.copy()
    state[:2] = np.float32(state[:2] + 1024.0)
    return replace(
        problem,
        state=state,
        plan=problem.plan + 1024.0,
        front_end=problem.front_end + 1024.0,
        local=replace(local, x=local.x + 1024.0, y=local.y + 1024.0),
    )


@pytest.mark.parametrize(
    ("parameters", "turning"),
    [
        # Nearly all points of these trajectories come from turning, and from driving.
        (replace(FEW, sim_granularity=1.0, sim_time=16.0, vth_samples=20), 1.0),
        (replace(FEW, sim_granularity=0.003, sim_time=5.0, acc_lim_theta=0.5), 0.05),
    ],
)
def test_the_more_steps_are_rounded_the_less_sure_ends_are(parameters, turning):
    for problem in problems(parameters, 12, seed=12):
        for vx, wz in ((0.2, turning), (-0.2, -turning)):
            problem.state[3:] = singles(vx, 0.0, wz)
            assert_ends_hold(far_away(over(problem, 0)))


def test_of_samples_that_cost_the_same_the_first_wins():
    parameters = replace(FEW, path_distance_bias=0.0, goal_distance_bias=0.0, twirling_scale=0.0)
    late = 0
    for problem in problems(parameters, 40, seed=2):
        place, cost, _, _ = problem.fast()
        costs = problem.costs()
        if place >= 0:
            assert (place, cost) == (int(np.argmin(costs)), costs.min())
            late += int((costs == cost).sum() > 1)
    assert late > 5


def among_thin_walls(problem, rng):
    """Return ``problem`` on a map of 1.1 m with rows of inscribed cells, which feet may touch."""
    cells = np.zeros((22, 22), dtype=np.uint8)
    for row, column in rng.integers(0, 22, (8, 2)).tolist():
        if rng.random() < 0.5:
            cells[row, column : column + 5] = 253
        else:
            cells[row : row + 5, column] = 253
    x, y = problem.state[:2].tolist()
    beside = rng.uniform(0.2, 0.9, 2)
    return replace(problem, local=CostGrid(0.05, x - beside[0], y - beside[1], cells))


@pytest.mark.parametrize(
    "parameters",
    [
        FEW,
        replace(FEW, path_distance_bias=0.0, occdist_scale=0.0),
        replace(FEW, goal_distance_bias=0.0, occdist_scale=0.0),
        replace(OMNI, vy_samples=3, vth_samples=5, occdist_scale=0.0),
        replace(FEW, path_distance_bias=0.0, goal_distance_bias=0.0),
        replace(FEW, path_distance_bias=0.0, goal_distance_bias=0.0, occdist_scale=0.0),
    ],
)
def test_no_pose_on_the_way_may_be_where_distances_do_not_go(parameters):
    rng = np.random.default_rng(17)
    legal = 0
    for problem in problems(parameters, 25, seed=8):
        walled = among_thin_walls(problem, rng)
        place, cost, velocity, _ = walled.fast()
        expected, least, command = walled.plain()
        assert (place, cost) == (expected, least)
        np.testing.assert_array_equal(velocity, command)
        legal += place >= 0
    assert legal > 5


def test_samples_that_leave_the_map_are_known_to():
    rng = np.random.default_rng(29)
    left = 0
    for problem in problems(replace(FEW, vth_samples=20), 20, seed=13):
        small = over(among_thin_walls(problem, rng), 0)
        assert_ends_hold(small)
        _, room = small.search()
        left += int((room.ends[: len(small.samples())] == -1).sum())
    assert left > 20


@pytest.mark.parametrize("critic", ["path_distance_bias", "goal_distance_bias"])
def test_samples_that_end_where_no_distance_leads_are_never_followed(critic):
    alone = {"path_distance_bias": 0.0, "goal_distance_bias": 0.0, "occdist_scale": 0.0}
    # 20 per metre is 1 per cell.
    parameters = replace(FEW, **(alone | {critic: 20.0}))
    rng = np.random.default_rng(23)
    dropped = 0
    for problem in problems(parameters, 25, seed=9):
        walled = among_thin_walls(problem, rng)
        n, room = walled.search()
        cells = walled.local.cells
        frame = np.array((walled.local.x, walled.local.y, walled.local.resolution))
        seeds = plain.seeds_of(walled.plan, cells, frame)
        if n == 0 or len(seeds) == 0:
            continue
        steps = plain.distances(seeds if critic.startswith("path") else seeds[-1:], cells)
        for sample, bound in zip(walled.samples(), room.lower.tolist(), strict=False):
            points, _ = plain.trajectory(walled.state, sample, walled.settings)
            row, column = plain.cell(*points[-1, :2], cells, frame) if len(points) else (-1, -1)
            if row >= 0 and steps[row, column] >= cells.size:
                assert bound == np.inf
                dropped += 1
    assert dropped > 20
