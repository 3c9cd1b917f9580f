"""The restricted wave against the whole one, path for path."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.global_planner import GlobalPlannerParameters
from daemon.stacks.ros1.global_planner.planner import GlobalPlanner, potential_field
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2
from tests.stacks.ros1.navfn.test_identity import disturb, random_cells


def a_planner(grid, parameters, quirks, **given):
    """Return a planner whose field has other margins, or is sooner restricted."""
    planner = GlobalPlanner(parameters, quirks)
    planner._field = potential_field(grid, parameters, quirks, **given)
    return planner


def waves(planner):
    """Return how many restricted and whole waves gave an answer."""
    field = planner._field
    assert field is not None
    return field.restricted, field.whole


@given(
    st.integers(0, 2**32 - 1),
    st.booleans(),
    st.sampled_from([FAST, FIXED]),
    st.sampled_from([(3.0, 50), (0.55, 66), (1.0, 30)]),
)
def test_plans_stay_the_same_while_costs_and_start_change(seed, old, quirks, costs):
    random = np.random.default_rng(seed)
    cells = random_cells(random, 20, 110)
    grids = [CostGrid(0.05, 0.0, 0.0, cells.copy()) for _ in range(2)]
    parameters = GlobalPlannerParameters(
        old_navfn_behavior=old, cost_factor=costs[0], neutral_cost=costs[1]
    )
    size = np.array(cells.shape[::-1]) * 0.05
    goal = Pose2(*(random.random(2) * size).tolist())
    place = random.random(2) * size
    chosen = tuple(np.sort(random.integers(100, 2500, 3)).astype(float).tolist())
    planners = [
        a_planner(grid, parameters, quirks, margins=margins, worthwhile=1)
        for grid, margins in zip(grids, (chosen, ()), strict=True)
    ]
    for _ in range(10):
        start = Pose2(*place.tolist())
        found, expected = (
            planner.plan(grid, start, goal) for planner, grid in zip(planners, grids, strict=True)
        )
        assert (found is None) == (expected is None)
        assert found is None or expected is None or np.array_equal(found, expected)
        place = np.clip(place + random.normal(size=2) * 0.05, 0.0, size - 1e-6)
        if random.random() < 0.5:
            window = disturb(random, grids[0])
            grids[1].cells[:] = grids[0].cells
            grids[1].touch(window)
    assert waves(planners[1])[0] == 0


@pytest.mark.parametrize(
    "given_parameters",
    [
        GlobalPlannerParameters(outline_map=False),
        GlobalPlannerParameters(neutral_cost=200),
    ],
    ids=["no outline", "dear free cells"],
)
def test_what_the_margins_are_not_made_for_is_planned_with_whole_waves(given_parameters):
    grid = CostGrid(0.05, 0.0, 0.0, np.zeros((130, 130), dtype=np.uint8))
    planner = GlobalPlanner(given_parameters, FAST)
    for step in range(4):
        assert planner.plan(grid, Pose2(1.53, 1.53 + 0.05 * step), Pose2(5.03, 5.03)) is not None
    assert waves(planner) == (0, 4)


def test_a_robot_between_two_areas_is_planned_for_with_whole_waves():
    grid = CostGrid(0.05, 0.0, 0.0, np.zeros((150, 150), dtype=np.uint8))
    grid.cells[:, 75] = 254
    parameters = GlobalPlannerParameters()
    planner = GlobalPlanner(parameters, FIXED)
    for step in range(4):
        # The exact position is in column 74.3, one of its four cells in the wall.
        start, goal = Pose2(3.74, 3.03 + 0.05 * step), Pose2(7.03, 6.03)
        found = planner.plan(grid, start, goal)
        fresh = GlobalPlanner(parameters, FIXED).plan(grid, start, goal)
        assert found is not None
        assert fresh is not None
        assert np.array_equal(found, fresh)
    assert waves(planner) == (0, 4)
