"""Plans of navfn: costs, interpolation, coordinates, failures and tolerance."""

import numpy as np
import pytest
from pydantic import ValidationError

from daemon.stacks import warm_up
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.navfn import WITHOUT_EFFECT, NavfnParameters
from daemon.stacks.ros1.navfn.descent import descend_gradient, path_to_poses
from daemon.stacks.ros1.navfn.planner import Navfn
from daemon.stacks.ros1.navfn.propagation import (
    copy_window,
    interpolate_potential,
    navfn_costs,
    propagate_wave,
    reset_potentials,
)
from daemon.stacks.ros1.navfn.restricted import (
    clear_doubts,
    descent_is_doubtful,
    relax_lowered_costs,
    spread_towards,
)
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2

F = np.float32


def a_grid(rows=20, columns=40, x=0.0, y=0.0):
    return CostGrid(0.05, x, y, np.zeros((rows, columns), dtype=np.uint8))


def centre(grid, column, row, yaw=0.0):
    r = grid.resolution
    return Pose2(grid.x + (column + 0.5) * r, grid.y + (row + 0.5) * r, yaw)


def plan(grid, start, goal, *, tolerance=0.0, unknown=True):
    parameters = NavfnParameters(default_tolerance=tolerance, allow_unknown=unknown)
    return Navfn(parameters, FAST).plan(grid, start, goal)


def test_costs_rise_with_the_costmap_and_inscribed_cells_are_blocked():
    table, without = (navfn_costs(allow_unknown=known).states for known in (True, False))
    assert [int(table[v]) for v in (0, 1, 100, 161, 252)] == [50, 50, 130, 178, 251]
    assert [int(table[v]) for v in (253, 254, 255)] == [254, 254, 253]
    assert int(without[255]) == 254


@pytest.mark.parametrize(
    ("across", "along", "expected"),
    [
        (100.0, 100.0, 100.0 + 50.0 * 0.704),
        (100.0, 125.0, 100.0 + 50.0 * (-0.2301 * 0.25 + 0.5307 * 0.5 + 0.704)),
        (100.0, 150.0, 150.0),
        (1e10, 100.0, 150.0),
        (100.0, 1e10, 150.0),
    ],
)
def test_a_cell_is_interpolated_between_its_two_lowest_neighbours(across, along, expected):
    assert interpolate_potential(F(across), F(along), F(50.0)) == pytest.approx(expected, rel=1e-6)


def test_a_straight_path_runs_from_corner_to_corner_half_a_cell_at_a_time():
    grid = a_grid(x=-1.0, y=2.0)
    found = plan(grid, centre(grid, 5, 10), centre(grid, 30, 10, 1.5))
    assert found is not None
    assert found[0].tolist() == pytest.approx([-1.0 + 5 * 0.05, 2.0 + 10 * 0.05, 0.0])
    assert found[-1].tolist() == pytest.approx([-1.0 + 30.5 * 0.05, 2.0 + 10.5 * 0.05, 1.5])
    assert (found[:-1, 2] == 0.0).all()
    steps = np.hypot(*np.diff(found[1:-3, :2], axis=0).T)
    assert steps == pytest.approx(0.025, abs=1e-5)


def test_without_the_quirk_paths_run_through_cell_centres():
    grid = a_grid()
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    corner = Navfn(NavfnParameters(), FAST).plan(grid, start, goal)
    middle = Navfn(NavfnParameters(), FIXED).plan(grid, start, goal)
    assert corner is not None
    assert middle is not None
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


def test_no_plan_to_what_cannot_be_reached():
    grid = a_grid()
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    grid.cells[10, 30] = 253
    assert plan(grid, start, goal) is None
    grid.cells[10, 30] = 0
    grid.cells[:, 20] = 253
    assert plan(grid, start, goal) is None
    assert plan(grid, start, centre(grid, 45, 10)) is None
    assert plan(grid, centre(grid, -1, 10), goal) is None
    assert plan(grid, start, centre(grid, 0, 10)) is None


def test_a_robot_inside_an_inflated_wall_is_boxed_in():
    grid = a_grid()
    grid.cells[8:13, 3:8] = 253
    assert plan(grid, centre(grid, 5, 10), centre(grid, 30, 10)) is None


def test_unknown_cells_are_dear_or_blocked():
    grid = a_grid()
    grid.cells[:, 20] = 255
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    assert plan(grid, start, goal) is not None
    assert plan(grid, start, goal, unknown=False) is None


def test_with_tolerance_the_nearest_point_of_a_square_raster_will_do():
    grid = a_grid()
    grid.cells[10, 30] = 254
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10, 0.7)
    found = plan(grid, start, goal, tolerance=0.1)
    assert found is not None
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


def test_parameters_are_those_of_noetic_and_checked():
    defaults = NavfnParameters()
    assert (defaults.allow_unknown, defaults.default_tolerance) == (True, 0.0)
    assert set(WITHOUT_EFFECT) <= set(NavfnParameters.__dataclass_fields__)
    with pytest.raises(ValidationError):
        NavfnParameters(default_tolerance=-0.1)


def test_everything_is_compiled_by_the_warm_up_and_only_once():
    warm_up()
    kernels = (
        copy_window, propagate_wave, spread_towards, descent_is_doubtful, clear_doubts,
        descend_gradient, reset_potentials, path_to_poses, relax_lowered_costs,
    )  # fmt: skip
    grid = a_grid()
    plan(grid, centre(grid, 5, 10), centre(grid, 30, 10), tolerance=0.1)
    assert [len(kernel.signatures) for kernel in kernels] == [1] * len(kernels)
