"""Plans of GlobalPlanner: costs, modes, coordinates, failures, oddities and what is kept."""

import numpy as np
import pytest
from pydantic import ValidationError

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.global_planner import WITHOUT_EFFECT, GlobalPlannerParameters, warm_up
from daemon.stacks.ros1.global_planner.planner import GlobalPlanner, look_forward, planner_costs
from daemon.stacks.ros1.navfn.descent import descend_gradient, fill_around_goal
from daemon.stacks.ros1.navfn.propagation import propagate_wave
from daemon.stacks.ros1.navfn.restricted import any_is_doubtful, spread_towards
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2


def a_grid(rows=20, columns=40, x=0.0, y=0.0):
    return CostGrid(0.05, x, y, np.zeros((rows, columns), dtype=np.uint8))


def centre(grid, column, row, yaw=0.0):
    r = grid.resolution
    return Pose2(grid.x + (column + 0.5) * r, grid.y + (row + 0.5) * r, yaw)


def plan(grid, start, goal, **given):
    return GlobalPlanner(GlobalPlannerParameters(**given), FAST).plan(grid, start, goal)


def length_of(poses):
    return float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())


def test_costs_are_scaled_and_what_is_nearly_lethal_is_blocked():
    _, costs, gains = planner_costs(GlobalPlannerParameters())
    assert costs[[0, 1, 60, 67, 68, 251]].tolist() == [50, 53, 230, 251, 252, 252]
    assert costs[255] == 252
    assert np.isinf(gains[[252, 253, 254, 256 + 10]]).all()
    assert gains[0] == pytest.approx(0.707106781 * 50)
    gains = planner_costs(GlobalPlannerParameters(allow_unknown=False)).gains
    assert np.isinf(gains[255])


def test_costs_are_whole_numbers_and_gains_exact():
    _, costs, gains = planner_costs(GlobalPlannerParameters(neutral_cost=66, cost_factor=0.55))
    assert costs[1] == 66
    assert gains[1] == pytest.approx(0.707106781 * 66.55, rel=1e-6)


@pytest.mark.parametrize("old", [True, False])
def test_a_plan_leads_straight_along_a_free_row(old):
    grid = a_grid(x=-1.0, y=2.0)
    start, goal = Pose2(-0.72, 2.53, 0.3), Pose2(0.53, 2.53, 1.5)
    found = plan(grid, start, goal, old_navfn_behavior=old)
    assert found is not None
    at_start = (-0.75, 2.5) if old else (start.x, start.y)
    assert found[0, :2].tolist() == pytest.approx(at_start)
    assert found[-1].tolist() == [goal.x, goal.y, goal.yaw]
    assert length_of(found) == pytest.approx(1.25, abs=0.06)
    assert np.abs(found[:, 1] - start.y).max() <= 0.03 + 1e-6


def test_a_plan_starts_where_the_robot_is_inside_its_cell():
    grid = a_grid()
    start, goal = Pose2(0.263, 0.517), Pose2(1.511, 0.486, 1.0)
    found = plan(grid, start, goal)
    assert found is not None
    assert found[0, :2].tolist() == pytest.approx([start.x, start.y], abs=1e-6)
    assert found[-2, :2].tolist() == pytest.approx([goal.x, goal.y], abs=1e-6)
    steps = np.hypot(*np.diff(found[1:-1, :2], axis=0).T)
    assert steps == pytest.approx(0.025, abs=1e-5)


def test_a_plan_avoids_costs():
    grid = a_grid()
    grid.cells[9:12, 8:28] = 230
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    around = plan(grid, start, goal)
    assert around is not None
    assert np.abs(around[:, 1] - start.y).max() > 0.1


def test_the_start_cell_is_freed_in_the_costmap_for_good():
    grid = a_grid()
    grid.cells[10, 5] = 254
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    assert GlobalPlanner(GlobalPlannerParameters(), FIXED).plan(grid, start, goal) is not None
    assert grid.cells[10, 5] == 254
    version = grid.version
    assert plan(grid, start, goal) is not None
    assert grid.cells[10, 5] == 0
    assert grid.version == version + 1


