"""The update cycle of costmap_2d written down step by step, without any shortcut."""

from __future__ import annotations

import heapq
import math

import numpy as np

from daemon.stacks.ros1.costmap import CostmapParameters, SensedScan, radii
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats, Pose2
from grammars.model.grid import OccupancyGrid

LETHAL, UNKNOWN, INSCRIBED = 254, 255, 253


def line(x0: int, y0: int, x1: int, y1: int, most: float = math.inf) -> list[tuple[int, int]]:
    dx, dy = x1 - x0, y1 - y0
    long, short = max(abs(dx), abs(dy)), min(abs(dx), abs(dy))
    length = math.hypot(dx, dy)
    steps = int(long * (1.0 if length == 0 else min(1.0, most / length)))
    sx, sy = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    error, x, y, cells = long // 2, x0, y0, [(x0, y0)]
    for _ in range(steps):
        error += short
        aside = error >= long
        error -= long if aside else 0
        if abs(dx) >= abs(dy):
            x, y = x + sx, y + (sy if aside else 0)
        else:
            x, y = x + (sx if aside else 0), y + sy
        cells.append((x, y))
    return cells


def cost(distance: float, parameters: CostmapParameters, inscribed: float, res: float) -> int:
    if distance == 0:
        return LETHAL
    if distance * res <= inscribed:
        return INSCRIBED
    fall = math.exp(-parameters.cost_scaling_factor * (distance * res - inscribed))
    return int((INSCRIBED - 1) * fall)


def by_queue(lethal: list[tuple[int, int]], shape: tuple[int, int], radius: int) -> np.ndarray:
    """Distance [cells] as the original finds it: sources are passed on to four neighbours."""
    rows, columns = shape
    away = np.full(shape, np.inf)
    heap = [(0.0, k, x, y, x, y) for k, (x, y) in enumerate(lethal)]
    order = len(heap)
    while heap:
        distance, _, x, y, sx, sy = heapq.heappop(heap)
        if away[y, x] < np.inf:
            continue
        away[y, x] = distance
        for nx, ny in ((x - 1, y), (x, y - 1), (x + 1, y), (x, y + 1)):
            if 0 <= nx < columns and 0 <= ny < rows and away[ny, nx] == np.inf:
                further = math.hypot(nx - sx, ny - sy)
                if further <= radius:
                    heapq.heappush(heap, (further, order, nx, ny, sx, sy))
                    order += 1
    return away


