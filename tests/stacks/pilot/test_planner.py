import heapq
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.pilot.maps import map_field
from daemon.stacks.pilot.planner import Planner, cost_factor, search_astar
from tests.stacks.pilot.plans import ONE_DOORWAY, OUTER, SIZE
from tests.stacks.pilot.world import draw

LETHAL, PREFERRED = 0.25, 0.9


def dijkstra(clearance, start, goal):
    def factor(cell):
        if not all(0 <= k < n for k, n in zip(cell, clearance.shape, strict=True)):
            return 0.0
        value = float(clearance[cell])
        return cost_factor(value, LETHAL, PREFERRED) if value >= LETHAL else 0.0

    spent = {start: 0.0}
    queue = [(0.0, start)]
    while queue:
        cost, here = heapq.heappop(queue)
        if here == goal:
            return cost
        if cost > spent[here]:
            continue
        for dr, dc in itertools.product((-1, 0, 1), repeat=2):
            there = (here[0] + dr, here[1] + dc)
            open_beside = factor((here[0], there[1])) and factor((there[0], here[1]))
            if there == here or not factor(there) or not open_beside:
                continue
            total = cost + math.hypot(dr, dc) * 0.5 * (factor(here) + factor(there))
            if total < spent.get(there, math.inf):
                spent[there] = total
                heapq.heappush(queue, (total, there))
    return math.inf


@given(
    rows=st.integers(2, 14),
    columns=st.integers(2, 14),
    closed=st.floats(0.0, 0.5),
    seed=st.integers(0, 2**32 - 1),
)
def test_paths_cost_what_dijkstra_finds(rows, columns, closed, seed):
    random = np.random.default_rng(seed)
    clearance = random.uniform(LETHAL, 1.2, (rows, columns)).astype(np.float32)
    clearance[random.random((rows, columns)) < closed] = 0.0
    start = (0, 0)
    goal = (rows - 1, columns - 1)
    clearance[start] = clearance[goal] = 0.5
    spent = np.full(clearance.size, np.inf, dtype=np.float32)
    path = search_astar(clearance, spent, start, goal, LETHAL, PREFERRED)
    cost = float(spent[-1])
    assert cost == pytest.approx(dijkstra(clearance, start, goal), rel=1e-5)
    if math.isfinite(cost):
        cells = np.column_stack(np.divmod(path, columns))
        assert tuple(cells[0]) == start
        assert tuple(cells[-1]) == goal
        assert np.abs(np.diff(cells, axis=0)).max() == 1
    else:
        assert path.size == 0


def a_planner(walls):
    return Planner(map_field(draw(walls, SIZE)), LETHAL, PREFERRED, tolerance=0.15)


def length(path):
    return path.spacing * (len(path.points) - 1)


def test_a_path_leads_through_the_middle_of_the_doorway():
    planner = a_planner(ONE_DOORWAY)
    path = planner.plan((1.0, 4.0), (8.0, 4.0))
    assert tuple(path.points[0]) == (1.0, 4.0)
    assert tuple(path.points[-1]) == (8.0, 4.0)
    in_wall = path.points[np.abs(path.points[:, 0] - 4.5) < 0.1]
    assert np.abs(in_wall[:, 1] - 1.575).max() < 0.06
    rows, columns = zip(*(planner.field.cell(*p) for p in path.points), strict=True)
    assert planner.field.clearance[rows, columns].min() >= LETHAL


def test_a_path_in_the_open_is_hardly_longer_than_a_straight_line():
    path = a_planner(OUTER).plan((1.5, 1.5), (7.3, 3.1))
    # Steps to eight neighbours make a way at most 8.3 % longer.
    assert length(path) < 1.083 * math.hypot(5.8, 1.6)


def test_there_is_no_path_through_walls_or_the_unknown():
    planner = a_planner([*OUTER, (4.4, 0, 4.6, 5)])
    assert planner.plan((1.0, 1.0), (8.0, 1.0)) is None
    assert planner.plan((1.0, 1.0), (-0.1, 1.0)) is None
    assert planner.plan((1.0, 1.0), (99.0, 1.0)) is None


def test_a_goal_too_close_to_a_wall_is_approached_within_tolerance():
    planner = a_planner(OUTER)
    path = planner.plan((4.0, 2.5), (8.6, 2.5))
    end = path.points[-1]
    assert math.hypot(end[0] - 8.6, end[1] - 2.5) <= 0.15
    assert planner.plan((4.0, 2.5), (8.75, 2.5)) is None


def test_a_robot_too_close_to_a_wall_finds_its_way_out():
    path = a_planner(OUTER).plan((0.35, 2.5), (4.0, 2.5))
    assert length(path) == pytest.approx(3.65, abs=0.1)


def test_getting_out_of_a_tight_spot_never_leads_through_a_wall():
    planner = a_planner([*OUTER, (4.4, 0, 4.5, 5)])
    assert planner.plan((4.2, 2.5), (4.8, 2.5)) is None