def test_without_the_quirk_only_the_cell_of_the_robot_is_free_and_only_for_the_planner():
    grid = a_grid()
    grid.cells[:, 20] = 254
    planner = GlobalPlanner(GlobalPlannerParameters(old_navfn_behavior=True), FIXED)
    goal = centre(grid, 30, 10)
    assert planner.plan(grid, centre(grid, 20, 10), goal) is not None
    assert planner.plan(grid, centre(grid, 5, 10), goal) is None
    assert (grid.cells[:, 20] == 254).all()


def test_no_plan_to_what_cannot_be_reached():
    grid = a_grid()
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    assert plan(grid, start, centre(grid, 45, 10)) is None
    assert plan(grid, centre(grid, -1, 10), goal) is None
    assert plan(grid, start, centre(grid, 39, 10)) is None
    grid.cells[:, 20] = 254
    assert plan(grid, start, goal) is None


def test_a_blocked_goal_has_no_plan_whatever_the_tolerance():
    grid = a_grid()
    grid.cells[9:12, 29:32] = 254
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    assert plan(grid, start, goal, default_tolerance=0.5) is None


def test_a_robot_with_all_cells_around_it_blocked_is_boxed_in():
    grid = a_grid()
    grid.cells[7:14, 2:9] = 254
    assert plan(grid, centre(grid, 5, 10), centre(grid, 30, 10)) is None


def test_unknown_cells_are_dear_or_blocked():
    grid = a_grid()
    grid.cells[:, 20] = 255
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    assert plan(grid, start, goal) is not None
    assert plan(grid, start, goal, allow_unknown=False) is None


def test_the_lethal_cost_decides_what_is_blocked():
    grid = a_grid()
    grid.cells[:, 20] = 120
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    assert plan(grid, start, goal) is not None
    assert plan(grid, start, goal, lethal_cost=121) is None
    assert plan(grid, start, goal, lethal_cost=122) is not None


def test_the_outline_closes_the_border_for_this_planner_only():
    grid = a_grid()
    grid.cells[:-1, 20] = 254
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    assert plan(grid, start, goal) is None
    assert not grid.cells[-1].any()
    assert plan(grid, start, goal, outline_map=False) is not None


def test_the_neutral_cost_weighs_length_against_costs():
    grid = a_grid(40, 40)
    grid.cells[5:35, 19:22] = 40
    start, goal = centre(grid, 5, 20), centre(grid, 35, 20)
    near = plan(grid, start, goal, neutral_cost=200, cost_factor=0.5)
    far = plan(grid, start, goal, neutral_cost=1, cost_factor=5.0)
    assert near is not None
    assert far is not None
    assert length_of(near) < 1.6 < length_of(far)


def test_as_navfn_the_goal_stands_twice_at_the_end():
    grid = a_grid()
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10, 1.0)
    parameters = GlobalPlannerParameters(old_navfn_behavior=True)
    twice = GlobalPlanner(parameters, FAST).plan(grid, start, goal)
    once = GlobalPlanner(parameters, FIXED).plan(grid, start, goal)
    assert twice is not None
    assert once is not None
    assert twice[-2, :2].tolist() == [goal.x, goal.y]
    assert len(once) == len(twice) - 1
    assert np.array_equal(once[-1], twice[-1])


def test_near_the_border_of_a_map_without_outline_nothing_lies_beyond():
    grid = a_grid(6, 8)
    for column, row in ((0, 0), (7, 0), (0, 5), (7, 5), (3, 5), (3, 0)):
        for start, goal in (((3, 3), (column, row)), ((column, row), (3, 3))):
            found = plan(grid, centre(grid, *start), centre(grid, *goal), outline_map=False)
            assert found is None or np.isfinite(found).all()


def test_what_did_not_change_is_not_planned_again(monkeypatch):
    calls = []

    def counted(*arguments):
        calls.append(arguments)
        return propagate_wave(*arguments)

    monkeypatch.setattr("daemon.stacks.ros1.navfn.field.propagate_wave", counted)
    grid = a_grid()
    planner = GlobalPlanner(GlobalPlannerParameters(), FAST)
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    first, second = planner.plan(grid, start, goal), planner.plan(grid, start, goal)
    assert first is not None
    assert second is not None
    assert first is not second
    assert np.array_equal(first, second)
    assert len(calls) == 1
    grid.touch((0, 0, 40, 20))
    planner.plan(grid, start, goal)
    assert len(calls) == 1
    grid.cells[5, 5] = 30
    grid.touch((5, 5, 6, 6))
    planner.plan(grid, start, goal)
    assert len(calls) == 2
    planner.plan(grid, Pose2(start.x + 0.001, start.y), goal)
    assert len(calls) == 3


