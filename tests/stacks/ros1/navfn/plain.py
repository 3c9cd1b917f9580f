"""navfn written down plainly: the yardstick of the compiled version, for small grids."""

import math

import numpy as np

F = np.float32
HIGH = F(1e10)


def costs_of(cells, *, allow_unknown=True):
    """Flat costs with the blocked ring around the map."""
    costs = np.array(
        [
            min(253, int(50 + 0.8 * v)) if v < 253 else 253 if v == 255 and allow_unknown else 254
            for v in cells.ravel().tolist()
        ]
    ).reshape(cells.shape)
    costs[0], costs[-1], costs[:, 0], costs[:, -1] = (254,) * 4
    return costs.ravel()


def updated(left, right, up, down, cost):
    """The new potential of a cell between its four neighbours."""
    c, hf = min(left, right), F(cost)
    a = min(up, down)
    low, difference = min(a, c), abs(F(c - a))
    if difference >= hf:
        return F(low + hf)
    q = float(F(difference / hf))
    return F(low + F(hf * F(-0.2301 * q * q + 0.5307 * q + 0.7040)))


def wave(costs, columns, start, goal, size=10_000, ahead=None, bound=HIGH, log=None):
    """The potential when the goal first has one; ``size`` of the priority buffers.

    Cells are left out where threshold and ``ahead`` exceed ``bound``. ``log`` takes every cell that
    is looked at, in order, and -1 - n for a cell n left out.
    """
    pot = np.full(costs.size, HIGH, dtype=F)
    pot[start] = 0
    pending = set()

    def push(buffer, n):
        if 0 <= n < costs.size and n not in pending and costs[n] < 254 and len(buffer) < size:
            buffer.append(n)
            pending.add(n)

    now = []
    for n in (start + 1, start - 1, start - columns, start + columns):
        push(now, n)
    later = []
    over = []
    threshold = F(254)
    rows = costs.size // columns
    with np.errstate(over="ignore"):
        for _ in range(max(costs.size // 20, rows + columns)):
            if not now:
                break
            pending -= set(now)
            for n in now:
                left_out = ahead is not None and ahead[n] > F(bound - threshold)
                if log is not None:
                    log.append(~n if left_out else n)
                if left_out:
                    continue
                around = (n - 1, n + 1, n - columns, n + columns)
                values = [F(pot[m]) for m in around]
                p = updated(*values, int(costs[n]))
                if p < pot[n]:
                    pot[n] = p
                    for m, value in zip(around, values, strict=True):
                        if value > F(p + F(0.707106781 * costs[m])):
                            push(later if p < threshold else over, m)
            now, later = later, []
            if not now:
                threshold = F(threshold + 100)
                now, over = over, []
            if pot[goal] < HIGH:
                break
    return pot


def gradient(pot, n, columns):
    def slope(before, after):
        total = F(0)
        if pot[before] < HIGH:
            total = F(total + F(pot[before] - pot[n]))
        if pot[after] < HIGH:
            total = F(total + F(pot[n] - pot[after]))
        return total

    dx, dy = slope(n - 1, n + 1), slope(n - columns, n + columns)
    norm = F(np.sqrt(F(F(dx * dx) + F(dy * dy))))
    if norm == 0:
        return F(0), F(0)
    scale = F(1 / norm)
    return F(scale * dx), F(scale * dy)


def blend(a, b, share):
    return F((1.0 - float(share)) * float(a) + float(F(share * b)))


def path(pot, columns, goal):
    """Points from the goal down to the robot, in cells; empty when there is no way."""

    def rounded(v):
        return int(math.copysign(math.floor(abs(float(v)) + 0.5), float(v)))

    n, dx, dy = goal, F(0), F(0)
    points = []
    for _ in range(4 * columns):
        nearest = min(max(n + rounded(dx) + columns * rounded(dy), 0), pot.size - 1)
        if pot[nearest] < 50:
            start = int(np.argmin(pot))
            return [*points, (F(start % columns), F(start // columns))]
        if n <= columns or n >= pot.size - columns - 1:
            return []
        points.append((F(F(n % columns) + dx), F(F(n // columns) + dy)))
        around = [n + r * columns + c for r in (-1, 0, 1) for c in (-1, 0, 1)]
        if (pot[around] >= HIGH).any() or (len(points) > 2 and points[-1] == points[-3]):
            best, value = n, int(pot[n])
            for m in around:
                if pot[m] < value:
                    best, value = m, int(pot[m])
            n, dx, dy = best, F(0), F(0)
            continue
        corners = [gradient(pot, m, columns) for m in (n, n + 1, n + columns, n + columns + 1)]
        x, y = (
            blend(
                blend(corners[0][k], corners[1][k], dx),
                blend(corners[2][k], corners[3][k], dx),
                dy,
            )
            for k in (0, 1)
        )
        if x == 0 and y == 0:
            return []
        scale = F(F(0.5) / F(np.sqrt(F(F(x * x) + F(y * y)))))
        dx, dy = F(dx + F(x * scale)), F(dy + F(y * scale))
        if dx > 1:
            n, dx = n + 1, F(dx - 1)
        if dx < -1:
            n, dx = n - 1, F(dx + 1)
        if dy > 1:
            n, dy = n + columns, F(dy - 1)
        if dy < -1:
            n, dy = n - columns, F(dy + 1)
    return []


def plan(grid, start, goal, *, allow_unknown=True):
    """The plan of NavfnROS without tolerance; the grid is not touched."""
    here, there = grid.cell(start.x, start.y), grid.cell(goal.x, goal.y)
    if here is None or there is None:
        return None
    cells = grid.cells.copy()
    cells[here[1], here[0]] = 0
    columns = cells.shape[1]
    begin, end = here[1] * columns + here[0], there[1] * columns + there[0]
    pot = wave(costs_of(cells, allow_unknown=allow_unknown), columns, begin, end)
    if pot[end] >= HIGH:
        return None
    points = path(pot, columns, end)
    if not points:
        return None
    line = np.array(points[::-1], dtype=float) * grid.resolution + (grid.x, grid.y)
    poses = np.column_stack((line, np.zeros(len(line))))
    return np.vstack((poses, (goal.x, goal.y, goal.yaw)))
