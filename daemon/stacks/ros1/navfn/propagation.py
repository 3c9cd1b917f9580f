"""What a cell costs navfn, the wave that spreads from the robot, and the path down its potential.

Costs are those of ``setCostmap``, the wave that of ``propNavFnDijkstra`` (blocks of rising
priority), the path that of ``calcPath`` (down the gradient, half a cell at a time).

What a cell ends up with depends on the order of the updates, because an improvement is passed on
only to neighbours that gain more than 0.7 of their cost; the order is therefore the original's.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.cost_grid import INSCRIBED, NO_INFORMATION
from grammars.model.geometry import Floats

NEUTRAL: Final = 50
BLOCKED: Final = 254
PENDING: Final = 256
"""Flag of a cell that waits in a buffer; added to its cost, so that one look tells both."""
DOUBTFUL: Final = 512
"""Flag of a cell that a restricted wave left out, or that what was left out may have changed."""
VALUE: Final = PENDING - 1
"""Mask of what stands below the flags."""
UNREACHED: Final = np.float32(1.0e10)

Bytes: TypeAlias = npt.NDArray[np.uint8]
States: TypeAlias = npt.NDArray[np.uint16]


def translation_table(*, allow_unknown: bool) -> States:
    """Return the cost of every costmap value, (256,) (navfn ``setCostmap``)."""
    values = np.arange(256)
    costs: States = np.minimum(NEUTRAL + 0.8 * values, BLOCKED - 1).astype(np.uint16)
    costs[INSCRIBED:] = BLOCKED
    if allow_unknown:
        costs[NO_INFORMATION] = BLOCKED - 1
    return costs


@kernel
def translate_costs(
    cells: Bytes, costs: States, table: States, x0: int, y0: int, x1: int, y1: int
) -> bool:
    """Renew the costs of a half-open window, never of the border; return whether any changed."""
    rows, columns = cells.shape
    changed = False
    for row in range(max(y0, 1), min(y1, rows - 1)):
        for column in range(max(x0, 1), min(x1, columns - 1)):
            cost = table[cells[row, column]]
            n = row * columns + column
            if cost != costs[n]:
                costs[n] = cost
                changed = True
    return changed


BUFFER: Final = 10_000
"""Cells a priority buffer holds; what does not fit is lost (navfn ``PRIORITYBUFSIZE``)."""
THRESHOLD_STEP: Final = 100.0
GAINS: Final = np.full(2 * DOUBTFUL, np.inf, dtype=np.float32)
"""By cost and flags: how much a neighbour must at least gain, so that it is looked at again. No
gain is enough for a cell that is blocked or waits already."""
GAINS[:BLOCKED] = GAINS[DOUBTFUL : DOUBTFUL + BLOCKED] = 0.707106781 * np.arange(BLOCKED)


@kernel
def interpolate_potential(first: np.float32, second: np.float32, cost: np.float32) -> np.float32:
    """Return the potential of a cell from its lowest horizontal and vertical neighbour, float32."""
    lowest, difference = min(first, second), abs(first - second)
    # The constants of the original are doubles: the polynomial is rounded only at its end.
    q = np.float64(difference / cost)
    share = np.float32(-0.2301 * q * q + 0.5307 * q + 0.7040)
    return lowest + cost * (share if difference < cost else np.float32(1.0))


@kernel
def seed_wave(
    costs: States, potentials: Singles, columns: int, start: int, queue: Integers, reached: Integers
) -> int:
    """Give the start its potential, the first of ``reached``; return how many neighbours wait."""
    potentials[start] = np.float32(0.0)
    reached[0] = start
    waiting = 0
    for cell in (start + 1, start - 1, start - columns, start + columns):
        if 0 <= cell < costs.size and costs[cell] < BLOCKED:
            queue[waiting] = cell
            waiting += 1
            costs[cell] |= PENDING
    return waiting


@kernel
def propagate_wave(
    states: States,
    potentials: Singles,
    table: Singles | None,
    gains: Singles,
    columns: int,
    goal: int,
    threshold: np.float32,
    cycles: int,
    limit: np.float32,
    buffers: Integers,
    waiting: int,
    reached: Integers,
    count: int,
) -> tuple[int, int, bool]:
    """Spread the wave until ``goal`` has a potential, or the threshold passes ``limit``.

    It begins with the ``waiting`` cells of the first of ``buffers``, shape (3, size). ``states``
    and ``potentials`` are flat. What a cell costs stands in its state, or in a ``table`` if there
    is one. The first ``count`` cells of ``reached`` have a potential already; all others are
    ``UNREACHED``, and join them as the wave reaches them, for :func:`reset_potentials`. ``goal`` -1
    is never reached. Returns how many cells were reached, the fill, which is the largest number of
    cells that ever waited in one buffer, and whether nothing was left to do.
    """
    # Event for event the original's loop: its order is the result, so it stays in one piece.
    capacity = buffers.shape[1]
    a, b, c = 0, 1, 2
    now, later, over, fill = waiting, 0, 0, 0
    # Unsigned, so that an index is not looked at for being negative.
    one, line = np.uintp(1), np.uintp(columns)
    for _ in range(cycles):
        if now == 0:
            break
        current, following, postponed = buffers[a], buffers[b], buffers[c]
        for i in range(now):
            states[current[i]] &= PENDING - 1
        for i in range(now):
            n = np.uintp(current[i])
            left, right = potentials[n - one], potentials[n + one]
            up, down = potentials[n - line], potentials[n + line]
            across = left if left < right else right
            along = up if up < down else down
            # A cell in the queue again is pending, its value stands below the flag. The type of
            # the table says which it is: numba compiles only that.
            value = states[n] & np.uint16(VALUE)
            cost = np.float32(value) if table is None else table[value]
            p = interpolate_potential(across, along, cost)
            old = potentials[n]
            if p >= old:
                continue
            if old == UNREACHED:
                reached[count] = n
                count += 1
            potentials[n] = p
            soon = p < threshold
            for k in range(4):
                if k == 0:
                    m, known = n - one, left
                elif k == 1:
                    m, known = n + one, right
                elif k == 2:
                    m, known = n - line, up
                else:
                    m, known = n + line, down
                state = states[m]
                if known <= p + gains[state]:
                    continue
                if soon:
                    if later < capacity:
                        following[later] = m
                        later += 1
                        states[m] = state | PENDING
                elif over < capacity:
                    postponed[over] = m
                    over += 1
                    states[m] = state | PENDING
        a, b = b, a
        fill = max(fill, later, over)
        now, later = later, 0
        if now == 0:
            threshold += np.float32(THRESHOLD_STEP)
            a, c = c, a
            now, over = over, 0
            if threshold > limit:
                break
        if goal >= 0 and potentials[goal] < UNREACHED:
            break
    for i in range(now):
        states[buffers[a, i]] &= PENDING - 1
    for i in range(over):
        states[buffers[c, i]] &= PENDING - 1
    return count, fill, now == 0


@kernel
def reset_potentials(potentials: Singles, log: Integers, count: int) -> None:
    """Make the first ``count`` cells of ``log`` unreached again."""
    for i in range(count):
        potentials[np.uintp(log[i])] = UNREACHED


STEP: Final = np.float32(0.5)


@kernel
def _round_half_away(offset: np.float32) -> int:
    """Round half away from zero, as C does."""
    return math.floor(offset + 0.5) if offset >= 0.0 else math.ceil(offset - 0.5)


@kernel
def _gradient(potentials: Singles, n: int, columns: int) -> tuple[np.float32, np.float32]:
    """Return the normalised gradient at a reached cell, float32; neighbours may be unreached."""
    here = potentials[n]
    dx, dy = np.float32(0.0), np.float32(0.0)
    if potentials[n - 1] < UNREACHED:
        dx += potentials[n - 1] - here
    if potentials[n + 1] < UNREACHED:
        dx += here - potentials[n + 1]
    if potentials[n - columns] < UNREACHED:
        dy += potentials[n - columns] - here
    if potentials[n + columns] < UNREACHED:
        dy += here - potentials[n + columns]
    norm = np.sqrt(dx * dx + dy * dy)
    if norm > np.float32(0.0):
        scale = np.float32(1.0) / norm
        return scale * dx, scale * dy
    return np.float32(0.0), np.float32(0.0)


@kernel
def at_edge(potentials: Singles, n: int, columns: int) -> bool:
    """Tell whether a cell or one of its eight neighbours was not reached."""
    for row in range(-1, 2):
        for column in range(-1, 2):
            if potentials[n + row * columns + column] >= UNREACHED:
                return True
    return False


@kernel
def lowest_around(potentials: Singles, n: int, columns: int) -> int:
    """Return the lowest of a cell and its eight neighbours; potentials compare as integers."""
    best, value = n, int(potentials[n])
    for row in range(-1, 2):
        for column in range(-1, 2):
            m = n + row * columns + column
            if potentials[m] < value:
                best, value = m, int(potentials[m])
    return best


@kernel
def interpolate_rounded(a: np.float32, b: np.float32, share: np.float32) -> np.float32:
    """Return a + share (b - a) rounded as in the original, float32."""
    return np.float32((1.0 - np.float64(share)) * np.float64(a) + np.float64(share * b))


@kernel
def descend_gradient(
    potentials: Singles, columns: int, start: int, goal: int, path: Singles, cells: Integers
) -> int:
    """Write the path from ``goal`` down to ``start`` into ``path``; return its length, or 0.

    ``path`` has shape (steps, 2), column and row of each point [cells], float32; no path is longer.
    ``cells`` (steps,) takes the cell each point was reckoned from.
    """
    # Step for step the original's descent, with everything it remembers in registers.
    size = potentials.size
    n, dx, dy = goal, np.float32(0.0), np.float32(0.0)
    column, row = goal % columns, goal // columns
    before, edge = -1, True
    ax, ay, bx, by = dx, dx, dx, dx
    cx, cy, ex, ey = dx, dx, dx, dx
    for count in range(path.shape[0]):
        cells[count] = n
        nearest = max(0, min(size - 1, n + _round_half_away(dx) + columns * _round_half_away(dy)))
        if potentials[nearest] < NEUTRAL:
            path[count, 0], path[count, 1] = start % columns, start // columns
            return count + 1
        if n <= columns or n >= size - columns - 1:
            return 0
        path[count, 0] = np.float32(column) + dx
        path[count, 1] = np.float32(row) + dy
        swinging = (
            count >= 2
            and path[count, 0] == path[count - 2, 0]
            and path[count, 1] == path[count - 2, 1]
        )
        # Half a cell at a time, every other point is reckoned from the same cells.
        if n != before:
            # The gradients of two cells are known where it has just gone one to the side.
            step, known = n - before, not edge
            before, edge = n, at_edge(potentials, n, columns)
            if edge:
                pass
            elif known and step == 1:
                ax, ay, cx, cy = bx, by, ex, ey
                bx, by = _gradient(potentials, n + 1, columns)
                ex, ey = _gradient(potentials, n + columns + 1, columns)
            elif known and step == -1:
                bx, by, ex, ey = ax, ay, cx, cy
                ax, ay = _gradient(potentials, n, columns)
                cx, cy = _gradient(potentials, n + columns, columns)
            elif known and step == columns:
                ax, ay, bx, by = cx, cy, ex, ey
                cx, cy = _gradient(potentials, n + columns, columns)
                ex, ey = _gradient(potentials, n + columns + 1, columns)
            elif known and step == -columns:
                cx, cy, ex, ey = ax, ay, bx, by
                ax, ay = _gradient(potentials, n, columns)
                bx, by = _gradient(potentials, n + 1, columns)
            else:
                ax, ay = _gradient(potentials, n, columns)
                bx, by = _gradient(potentials, n + 1, columns)
                cx, cy = _gradient(potentials, n + columns, columns)
                ex, ey = _gradient(potentials, n + columns + 1, columns)
        if swinging or edge:
            n = lowest_around(potentials, n, columns)
            column, row = n % columns, n // columns
            dx, dy = np.float32(0.0), np.float32(0.0)
            continue
        x = interpolate_rounded(
            interpolate_rounded(ax, bx, dx), interpolate_rounded(cx, ex, dx), dy
        )
        y = interpolate_rounded(
            interpolate_rounded(ay, by, dx), interpolate_rounded(cy, ey, dx), dy
        )
        if x == np.float32(0.0) and y == np.float32(0.0):
            return 0
        scale = STEP / np.sqrt(x * x + y * y)
        dx += x * scale
        dy += y * scale
        if dx > 1.0:
            n += 1
            column += 1
            dx -= np.float32(1.0)
        if dx < -1.0:
            n -= 1
            column -= 1
            dx += np.float32(1.0)
        if dy > 1.0:
            n += columns
            row += 1
            dy -= np.float32(1.0)
        if dy < -1.0:
            n -= columns
            row -= 1
            dy += np.float32(1.0)
    return 0


@kernel
def path_to_poses(
    path: Singles, shift: float, resolution: float, x: float, y: float, poses: Floats
) -> None:
    """Write a path, cells from the goal, as x, y, yaw 0 from the start into ``poses``, (n, 3).

    ``shift`` [cells] is added; the corner of cell (0, 0) lies at ``x``, ``y``.
    """
    count = path.shape[0]
    for i in range(count):
        k = count - 1 - i
        poses[i, 0] = (np.float64(path[k, 0]) + shift) * resolution + x
        poses[i, 1] = (np.float64(path[k, 1]) + shift) * resolution + y
        poses[i, 2] = 0.0
