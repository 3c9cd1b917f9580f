"""Plans of navfn: what differs by quirks, where there is none, tolerance, what is compiled."""

import numpy as np
import pytest

from daemon.stacks.ros1.navfn import NavfnParameters
from daemon.stacks.ros1.navfn.planner import Navfn
from daemon.stacks.ros1.quirks import FAST, FIXED
from tests.stacks.ros1.navfn.fields import a_grid, centre


def plan(grid, start, goal, tolerance=0.0):
    return Navfn(NavfnParameters(default_tolerance=tolerance), FAST).plan(grid, start, goal)


def test_without_the_quirk_paths_run_through_cell_centres():
    grid = a_grid()
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    corner = Navfn(NavfnParameters(), FAST).plan(grid, start, goal)
    middle = Navfn(NavfnParameters(), FIXED).plan(grid, start, goal)
    assert middle[:-1, :2] - corner[:-1, :2] == pytest.approx(0.025)


def test_the_start_cell_is_freed_in_the_costmap_for_good():
    grid = a_grid()
    grid.cells[10, 5] = 254
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    assert Navfn(NavfnParameters(), FIXED).plan(grid, start, goal) is not None
    assert grid.cells[10, 5] == 254
    version = grid.version
    assert plan(grid, start, goal) is not None
    assert grid.cells[10, 5] == 0
    assert grid.version == version + 1


def test_with_tolerance_the_nearest_point_of_a_square_raster_will_do():
    grid = a_grid()
    grid.cells[10, 30] = 254
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10, 0.7)
    found = plan(grid, start, goal, tolerance=0.1)
    assert np.abs(found[-1, :2] - (goal.x, goal.y)).max() == pytest.approx(0.05)
    assert found[-1, 2] == 0.7
    grid.cells[7:14, 27:34] = 254
    assert plan(grid, start, goal, tolerance=0.1) is None


def test_two_planners_of_one_costmap_both_see_its_changes():
    grid = a_grid()
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    planners = [Navfn(NavfnParameters(), FAST) for _ in range(2)]
    free = [planner.plan(grid, start, goal) for planner in planners]
    grid.cells[:, 20] = 254
    grid.touch((20, 0, 21, 20))
    assert all(plan is not None for plan in free)
    assert [planner.plan(grid, start, goal) is None for planner in planners] == [True, True]
