"""What the scans show and the map does not: marked cells, cleared by sight, forgotten in time."""

from __future__ import annotations

import numpy as np

from daemon.navigation.kernels import Singles
from daemon.navigation.pilot._field import MapField
from daemon.navigation.pilot._obstacle_kernels import (
    clear,
    first_blocked,
    mark,
    nearby,
    sift,
    stamp_clearance,
)
from grammars.robot import Laser
from grammars.values import Floats, Pose2


class ObstacleLayer:
    """Cells of the map that scans found occupied although the map says free."""

    def __init__(
        self, field: MapField, laser: Laser, *, explained: float, reach: float, memory: int
    ) -> None:
        self._field, self._laser = field, laser
        self._explained, self._reach, self._memory = explained, reach, memory
        self._step = (laser.angle_max - laser.angle_min) / max(1, laser.rays - 1)
        self._stamps = np.zeros(field.clearance.size, dtype=np.int32)
        self.cells = np.zeros(1024, dtype=np.int32)
        self.count = 0
        self._now = 0
        self._pose, self._sensor = np.zeros(3), np.zeros(3)

    def update(self, ranges: Singles, points: Floats, known: np.ndarray, count: int,
               base: Pose2) -> None:  # fmt: skip
        """Take one scan seen from ``base``: clear what it looks through, mark what it hits.

        ``points[:count]`` are its returns in the base frame; ``known`` (rays,) uint8 is filled.
        """
        field, laser = self._field, self._laser
        self._now += 1
        if self.cells.size < self.count + count:
            self.cells = np.concatenate((self.cells, np.zeros_like(self.cells)))
        sensor = base @ laser.mount
        self._sensor[:] = sensor.x, sensor.y, sensor.yaw
        self._pose[:] = base.x, base.y, base.yaw
        columns = field.clearance.shape[1]
        self.count = clear(
            self.cells, self.count, self._stamps, self._now - self._memory, columns,
            field.x, field.y, field.resolution, self._sensor, laser.angle_min, self._step,
            ranges, laser.range_max, 2.0 * field.resolution,
        )  # fmt: skip
        self.count = mark(
            points, known, count, self._pose, field.surface, field.x, field.y, field.resolution,
            self._explained, self._reach, self._now, self._stamps, self.cells, self.count,
        )  # fmt: skip

    def sift(self, points: Floats, count: int, base: Pose2, result: Floats) -> int:
        """Write the returns that tell about the map into ``result`` (rays, 2); return how many."""
        field = self._field
        rows, columns = field.clearance.shape
        self._pose[:] = base.x, base.y, base.yaw
        return sift(
            points, count, self._pose, self._stamps, rows, columns, field.x, field.y,
            field.resolution, field.resolution, result,
        )  # fmt: skip

    def clearance(self, reach: float) -> Singles:
        """Return the map's clearance field with the marked cells stamped in, out to ``reach``."""
        combined = self._field.clearance.copy()
        stamp_clearance(combined, self.cells, self.count, self._field.resolution, reach)
        return combined

    def first_blocked(self, path: Floats, begin: int, end: int, radius: float) -> int:
        """Return the first index of ``path`` in [begin, end) too close to a mark, or -1."""
        field = self._field
        return first_blocked(
            path, begin, end, self.cells, self.count, field.clearance.shape[1],
            field.x, field.y, field.resolution, radius,
        )  # fmt: skip

    def append_nearby(self, base: Pose2, reach: float, points: Floats, used: int) -> int:
        """Append marks near ``base`` to ``points`` in the base frame; return their number."""
        field = self._field
        self._pose[:] = base.x, base.y, base.yaw
        return nearby(
            self.cells, self.count, field.clearance.shape[1], field.x, field.y,
            field.resolution, self._pose, reach, points, used,
        )  # fmt: skip
