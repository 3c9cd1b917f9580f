"""Plans of GlobalPlanner: oddities, where there is none, what is kept, parameters."""

import numpy as np
import pytest
from pydantic import ValidationError

from daemon.stacks.ros1.global_planner import GlobalPlannerParameters
from daemon.stacks.ros1.global_planner.planner import GlobalPlanner, look_forward
from daemon.stacks.ros1.navfn.propagation import propagate_wave
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2
from tests.stacks.ros1.navfn.fields import a_grid, centre


def plan(grid, start, goal, **given):
    return GlobalPlanner(GlobalPlannerParameters(**given), FAST).plan(grid, start, goal)


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


def test_the_outline_closes_the_border_for_this_planner_only():
    grid = a_grid()
    grid.cells[:-1, 20] = 254
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    assert plan(grid, start, goal) is None
    assert not grid.cells[-1].any()
    assert plan(grid, start, goal, outline_map=False) is not None


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


def test_parameters_are_those_of_noetic_and_checked():
    defaults = GlobalPlannerParameters()
    assert (defaults.lethal_cost, defaults.neutral_cost, defaults.cost_factor) == (253, 50, 3.0)
    assert (defaults.orientation_mode, defaults.orientation_window_size) == (1, 1)
    assert "default_tolerance" in GlobalPlannerParameters.without_effect
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


def test_points_look_along_the_path():
    east = [(0.1 * k, 0.0, 0.0) for k in range(10)]
    north = [(1.0, 0.1 * k, 0.0) for k in range(10)]
    poses = np.array([*east, *north, (1.0, 1.0, 2.0)])
    look_forward(poses, 1)
    assert poses[[3, 10, 15, -1], 2] == pytest.approx([0.0, np.pi / 4, np.pi / 2, 2.0])
