"""Distances on maps, ways through them, and obstacles that they do not show."""

import heapq
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.kernels import FAR, distance_transform
from daemon.stacks.pilot import maps
from daemon.stacks.pilot.maps import (
    Planner,
    UnmappedObstacles,
    cost_factor,
    first_blocked,
    map_field,
    project,
    search_astar,
)
from grammars.model.geometry import Pose2
from grammars.model.grid import OCCUPIED, UNKNOWN, OccupancyGrid
from tests.stacks.pilot.world import DOOR, ONE_DOORWAY, OUTER, SIZE, a_robot, cast, draw, edges

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


def test_a_path_leads_through_the_middle_of_the_doorway():
    planner = a_planner(ONE_DOORWAY)
    path = planner.plan((1.0, 4.0), (8.0, 4.0))
    assert tuple(path.points[0]) == (1.0, 4.0)
    assert tuple(path.points[-1]) == (8.0, 4.0)
    in_wall = path.points[np.abs(path.points[:, 0] - 4.5) < 0.1]
    assert np.abs(in_wall[:, 1] - 1.575).max() < 0.06
    rows, columns = zip(*(planner.field.cell(*p) for p in path.points), strict=True)
    assert planner.field.clearance[rows, columns].min() >= LETHAL


@pytest.mark.parametrize(
    ("wall", "start", "goal"),
    [
        ((4.4, 0, 4.6, 5), (1.0, 1.0), (8.0, 1.0)),  # through a wall,
        ((4.4, 0, 4.6, 5), (1.0, 1.0), (-0.1, 1.0)),  # the unknown,
        ((4.4, 0, 4.6, 5), (1.0, 1.0), (99.0, 1.0)),  # off the map,
        ((0, 0, 9, 0.2), (4.0, 2.5), (8.75, 2.5)),  # into one, beyond the tolerance,
        ((4.4, 0, 4.5, 5), (4.2, 2.5), (4.8, 2.5)),  # nor to get out of a tight spot.
    ],
)
def test_no_path_leads_through_walls_or_the_unknown(wall, start, goal):
    assert a_planner([*OUTER, wall]).plan(start, goal) is None


def test_robots_and_goals_too_close_to_a_wall_are_moved_away_from_it():
    planner = a_planner(OUTER)
    end = planner.plan((4.0, 2.5), (8.6, 2.5)).points[-1]
    assert math.hypot(end[0] - 8.6, end[1] - 2.5) <= 0.15
    path = planner.plan((0.35, 2.5), (4.0, 2.5))
    assert path.spacing * (len(path.points) - 1) == pytest.approx(3.65, abs=0.1)


def test_without_solid_cells_everything_is_far():
    assert (distance_transform(np.zeros((3, 5), dtype=np.uint8)) == FAR).all()


def test_the_surface_lies_on_the_edge_of_the_painted_wall():
    field = map_field(draw([(1.0, 0.0, 1.2, 2.0)], (2.0, 2.0)))
    row, column = field.cell(0.975, 1.0)
    assert field.surface[row, column] == pytest.approx(0.025)
    assert field.surface[row, column + 1] == pytest.approx(-0.025)
    # Unknown cells leave no clearance but are no surface.
    row, column = field.cell(-0.025, 1.0)
    assert field.clearance[row, column] == 0.0
    assert field.surface[row, column] > 0.9


def test_a_map_without_free_cells_is_refused():
    cells = np.full((4, 4), UNKNOWN, dtype=np.int8)
    cells[1, 1] = OCCUPIED
    with pytest.raises(ValueError, match="no free cell"):
        map_field(OccupancyGrid(0.05, 0.0, 0.0, cells))


LASER = a_robot(rays=181).laser
ANGLES = np.linspace(LASER.angle_min, LASER.angle_max, LASER.rays)
REACH = (LASER.angle_min, LASER.angle_increment, LASER.range_min, LASER.range_max)
HERE = Pose2(2.5, 1.575, 0.0)


class Watcher:
    """An obstacle layer and what it looks at."""

    def __init__(self, memory=100):
        self.field = map_field(draw(ONE_DOORWAY, SIZE))
        self.layer = UnmappedObstacles(self.field, memory)
        self.points = self.known = self.sure = np.empty(0)

    def look(self, *extra, at=HERE):
        segments = np.vstack([edges(box) for box in (*ONE_DOORWAY, *extra)])
        return self.take(cast(segments, at @ LASER.mount, ANGLES, LASER.range_max), at)

    def take(self, ranges, at=HERE):
        eye = at @ LASER.mount
        scan = (ranges.astype(np.float32), (eye.x, eye.y, eye.yaw), REACH)
        self.points, self.known, self.sure = project(self.field, scan)
        self.layer.update(scan, self.points, self.known)
        return len(self.layer.centres)


def test_a_closed_door_is_marked_and_blocks_the_path():
    watcher = Watcher()
    assert watcher.look(DOOR) > 5
    path = np.column_stack((np.arange(2.5, 6.5, 0.05), np.full(80, 1.575)))
    hit = first_blocked(path, watcher.layer.centres, 0.25)
    assert path[hit, 0] == pytest.approx(4.47 - 0.25, abs=0.06)
    clearance = watcher.layer.clearance(1.0)
    assert clearance[map_field(draw(ONE_DOORWAY, SIZE)).cell(4.475, 1.575)] == 0.0


def test_one_scan_may_mark_any_number_of_cells(monkeypatch):
    # As Python, where a write beyond an array is an error.
    monkeypatch.setattr(maps, "update_marks", maps.update_marks.py_func)
    layer = UnmappedObstacles(map_field(draw((), (6.0, 6.0), resolution=0.01)), 100)
    x, y = np.meshgrid(np.arange(0.505, 1.5, 0.01), np.arange(0.505, 0.8, 0.01))
    points = np.column_stack((x.ravel(), y.ravel()))
    lost = np.full(LASER.rays, np.nan, dtype=np.float32)
    scan = (lost, (1.0, 1.0, 0.0), REACH)
    layer.update(scan, points, np.zeros(len(points), dtype=np.uint8))
    assert len(layer.centres) == len(points)


def test_an_opened_door_is_cleared_by_looking_through():
    watcher = Watcher()
    watcher.look(DOOR)
    assert watcher.look() == 0


def test_rays_without_return_clear_and_lost_rays_do_not():
    watcher = Watcher()
    marked = watcher.look(DOOR)
    assert watcher.take(np.full(LASER.rays, np.nan)) == marked
    assert watcher.take(np.full(LASER.rays, np.inf)) == 0


def test_what_is_out_of_sight_stays_until_it_is_forgotten():
    watcher = Watcher(memory=10)
    marked = watcher.look(DOOR)
    away = Pose2(2.5, 1.575, np.pi)
    for _ in range(10):
        assert watcher.look(at=away) == marked
    assert watcher.look(at=away) == 0


def test_what_hides_behind_something_else_stays():
    watcher = Watcher()
    marked = watcher.look(DOOR)
    assert watcher.look((3.4, 0.3, 3.5, 2.6)) > marked


def test_returns_of_obstacles_and_their_neighbours_are_kept_from_matching():
    watcher = Watcher()
    watcher.look()
    np.testing.assert_array_equal(watcher.sure, watcher.points)
    watcher.look(DOOR)
    odd = np.flatnonzero(watcher.known == 0)
    others = np.delete(watcher.points, np.arange(odd[0] - 5, odd[-1] + 6), axis=0)
    np.testing.assert_array_equal(watcher.sure, others)
