"""The update cycle of costmap_2d written down step by step, without any shortcut."""

import heapq
import math
from functools import partial

import numpy as np

from daemon.stacks.ros1.costmap.layers import (
    InflationLayer,
    ObstacleLayer,
    StaticLayer,
    VoxelLayer,
    inscribed_radius,
)

LETHAL, UNKNOWN, INSCRIBED = 254, 255, 253
Window = tuple[int, int, int, int]


def line(x0, y0, x1, y1, most=math.inf):
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


def cost(distance, layer, inscribed, res):
    if distance == 0:
        return LETHAL
    if distance * res <= inscribed:
        return INSCRIBED
    fall = math.exp(-layer.cost_scaling_factor * (distance * res - inscribed))
    return int((INSCRIBED - 1) * fall)


def by_queue(lethal, shape, radius):
    """Distance [cells] as the original finds it: sources are passed on to four neighbours.

    ``lethal`` row by row. Whoever waits at a distance that is done already waits for ever.
    """
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
                if distance < further <= radius:
                    heapq.heappush(heap, (further, order, nx, ny, sx, sy))
                    order += 1
    return away


class PlainGrid:
    """Cells at a place; ``voxels`` of a layer that has them: a set of levels by state."""

    def __init__(self, x, y, res, shape, free):
        self.x, self.y, self.res, self.free = x, y, res, free
        self.cells = np.full(shape, free)
        self.extra = None

    def cell(self, x, y):
        if x < self.x or y < self.y:
            return None
        i, j = int((x - self.x) / self.res), int((y - self.y) / self.res)
        return (i, j) if i < self.cells.shape[1] and j < self.cells.shape[0] else None

    def moved(self, array, dx, dy, free):
        rows, columns = self.cells.shape
        new = np.full_like(array, free)
        for r in range(rows):
            for c in range(columns):
                if 0 <= r + dy < rows and 0 <= c + dx < columns:
                    new[r, c] = array[r + dy, c + dx]
        return new

    def shift(self, dx, dy):
        self.cells = self.moved(self.cells, dx, dy, self.free)
        self.x, self.y = self.x + dx * self.res, self.y + dy * self.res

    def clear_area(self, base, side, *, inside):
        x0, y0 = base.x - side / 2, base.y - side / 2
        a, b = int((x0 - self.x) / self.res), int((y0 - self.y) / self.res)
        c, d = int((x0 + side - self.x) / self.res), int((y0 + side - self.y) / self.res)
        rows, columns = self.cells.shape
        for y in range(rows):
            for x in range(columns):
                if (a < x < c and b < y < d) == inside:
                    self.cells[y, x] = UNKNOWN
        width, height = (columns - 0.5) * self.res, (rows - 0.5) * self.res
        self.extra = (self.x, self.y, self.x + width, self.y + height)


