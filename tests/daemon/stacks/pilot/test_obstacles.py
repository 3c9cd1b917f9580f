import numpy as np
import pytest

from daemon.stacks.pilot import obstacles
from daemon.stacks.pilot.map_field import map_field
from daemon.stacks.pilot.obstacles import UnmappedObstacles
from grammars.model.geometry import Pose2
from tests.daemon.stacks.pilot.plans import DOOR, ONE_DOORWAY, SIZE
from tests.daemon.stacks.pilot.world import a_robot, cast, draw, edges

LASER = a_robot(rays=181).laser
ANGLES = np.linspace(LASER.angle_min, LASER.angle_max, LASER.rays)
HERE = Pose2(2.5, 1.575, 0.0)


class Watcher:
    """An obstacle layer and what it looks at."""

    def __init__(self, memory=100):
        field = map_field(draw(ONE_DOORWAY, SIZE))
        self.layer = UnmappedObstacles(field, explained=0.15, reach=4.0, memory=memory)
        self.known = np.zeros(LASER.rays, dtype=np.uint8)

    def look(self, *extra, at=HERE):
        segments = np.vstack([edges(box) for box in (*ONE_DOORWAY, *extra)])
        return self.take(cast(segments, at @ LASER.mount, ANGLES, LASER.range_max), at)

    def take(self, ranges, at=HERE):
        seen = np.isfinite(ranges)
        points = np.column_stack(
            (0.3 + ranges[seen] * np.cos(ANGLES[seen]), ranges[seen] * np.sin(ANGLES[seen]))
        )
        buffer = np.zeros((LASER.rays, 2))
        buffer[: len(points)] = points
        self.layer.update(LASER, ranges.astype(np.float32), buffer, self.known, len(points), at)
        return self.layer.count


def test_walls_of_the_map_are_no_obstacles():
    watcher = Watcher()
    assert watcher.look() == 0
    assert watcher.known.any()


def test_a_closed_door_is_marked_and_blocks_the_path():
    watcher = Watcher()
    assert watcher.look(DOOR) > 5
    path = np.column_stack((np.arange(2.5, 6.5, 0.05), np.full(80, 1.575)))
    hit = watcher.layer.first_blocked(path, 0, len(path), 0.25)
    assert path[hit, 0] == pytest.approx(4.47 - 0.25, abs=0.06)
    clearance = watcher.layer.clearance(1.0)
    assert clearance[map_field(draw(ONE_DOORWAY, SIZE)).cell(4.475, 1.575)] == 0.0


def test_one_scan_may_mark_any_number_of_cells(monkeypatch):
    # As Python, where a write beyond an array is an error.
    monkeypatch.setattr(obstacles, "mark_cells", obstacles.mark_cells.py_func)
    field = map_field(draw((), (6.0, 6.0), resolution=0.01))
    layer = UnmappedObstacles(field, explained=0.0, reach=10.0, memory=100)
    x, y = np.meshgrid(np.arange(0.505, 1.5, 0.01), np.arange(0.505, 0.8, 0.01))
    points = np.column_stack((x.ravel(), y.ravel()))
    assert len(points) > 2 * len(layer.cells)
    known = np.zeros(len(points), dtype=np.uint8)
    lost = np.full(LASER.rays, np.nan, dtype=np.float32)
    layer.update(LASER, lost, points, known, len(points), Pose2())
    assert layer.count == len(points)


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


def test_marks_near_the_robot_come_in_its_frame():
    watcher = Watcher()
    watcher.look((3.4, 1.5, 3.5, 1.6))
    points = np.zeros((50, 2))
    used = watcher.layer.append_nearby(Pose2(3.4, 0.8, np.pi / 2), 1.5, points, 0)
    assert used > 0
    np.testing.assert_allclose(points[:used].mean(axis=0), [0.75, 0.0], atol=0.1)


def test_returns_of_obstacles_are_kept_from_matching():
    watcher = Watcher()
    watcher.look(DOOR)
    points = np.array([(1.97, 0.0), (1.97, 0.2), (0.0, 1.0), (0.01, 1.0), (0.3, 1.0)])
    kept = np.zeros((5, 2))
    assert watcher.layer.sift(points, 5, HERE, kept) == 2
    np.testing.assert_allclose(kept[:2], [(0.0, 1.0), (0.3, 1.0)])
