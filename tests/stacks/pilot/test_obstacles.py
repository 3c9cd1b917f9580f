import numpy as np
import pytest

from daemon.stacks.pilot import maps
from daemon.stacks.pilot.maps import UnmappedObstacles, first_blocked, map_field, project
from grammars.model.geometry import Pose2
from tests.stacks.pilot.plans import DOOR, ONE_DOORWAY, SIZE
from tests.stacks.pilot.world import a_robot, cast, draw, edges

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


def test_walls_of_the_map_are_no_obstacles():
    watcher = Watcher()
    assert watcher.look() == 0
    assert watcher.known.any()


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


def test_marks_lie_where_the_obstacle_is():
    watcher = Watcher()
    watcher.look((3.4, 1.5, 3.5, 1.6))
    assert len(watcher.layer.centres) > 0
    np.testing.assert_allclose(watcher.layer.centres.mean(axis=0), [3.4, 1.55], atol=0.1)


def test_returns_of_obstacles_and_their_neighbours_are_kept_from_matching():
    watcher = Watcher()
    watcher.look()
    np.testing.assert_array_equal(watcher.sure, watcher.points)
    watcher.look(DOOR)
    odd = np.flatnonzero(watcher.known == 0)
    others = np.delete(watcher.points, np.arange(odd[0] - 5, odd[-1] + 6), axis=0)
    np.testing.assert_array_equal(watcher.sure, others)