class PlainObstacles(PlainGrid):
    """An obstacle layer, or a voxel layer."""

    def __init__(self, master, layer, free):
        super().__init__(master.x, master.y, master.res, master.cells.shape, free)
        self.layer = layer
        self.columns = np.full(master.cells.shape, 0xFFFF, dtype=np.int64)

    def shift(self, dx, dy):
        self.columns = self.moved(self.columns, dx, dy, 0xFFFF)
        super().shift(dx, dy)

    def points(self, source, scan):
        z = float(np.float32(scan.height))
        if not source.min_obstacle_height <= z <= source.max_obstacle_height:
            return []
        nearest, farthest = np.float32(scan.range_min), np.float32(scan.range_max)
        r = scan.ranges.copy()
        if source.inf_is_valid:
            r[r == np.inf] = farthest - np.float32(0.0001)
        good = (r >= nearest) & (r < farthest)
        r, a = r[good].astype(float), scan.angles[good]
        x, y = ((r * f(a)).astype(np.float32) for f in (np.cos, np.sin))
        half = scan.pose.yaw / 2.0
        turn, w = np.float32(math.sin(half)), np.float32(math.cos(half))
        c, s = 1 - 2 * turn * turn, 2 * turn * w
        place = np.float32(scan.pose.x), np.float32(scan.pose.y)
        points = np.column_stack((c * x - s * y + place[0], s * x + c * y + place[1]))
        assert points.dtype == np.float32
        return [(x, y) for x, y in points.astype(float).tolist()]

    def clear(self, scan, points, reach):
        ox, oy = scan.pose.x, scan.pose.y
        start = self.cell(ox, oy)
        if start is None:
            return []
        rows, columns = self.cells.shape
        right, high = self.x + columns * self.res, self.y + rows * self.res
        touched = [(ox, oy)]
        for wx, wy in points:
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
                self.cells[y, x] = 0
            touched.append(cut_off(ox, oy, wx, wy, reach))
        return touched

    def clear_voxels(self, scan, points, reach):
        voxels, top = self.layer, self.layer.max_obstacle_height
        assert isinstance(voxels, VoxelLayer)
        bottom, step = voxels.origin_z, voxels.z_resolution
        rows, columns = self.cells.shape
        sizes = (columns, rows, voxels.z_voxels)
        low = (self.x, self.y, bottom)
        high = (self.x + (columns - 0.5) * self.res, self.y + (rows - 0.5) * self.res)
        origin = (scan.pose.x, scan.pose.y, scan.height)

        def in_cells(p):
            if any(p[k] < low[k] for k in range(3)):
                return None
            units = (self.res, self.res, step)
            q = [(p[k] - low[k]) / units[k] for k in range(3)]
            return q if all(q[k] < sizes[k] for k in range(3)) else None

        touched = []
        begin = in_cells(origin)
        if begin is None:
            return touched
        z = float(np.float32(scan.height))
        for x, y in points:
            w = [x, y, z]
            away = math.sqrt(sum((w[k] - origin[k]) ** 2 for k in range(3)))
            share = max(min(1.0, (away - 2 * self.res) / away), 0.0) if away > 0 else 0.0
            w = [share * (w[k] - origin[k]) + origin[k] for k in range(3)]
            way = [w[k] - origin[k] for k in range(3)]
            t = 1.0
            with np.errstate(divide="ignore", invalid="ignore"):
                if w[2] > top:
                    t = max(0.0, min(t, float(np.float64(top - 0.01 - origin[2]) / way[2])))
                elif w[2] < bottom:
                    t = min(t, float(np.float64(bottom - origin[2]) / way[2]))
                for k in range(2):
                    if w[k] < low[k]:
                        t = min(t, float(np.float64(low[k] - origin[k]) / way[k]))
                    if w[k] > high[k]:
                        t = min(t, float(np.float64(high[k] - origin[k]) / way[k]))
                w = [origin[k] + way[k] * t for k in range(3)]
            end = in_cells(w)
            if end is None:
                continue
            most = math.ceil(reach / self.res)
            for i, j, k in line_in_space(begin, end, most):
                self.columns[j, i] &= ~(0x10001 << k)
                marked, known = self.columns[j, i] >> 16, self.columns[j, i] & 0xFFFF
                if int(marked).bit_count() <= voxels.mark_threshold:
                    unknown = int(marked ^ known).bit_count()
                    limit = voxels.unknown_threshold + 16 - voxels.z_voxels
                    self.cells[j, i] = 0 if unknown <= limit else UNKNOWN
            touched.append(cut_off(origin[0], origin[1], w[0], w[1], reach))
        return touched

    def mark(self, scan, points, reach):
        z, touched, voxels = float(np.float32(scan.height)), [], self.layer
        if z > self.layer.max_obstacle_height:
            return []
        for x, y in points:
            found = self.cell(x, y)
            away2 = (x - scan.pose.x) ** 2 + (y - scan.pose.y) ** 2
            if away2 >= reach * reach or found is None:
                continue
            if isinstance(voxels, VoxelLayer):
                level = int((max(z, voxels.origin_z) - voxels.origin_z) / voxels.z_resolution)
                if level >= voxels.z_voxels:
                    continue
                self.columns[found[1], found[0]] |= 0x10001 << level
                marked = int(self.columns[found[1], found[0]] >> 16).bit_count()
                if marked <= voxels.mark_threshold:
                    continue
            self.cells[found[1], found[0]] = LETHAL
            touched.append((x, y))
        return touched


def cut_off(ox, oy, wx, wy, reach):
    part = min(1.0, reach / (math.hypot(wx - ox, wy - oy) or 1e-300))
    return ox + (wx - ox) * part, oy + (wy - oy) * part