def test_a_long_history_of_plans_leaves_no_trace_in_the_next_one():
    random = np.random.default_rng(4)
    grid = a_grid(50, 60)
    grid.cells[:] = random.choice([0, 0, 0, 40, 120, 254], size=grid.cells.shape)
    old = GlobalPlanner(GlobalPlannerParameters(), FIXED)
    for _ in range(30):
        x, y = random.random((2, 2)) * [[3.0], [2.5]]
        trip = Pose2(float(x[0]), float(y[0])), Pose2(float(x[1]), float(y[1]))
        found = old.plan(grid, *trip)
        fresh = GlobalPlanner(GlobalPlannerParameters(), FIXED).plan(grid, *trip)
        assert (found is None) == (fresh is None)
        assert found is None or fresh is None or np.array_equal(found, fresh)


def test_parameters_are_those_of_noetic_and_checked():
    defaults = GlobalPlannerParameters()
    assert (defaults.lethal_cost, defaults.neutral_cost, defaults.cost_factor) == (253, 50, 3.0)
    assert (defaults.orientation_mode, defaults.orientation_window_size) == (1, 1)
    assert "default_tolerance" in WITHOUT_EFFECT
    for wrong in ({"lethal_cost": 256}, {"lethal_cost": 1}, {"cost_factor": 6.0}):
        with pytest.raises(ValidationError):
            GlobalPlannerParameters(**wrong)
    with pytest.raises(ValidationError):
        GlobalPlannerParameters(orientation_mode=7)


@pytest.mark.parametrize(
    ("refused", "words"),
    [
        ({"use_dijkstra": False}, r"A\* is not built in: write true"),
        ({"use_quadratic": False}, "plain potentials are not built in: write true"),
        ({"use_grid_path": True}, "paths from cell to cell are not built in: write false"),
        ({"orientation_mode": 3}, "only 0 .* and 1 .* are built in"),
    ],
)
def test_a_way_of_planning_that_is_not_built_in_is_refused(refused, words):
    with pytest.raises(ValidationError, match=words):
        GlobalPlannerParameters(**refused)


def test_everything_is_compiled_by_the_warm_up_and_only_once():
    warm_up()
    kernels = (
        propagate_wave, spread_towards, any_is_doubtful, fill_around_goal, descend_gradient,
        look_forward,
    )  # fmt: skip
    grid = a_grid()
    plan(grid, centre(grid, 5, 10), centre(grid, 30, 10))
    assert [len(kernel.signatures) for kernel in kernels] == [1] * len(kernels)


def yaws_of_a_corner(window):
    """Ten points east, ten points north, the goal at the end with yaw 2."""
    east = [(0.1 * k, 0.0, 0.0) for k in range(10)]
    north = [(1.0, 0.1 * k, 0.0) for k in range(10)]
    poses = np.array([*east, *north, (1.0, 1.0, 2.0)])
    look_forward(poses, window)
    return poses[:, 2]


def test_points_look_along_the_path():
    yaws = yaws_of_a_corner(1)
    assert yaws[[3, 10, 15, -1]] == pytest.approx([0.0, np.pi / 4, np.pi / 2, 2.0])


def test_a_wider_window_smooths_the_corner():
    narrow, wide = yaws_of_a_corner(1), yaws_of_a_corner(5)
    assert np.abs(np.diff(wide[:-1])).max() < np.abs(np.diff(narrow[:-1])).max()


def test_without_an_orientation_only_the_goal_has_a_yaw():
    grid = a_grid()
    found = plan(grid, Pose2(0.4, 0.3), Pose2(1.4, 0.6, 1.0), orientation_mode=0)
    assert found is not None
    assert found[:, 2].tolist() == [0.0] * (len(found) - 1) + [1.0]
