"""GlobalPlanner written down plainly: the yardstick of the compiled version, for small grids."""

import math

import numpy as np

from tests.stacks.ros1.navfn.plain import HIGH, F, blend, updated

BUFFER = 10_000


class Map:
    """Costs and potentials, with nothing off the map and the next row beside a row's end."""

    def __init__(self, cells, parameters):
        self.columns = cells.shape[1]
        seen = cells.copy()
        if parameters.outline_map:
            seen[0], seen[-1], seen[:, 0], seen[:, -1] = (254,) * 4
        self.cells = seen.ravel().tolist()
        self.size = len(self.cells)
        self.found = {}
        self.parameters = parameters

    def index(self, point):
        return int(point[0]) + int(point[1]) * self.columns

    def potential(self, n):
        return self.found.get(n, HIGH)

    def set(self, n, value):
        if 0 <= n < self.size:
            self.found[n] = F(value)

    def cost(self, n):
        """The cost of a cell to Dijkstra; ``lethal_cost`` where it is blocked."""
        p = self.parameters
        if not 0 <= n < self.size:
            return F(p.lethal_cost)
        value = self.cells[n]
        if value < p.lethal_cost - 1 or (p.allow_unknown and value == 255):
            cost = F(F(F(value) * F(p.cost_factor)) + F(p.neutral_cost))
            return cost if cost < p.lethal_cost else F(p.lethal_cost - 1)
        return F(p.lethal_cost)

    def byte(self, n, *, wrap):
        cost = self.cells[n] + self.parameters.neutral_cost
        return cost % 256 if wrap else min(cost, 255)

    def updated(self, n, cost):
        """The potential that its neighbours give a cell."""
        left, right = self.potential(n - 1), self.potential(n + 1)
        up, down = self.potential(n - self.columns), self.potential(n + self.columns)
        return updated(left, right, up, down, cost)


def dijkstra(area, start, goal, buffer=BUFFER):
    """Blocks of rising priority, until the goal has a potential."""
    p, columns = area.parameters, area.columns
    k = area.index(start)
    pending = set()

    def push(queue, n):
        if n not in pending and area.cost(n) < p.lethal_cost and len(queue) < buffer:
            queue.append(n)
            pending.add(n)

    now = []
    if p.old_navfn_behavior:
        area.set(k, 0.0)
        around = [1, -1, -columns, columns]
    else:
        u, v = (float(F(math.floor(F((c - int(c)) * 100 + 0.5))) / F(100)) for c in start)
        area.set(k, 2 * p.neutral_cost * u * v)
        area.set(k + 1, 2 * p.neutral_cost * (1 - u) * v)
        area.set(k + columns, 2 * p.neutral_cost * u * (1 - v))
        area.set(k + columns + 1, 2 * p.neutral_cost * (1 - u) * (1 - v))
        around = [2, -1, columns - 1, columns + 2, -columns, 1 - columns]
        around += [2 * columns, 2 * columns + 1]
    for step in around:
        push(now, k + step)
    threshold, end = F(p.lethal_cost), area.index(goal)
    later = []
    over = []
    for _ in range(2 * area.size):
        if not now:
            return False
        pending -= set(now)
        for n in now:
            value = area.updated(n, int(area.cost(n)))
            if value >= area.potential(n):
                continue
            area.set(n, float(value))
            for m in (n - 1, n + 1, n - columns, n + columns):
                if area.potential(m) > F(value + F(0.707106781 * float(area.cost(m)))):
                    push(later if value < threshold else over, m)
        now, later = later, []
        if not now:
            threshold = F(threshold + 100)
            now, over = over, []
        if area.potential(end) < HIGH:
            return True
    return False


def fill_around(area, cell, *, wrap):
    for i in range(-2, 3):
        for j in range(-2, 3):
            n = area.index(cell) + i + j * area.columns
            if 0 <= n < area.size and n not in area.found:
                value = area.updated(n, area.byte(n, wrap=wrap))
                if value < HIGH:
                    area.set(n, float(value))