class PlainCostmap:
    """Reference for :class:`Costmap`: same arguments, ``cells`` instead of ``grid``."""

    def __init__(
        self,
        parameters: CostmapParameters,
        footprint: Floats,
        quirks: Quirks,
        static: OccupancyGrid | None = None,
    ) -> None:
        self.parameters, self.footprint, self.quirks = parameters, footprint, quirks
        tracked = bool(parameters.track_unknown_space)
        self.static = None
        if static is not None:
            self.x, self.y, self.res = static.x, static.y, static.resolution
            shown = UNKNOWN if parameters.track_unknown_space is not False else 0
            self.static = np.where(
                static.cells == 100, LETHAL, np.where(static.cells == -1, shown, 0)
            )
            shape = static.cells.shape
        else:
            self.x, self.y, self.res = 0.0, 0.0, parameters.resolution
            shape = (int(parameters.height / self.res), int(parameters.width / self.res))
        free = UNKNOWN if tracked else 0
        self.reset_value = free
        remembers = tracked or (static is not None and not quirks.unknown_becomes_free)
        self.layer_value = UNKNOWN if remembers else 0
        self.cells = np.full(shape, free)
        self.layer = np.full(shape, self.layer_value)
        self.first = self.new_map = True
        self.reset = False
        self.last = (1e30, 1e30, -1e30, -1e30)

    def cell(self, x: float, y: float) -> tuple[int, int] | None:
        if x < self.x or y < self.y:
            return None
        i, j = int((x - self.x) / self.res), int((y - self.y) / self.res)
        return (i, j) if i < self.cells.shape[1] and j < self.cells.shape[0] else None

    def shift(self, base: Pose2) -> None:
        rows, columns = self.cells.shape
        whole = int if self.quirks.truncated_window_shift else round
        dx = whole((base.x - (columns - 0.5) * self.res / 2 - self.x) / self.res)
        dy = whole((base.y - (rows - 0.5) * self.res / 2 - self.y) / self.res)
        cells, layer = (
            np.full_like(self.cells, self.reset_value),
            np.full_like(self.layer, self.layer_value),
        )
        for r in range(rows):
            for c in range(columns):
                if 0 <= r + dy < rows and 0 <= c + dx < columns:
                    cells[r, c] = self.cells[r + dy, c + dx]
                    layer[r, c] = self.layer[r + dy, c + dx]
        self.cells, self.layer = cells, layer
        self.x, self.y = self.x + dx * self.res, self.y + dy * self.res

    def touch(self, x: float, y: float) -> None:
        b = self.bounds
        self.bounds = (min(b[0], x), min(b[1], y), max(b[2], x), max(b[3], y))

    def points(self, scan: SensedScan) -> np.ndarray:
        nearest, farthest = np.float32(scan.range_min), np.float32(scan.range_max)
        good = (scan.ranges >= nearest) & (scan.ranges < farthest)
        r, a = scan.ranges[good].astype(float), scan.angles[good]
        x, y = (r * np.cos(a)).astype(np.float32), (r * np.sin(a)).astype(np.float32)
        c, s = math.cos(scan.pose.yaw), math.sin(scan.pose.yaw)
        points = np.column_stack((scan.pose.x + c * x - s * y, scan.pose.y + s * x + c * y))
        return points.astype(np.float32).astype(float)

    def clear(self, scan: SensedScan, reach: float) -> None:
        ox, oy = scan.pose.x, scan.pose.y
        start = self.cell(ox, oy)
        if start is None:
            return
        rows, columns = self.cells.shape
        right, high = self.x + columns * self.res, self.y + rows * self.res
        self.touch(ox, oy)
        for wx, wy in self.points(scan).tolist():
            a, b = wx - ox, wy - oy
            if wx < self.x:
                wx, wy = self.x, oy + b * (self.x - ox) / a
            if wy < self.y:
                wx, wy = ox + a * (self.y - oy) / b, self.y
            if wx > right:
                wx, wy = right - 0.001, oy + b * (right - ox) / a
            if wy > high:
                wx, wy = ox + a * (high - oy) / b, high - 0.001
            end = self.cell(wx, wy)
            if end is None:
                continue
            for x, y in line(*start, *end, math.ceil(reach / self.res)):
                self.layer[y, x] = 0
            part = min(1.0, reach / (math.hypot(wx - ox, wy - oy) or 1.0))
            self.touch(ox + (wx - ox) * part, oy + (wy - oy) * part)

    def mark(self, scan: SensedScan, reach: float) -> None:
        for x, y in self.points(scan).tolist():
            found = self.cell(x, y)
            if math.hypot(x - scan.pose.x, y - scan.pose.y) < reach and found is not None:
                self.layer[found[1], found[0]] = LETHAL
                self.touch(x, y)

    def polygon(self, corners: list[tuple[float, float]]) -> list[tuple[int, int]]:
        cells = [self.cell(x, y) for x, y in corners]
        if None in cells:
            return []
        ring = [c for c in cells if c is not None]
        edge = [p for a, b in zip(ring, ring[1:] + ring[:1], strict=True) for p in line(*a, *b)]
        filled = []
        for x in {x for x, _ in edge}:
            column = [y for u, y in edge if u == x]
            filled += [(x, y) for y in range(min(column), max(column) + 1)]
        return filled

    def clear_square(self, base: Pose2, half: float) -> None:
        x, y = base.x, base.y
        square = [(-half, -half), (half, -half), (half, half), (-half, half)]
        for i, j in self.polygon([(x + u, y + v) for u, v in square]):
            self.cells[j, i] = 0

    def clear_obstacles_outside(self, base: Pose2, side: float) -> None:
        x0, y0 = base.x - side / 2, base.y - side / 2
        a, b = int((x0 - self.x) / self.res), int((y0 - self.y) / self.res)
        c, d = int((x0 + side - self.x) / self.res), int((y0 + side - self.y) / self.res)
        for y in range(self.cells.shape[0]):
            for x in range(self.cells.shape[1]):
                if not (a < x < c and b < y < d):
                    self.layer[y, x] = UNKNOWN
        self.reset = True

    def update(self, base: Pose2, scan: SensedScan | None) -> None:
        p = self.parameters
        rows, columns = self.cells.shape
        if p.rolling_window:
            self.shift(base)
        self.bounds = (1e30, 1e30, -1e30, -1e30)
        if (self.static is not None and self.new_map) or self.reset:
            self.touch(self.x, self.y)
            self.touch(self.x + columns * self.res, self.y + rows * self.res)
        if scan is not None:
            for source in p.sources:
                if source.clearing:
                    self.clear(scan, p.raytrace_range)
            for source in p.sources:
                if source.marking:
                    self.mark(scan, p.obstacle_range)
        corners = [base.apply((x, y)) for x, y in self.footprint.tolist()]
        for x, y in corners:
            self.touch(x, y)
        raw = self.bounds
        if self.first:
            window = (0, 0, columns, rows)
        else:
            big, last = p.inflation_radius, self.last
            x0, y0 = (
                int(max(0.0, min(raw[k], last[k]) - big - o) / self.res)
                for k, o in ((0, self.x), (1, self.y))
            )
            x1, y1 = (
                min(n, int((max(raw[k], last[k]) + big - o) / self.res) + 1)
                for k, o, n in ((2, self.x, columns), (3, self.y, rows))
            )
            window = (min(x0, columns - 1), min(y0, rows - 1), max(1, x1), max(1, y1))
        self.last = raw
        self.first = self.new_map = self.reset = False
        for x, y in self.polygon(corners):
            self.layer[y, x] = 0
        self.merge(window)
        self.inflate(window)

    def merge(self, window: tuple[int, int, int, int]) -> None:
        for y in range(window[1], window[3]):
            for x in range(window[0], window[2]):
                value = self.reset_value if self.static is None else int(self.static[y, x])
                seen = int(self.layer[y, x])
                if seen != UNKNOWN and (value == UNKNOWN or value < seen):
                    value = seen
                self.cells[y, x] = value

    def inflate(self, window: tuple[int, int, int, int]) -> None:
        p = self.parameters
        inscribed, _ = radii(self.footprint)
        radius = math.ceil(p.inflation_radius / self.res)
        rows, columns = self.cells.shape
        if radius == 0:
            return
        box = self.cells[
            max(0, window[1] - radius) : min(rows, window[3] + radius),
            max(0, window[0] - radius) : min(columns, window[2] + radius),
        ]
        found = np.argwhere(box == LETHAL)
        if not len(found):
            return
        found += (max(0, window[1] - radius), max(0, window[0] - radius))
        ys, xs = np.indices(self.cells.shape)
        away2 = (ys[..., None] - found[:, 0]) ** 2 + (xs[..., None] - found[:, 1]) ** 2
        nearest = away2.min(axis=-1)
        for y, x in np.argwhere(nearest <= radius * radius).tolist():
            value = cost(math.sqrt(nearest[y, x]), p, inscribed, self.res)
            old = int(self.cells[y, x])
            least = 1 if p.inflate_unknown else INSCRIBED
            if old == UNKNOWN:
                self.cells[y, x] = value if value >= least else old
            else:
                self.cells[y, x] = max(old, value)
