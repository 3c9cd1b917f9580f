"""The compiled planner against the plain one, and against plans of the original."""

import hashlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.navfn import GlobalPlannerParameters
from daemon.stacks.ros1.navfn.field import PotentialField
from daemon.stacks.ros1.navfn.planner import GlobalPlanner
from daemon.stacks.ros1.navfn.propagation import propagate_wave
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2
from tests.stacks.ros1.global_planner import plain
from tests.stacks.ros1.navfn.fields import a_grid, centre
from tests.stacks.ros1.navfn.test_identity import disturb, random_cells

seeds = st.integers(0, 2**32 - 1)

parameters = st.builds(
    GlobalPlannerParameters,
    old_navfn_behavior=st.booleans(),
    allow_unknown=st.booleans(),
    outline_map=st.booleans(),
    lethal_cost=st.sampled_from([2, 60, 200, 253, 254, 255]),
    neutral_cost=st.sampled_from([1, 20, 50, 66, 255]),
    cost_factor=st.sampled_from([0.01, 0.55, 0.8, 1.0, 3.0, 5.0]),
    orientation_mode=st.integers(0, 1),
    orientation_window_size=st.sampled_from([1, 2, 7]),
)


@given(seeds, parameters, st.sampled_from([FAST, FIXED]))
def test_plans_are_those_of_the_plain_planner(seed, given_parameters, quirks):
    random = np.random.default_rng(seed)
    cells = random_cells(random, 4, 26)
    cells[random.random(cells.shape) < 0.3] = 0
    grid = CostGrid(0.05, -1.0, 2.0, cells)
    rows, columns = cells.shape
    planner = GlobalPlanner(given_parameters, quirks)
    x, y = random.random((2, 2)) * [[columns], [rows]] * 0.05 + [[-1.0], [2.0]]
    goal = Pose2(float(x[1]), float(y[1]), float(random.uniform(-3.2, 3.2)))
    for _ in range(3):
        start = Pose2(float(x[0]), float(y[0]), float(random.uniform(-3.2, 3.2)))
        expected = plain.plan(grid, start, goal, given_parameters, quirks)
        found = planner.plan(grid, start, goal)
        assert (found is None) == (expected is None)
        if found is not None and expected is not None:
            assert np.array_equal(found[:, :2], expected[:, :2])
            # An angle read back from a quaternion may end up on either side of a half turn.
            turned = np.remainder(found[:, 2] - expected[:, 2] + 1.0, 2.0 * np.pi) - 1.0
            assert turned == pytest.approx(np.zeros(len(turned)), abs=1e-9)
        disturb(random, grid)
        x[0] += 0.05 * random.normal()
        y[0] += 0.05 * random.normal()


def rooms():
    """Return a map of arithmetic: walls with doors, costs around them, hills, unknown corners."""
    row, column = np.mgrid[0:60, 0:90]
    away = np.minimum(np.abs(column - 30), np.abs(column - 60)).astype(float)
    away[(row > 20) & (row < 28) & (column < 45)] = 9.0
    away[(row > 36) & (row < 43) & (column > 45)] = 9.0
    cells = np.clip(252 - 40 * away, 0, 252) + (row * 7 + column * 3) % 23
    cells = np.where(away == 0, 254, np.minimum(cells, 252))
    cells[(row < 12) & (column > 70)] = 255
    return CostGrid(0.05, -1.5, 0.7, cells.astype(np.uint8))


def digest(plan):
    """Return a digest of a plan to a tenth of a micrometre and a microradian."""
    rounded = np.round(plan * [1e7, 1e7, 1e6]).astype(np.int64)
    return hashlib.sha256(rounded.tobytes()).hexdigest()[:16]


START, GOAL = Pose2(-0.83, 1.22, 0.4), Pose2(2.41, 2.93, -1.1)
GOLDEN = [
    ({}, 158, "0b12d3cec1b26e2a"),
    ({"old_navfn_behavior": True}, 156, "b0512029f50d1e95"),
    ({"cost_factor": 0.55, "neutral_cost": 66}, 152, "041c27bad80355c1"),
    ({"lethal_cost": 200, "allow_unknown": False}, 156, "6e98b664bcb53a64"),
    ({"outline_map": False, "orientation_mode": 0}, 91, "a62ee2a8f22c2866"),
]
"""Parameters, points and digest of the plan, from the sources of Noetic compiled on their own."""


@pytest.mark.parametrize(("settings_of_it", "points", "expected"), GOLDEN)
def test_plans_are_those_of_the_original(settings_of_it, points, expected):
    found = GlobalPlanner(GlobalPlannerParameters(**settings_of_it), FAST).plan(
        rooms(), START, GOAL
    )
    assert (len(found), digest(found)) == (points, expected)


def a_planner(grid, parameters, quirks, **given):
    """Return a planner whose field has other margins, or is sooner restricted."""
    planner = GlobalPlanner(parameters, quirks)
    planner._field = PotentialField(grid, planner._rules, **given)
    return planner


def waves(planner):
    """Return how many restricted and whole waves gave an answer."""
    field = planner._field
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
        assert np.array_equal(found, fresh)
    assert waves(planner) == (0, 4)


def test_without_the_quirk_only_the_cell_of_the_robot_is_free_and_only_for_the_planner():
    grid = a_grid()
    grid.cells[:, 20] = 254
    planner = GlobalPlanner(GlobalPlannerParameters(old_navfn_behavior=True), FIXED)
    goal = centre(grid, 30, 10)
    assert planner.plan(grid, centre(grid, 20, 10), goal) is not None
    assert planner.plan(grid, centre(grid, 5, 10), goal) is None
    assert (grid.cells[:, 20] == 254).all()


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
    assert first is not second
    assert np.array_equal(first, second)
    for cost, pose, expected in ((0, start, 1), (30, start, 2), (30, Pose2(0.276, start.y), 3)):
        grid.cells[5, 5] = cost
        grid.touch((0, 0, 40, 20))
        planner.plan(grid, pose, goal)
        assert len(calls) == expected