def slope(area, n):
    if n < area.columns or n > area.size - area.columns:
        return F(0), F(0)

    def along(step):
        total, here = F(0), area.potential(n)
        if area.potential(n - step) < HIGH:
            total = F(total + F(area.potential(n - step) - here))
        if area.potential(n + step) < HIGH:
            total = F(total + F(here - area.potential(n + step)))
        return total

    dx, dy = along(1), along(area.columns)
    norm = F(math.sqrt(float(dx) ** 2 + float(dy) ** 2))
    if norm == 0:
        return F(0), F(0)
    return F(F(1 / norm) * dx), F(F(1 / norm) * dy)


def within(distance, point, start):
    return all(abs(float(a) - b) < distance for a, b in zip(point, start, strict=True))


def along_gradient(area, start, goal):
    columns, n = area.columns, area.index(goal)
    dx, dy = (F(c - int(c)) for c in goal)
    points = []
    for _ in range(4 * area.size):
        x, y = F(F(n % columns) + dx), F(F(n // columns) + dy)
        if within(0.5, (x, y), start):
            return [*points, (F(start[0]), F(start[1]))]
        if n < columns or n > area.size - columns:
            return []
        points.append((x, y))
        around = [n + r * columns + c for r in (-1, 0, 1) for c in (-1, 0, 1)]
        if any(area.potential(m) >= HIGH for m in around) or (
            len(points) > 2 and points[-1] == points[-3]
        ):
            best, value = n, int(area.potential(n))
            for m in around:
                if m != n and area.potential(m) < value:
                    best, value = m, int(area.potential(m))
            n, dx, dy = best, F(0), F(0)
            continue
        corners = [slope(area, m) for m in (n, n + 1, n + columns, n + columns + 1)]
        gx, gy = (
            blend(
                blend(corners[0][k], corners[1][k], dx),
                blend(corners[2][k], corners[3][k], dx),
                dy,
            )
            for k in (0, 1)
        )
        if gx == 0 and gy == 0:
            return []
        scale = F(F(0.5) / F(math.sqrt(float(gx) ** 2 + float(gy) ** 2)))
        dx, dy = F(dx + F(gx * scale)), F(dy + F(gy * scale))
        n += int(dx > 1) - int(dx < -1) + columns * (int(dy > 1) - int(dy < -1))
        dx, dy = (F(d - 1) if d > 1 else F(d + 1) if d < -1 else d for d in (dx, dy))
    return []


def read_back(yaw):
    z, w = math.sin(yaw / 2), math.cos(yaw / 2)
    return math.atan2(2 * (w * z), w * w - z * z)


def oriented(points, end, mode, window):
    """Yaws of the points, the last of which is the goal."""
    last = len(points) - 1
    if mode == 0:
        return [0.0] * last + [end]
    yaws = []
    for i in range(last):
        (x0, y0), (x1, y1) = points[max(0, i - window)], points[min(last, i + window)]
        yaws.append(read_back(math.atan2(y1 - y0, x1 - x0)))
    return [*yaws, end]


def plan(grid, start, goal, parameters, quirks):
    """The plan of GlobalPlanner; the grid is not touched."""
    here, there = grid.cell(start.x, start.y), grid.cell(goal.x, goal.y)
    if here is None or there is None:
        return None
    cells = grid.cells.copy()
    cells[here[1], here[0]] = 0
    area, old = Map(cells, parameters), parameters.old_navfn_behavior
    wrap = quirks.global_planner_costs_wrap
    begin, end = (
        (float(cell[0]), float(cell[1]))
        if old
        else ((pose.x - grid.x) / grid.resolution - 0.5, (pose.y - grid.y) / grid.resolution - 0.5)
        for cell, pose in ((here, start), (there, goal))
    )
    with np.errstate(over="ignore"):
        if not dijkstra(area, begin, end):
            return None
        if not old:
            fill_around(area, there, wrap=wrap)
        path = along_gradient(area, begin, end)
    if not path:
        return None
    shift = 0.0 if old else 0.5
    points = [
        (
            (float(x) + shift) * grid.resolution + grid.x,
            (float(y) + shift) * grid.resolution + grid.y,
        )
        for x, y in path[::-1]
    ]
    ends = 2 if old and quirks.global_planner_repeats_goal else 1
    points += [(goal.x, goal.y)] * ends
    mode, window = parameters.orientation_mode, parameters.orientation_window_size
    yaws = oriented(points, goal.yaw, mode, window)
    if ends == 2 and parameters.orientation_mode == 0:
        yaws[-2] = goal.yaw
    return np.column_stack((np.array(points), yaws))