def line_in_space(begin, end, most):
    """Bresenham along the axis with the most steps, of equals the first of x, y, z."""
    at = [int(b) for b in begin]
    steps = [int(e) - int(b) for b, e in zip(begin, end, strict=True)]
    sizes = [abs(s) for s in steps]
    lead = sizes.index(max(sizes))
    away = math.dist(begin, end)
    errors = [sizes[lead] // 2] * 3
    cells = [(at[0], at[1], at[2])]
    for _ in range(int(sizes[lead] * (1.0 if away == 0 else min(1.0, most / away)))):
        for k in range(3):
            errors[k] += sizes[k]
            if k == lead or errors[k] >= sizes[lead]:
                at[k] += 1 if steps[k] > 0 else -1
                errors[k] -= sizes[lead]
        cells.append((at[0], at[1], at[2]))
    return cells


def interpreted(layer, value):
    """Return the cost of a value of the map (``StaticLayer::interpretValue``)."""
    value = int(value) % 256
    if value == layer.unknown_cost_value % 256:
        return UNKNOWN if layer.track_unknown_space else 0
    if value >= layer.lethal_cost_threshold:
        return LETHAL
    return 0 if layer.trinary_costmap else int(value / layer.lethal_cost_threshold * LETHAL)


class PlainCostmap:
    """Reference for :class:`Costmap`: same arguments, ``cells`` instead of ``grid``."""

    def __init__(self, parameters, footprint, quirks, static=None, hears=None):
        self.parameters, self.footprint, self.quirks = parameters, footprint, quirks
        self.hears = hears
        p = parameters
        shows_map = any(isinstance(layer, StaticLayer) for layer in p.layers)
        free = UNKNOWN if p.track_unknown_space else 0
        if static is not None and shows_map and not p.rolling_window:
            self.master = PlainGrid(static.x, static.y, static.resolution, static.cells.shape, free)
        else:
            shape = (int(p.height / p.resolution), int(p.width / p.resolution))
            self.master = PlainGrid(p.origin_x, p.origin_y, p.resolution, shape, free)
        self.grids = []
        for layer in p.layers:
            if isinstance(layer, StaticLayer):
                assert static is not None
                grid = PlainGrid(static.x, static.y, static.resolution, static.cells.shape, 0)
                grid.cells = np.vectorize(partial(interpreted, layer))(static.cells)
                self.grids.append(grid)
            elif isinstance(layer, ObstacleLayer):
                spared = shows_map and not quirks.unknown_becomes_free
                remembers = layer.track_unknown_space or spared
                self.grids.append(PlainObstacles(self.master, layer, UNKNOWN if remembers else 0))
            else:
                self.grids.append(None)
        self.first = True
        nowhere = (1e30, 1e30, -1e30, -1e30)
        self.last = dict.fromkeys(range(len(p.layers)), nowhere)

    @property
    def cells(self):
        return self.master.cells

    def touch(self, x, y):
        b = self.bounds
        self.bounds = (min(b[0], x), min(b[1], y), max(b[2], x), max(b[3], y))

    def polygon(self, corners):
        cells = [self.master.cell(x, y) for x, y in corners]
        if None in cells:
            return []
        ring = [c for c in cells if c is not None]
        edge = [p for a, b in zip(ring, ring[1:] + ring[:1], strict=True) for p in line(*a, *b)]
        filled = []
        for x in {x for x, _ in edge}:
            column = [y for u, y in edge if u == x]
            filled += [(x, y) for y in range(min(column), max(column) + 1)]
        return filled

    def clear_square(self, base, half):
        x, y = base.x, base.y
        square = [(-half, -half), (half, -half), (half, half), (-half, half)]
        for i, j in self.polygon([(x + u, y + v) for u, v in square]):
            self.master.cells[j, i] = 0

    def clear_layers(self, base, side, names, *, inside=False):
        for layer, grid in zip(self.parameters.layers, self.grids, strict=True):
            if grid is not None and layer.name in names:
                grid.clear_area(base, side, inside=inside)

    def observations(self, source, scans):
        """What the source's buffer holds, the newest first."""
        lasers = None if self.hears is None else self.hears[source.topic]
        buffer = [s for s in reversed(scans) if lasers is None or s.laser in lasers]
        if source.observation_persistence == 0.0 or not buffer:
            return buffer[:1]
        updated = buffer[0].time if buffer[0].received is None else buffer[0].received
        kept = []
        for scan in buffer:
            if round(updated - scan.time, 9) > round(source.observation_persistence, 9):
                break
            kept.append(scan)
        return kept

    def update(self, base, scans, frame_in_map):
        p = self.parameters
        rows, columns = self.cells.shape
        if p.rolling_window:
            res, whole = self.master.res, int if self.quirks.truncated_window_shift else round
            dx = whole((base.x - (columns - 0.5) * res / 2 - self.master.x) / res)
            dy = whole((base.y - (rows - 0.5) * res / 2 - self.master.y) / res)
            self.master.shift(dx, dy)
            for grid in self.grids:
                if isinstance(grid, PlainObstacles):
                    grid.shift(dx, dy)
        if not p.layers:
            return
        self.bounds = (1e30, 1e30, -1e30, -1e30)
        corners = [base.apply((x, y)) for x, y in self.footprint.tolist()]
        for index, (layer, grid) in enumerate(zip(p.layers, self.grids, strict=True)):
            cleared = grid is not None and grid.extra is not None
            if grid is not None and grid.extra is not None:
                self.touch(*grid.extra[:2])
                self.touch(*grid.extra[2:])
                grid.extra = None
            if isinstance(layer, InflationLayer):
                self.bounds_of_inflation(index, layer)
            elif isinstance(grid, PlainObstacles):
                self.observe(layer, grid, scans)
                for x, y in corners if layer.footprint_clearing_enabled else ():
                    self.touch(x, y)
            elif grid is not None and (self.first or cleared or p.rolling_window):
                height, width = grid.cells.shape
                self.touch(grid.x + 0.5 * grid.res, grid.y + 0.5 * grid.res)
                self.touch(grid.x + (width + 0.5) * grid.res, grid.y + (height + 0.5) * grid.res)
        self.first = False
        window = self.window()
        if window[2] < window[0] or window[3] < window[1]:
            return
        for y in range(window[1], window[3]):
            for x in range(window[0], window[2]):
                self.cells[y, x] = self.master.free
        under = self.polygon(corners)
        for layer, grid in zip(p.layers, self.grids, strict=True):
            if isinstance(layer, InflationLayer):
                self.inflate(layer, window)
            elif isinstance(layer, ObstacleLayer):
                assert grid is not None
                for x, y in under if layer.footprint_clearing_enabled else ():
                    grid.cells[y, x] = 0
                self.merge(grid, window, {0: "over", 1: "max"}.get(layer.combination_method, ""))
            elif p.rolling_window:
                assert grid is not None
                self.show(grid, window, frame_in_map, maximum=layer.use_maximum)
            else:
                assert grid is not None
                self.merge(grid, window, "max" if layer.use_maximum else "true")

    def observe(self, layer, grid, scans):
        for task in ("clearing", "marking"):
            for source in layer.sources:
                for scan in self.observations(source, scans) if getattr(source, task) else ():
                    points = grid.points(source, scan)
                    if task == "marking":
                        touched = grid.mark(scan, points, source.obstacle_range)
                    elif not isinstance(layer, VoxelLayer):
                        touched = grid.clear(scan, points, source.raytrace_range)
                    else:
                        touched = grid.clear_voxels(scan, points, source.raytrace_range)
                    for x, y in touched:
                        self.touch(x, y)

    def bounds_of_inflation(self, index, layer):
        own, last, by = self.bounds, self.last[index], layer.inflation_radius
        self.last[index] = own
        most = float(np.finfo(np.float32).max)
        if self.first:
            self.bounds = (-most, -most, most, most)
            return
        low = [min(last[k], own[k]) - by for k in (0, 1)]
        high = [max(last[k], own[k]) + by for k in (2, 3)]
        self.bounds = (low[0], low[1], high[0], high[1])

    def window(self):
        rows, columns = self.cells.shape
        found = []
        for k, value in enumerate(self.bounds):
            size = (columns, rows)[k % 2]
            origin = (self.master.x, self.master.y)[k % 2]
            if value < origin:
                found.append(0)
            elif value >= self.master.res * size + origin:
                found.append(size - 1)
            else:
                found.append(int((value - origin) / self.master.res))
        return found[0], found[1], min(columns, found[2] + 1), min(rows, found[3] + 1)

    def merge(self, grid, window, method):
        for y in range(window[1], window[3]):
            for x in range(window[0], window[2]):
                own, old = int(grid.cells[y, x]), int(self.cells[y, x])
                if method == "true":
                    self.cells[y, x] = own
                elif own == UNKNOWN or not method:
                    continue
                elif method == "over" or old == UNKNOWN or old < own:
                    self.cells[y, x] = own

    def show(self, grid, window, frame_in_map, *, maximum):
        for y in range(window[1], window[3]):
            for x in range(window[0], window[2]):
                centre = [
                    origin + (k + 0.5) * self.master.res
                    for k, origin in ((x, self.master.x), (y, self.master.y))
                ]
                found = grid.cell(*frame_in_map.apply((centre[0], centre[1])))
                if found is not None:
                    own = int(grid.cells[found[1], found[0]])
                    self.cells[y, x] = max(own, int(self.cells[y, x])) if maximum else own

    def inflate(self, layer, window):
        inscribed = inscribed_radius(self.footprint)
        radius = math.ceil(layer.inflation_radius / self.master.res)
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
        if self.quirks.inflation_queue_order:
            away = by_queue([(int(x), int(y)) for y, x in found], (rows, columns), radius)
        else:
            ys, xs = np.indices(self.cells.shape)
            away = np.hypot(ys[..., None] - found[:, 0], xs[..., None] - found[:, 1]).min(axis=-1)
        for y, x in np.argwhere(away <= radius).tolist():
            value = cost(float(away[y, x]), layer, inscribed, self.master.res)
            old = int(self.cells[y, x])
            least = 1 if layer.inflate_unknown else INSCRIBED
            if old == UNKNOWN:
                self.cells[y, x] = value if value >= least else old
            else:
                self.cells[y, x] = max(old, value)
