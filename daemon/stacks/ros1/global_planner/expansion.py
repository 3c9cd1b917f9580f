"""What a cell costs Dijkstra of global_planner, and its wave from the robot to the goal.

Costs are those of ``DijkstraExpansion::getCost``, the wave that of its ``calculatePotentials``
(blocks of rising priority), the values those of ``QuadraticCalculator`` or
``PotentialCalculator``. As in navfn the order of the updates is part of the result.

Arrays are flat with ``MARGIN`` rows before the first and behind the last one, which are lethal
and never reached. The original looks there, off its arrays, wherever the map has no
outline: what it finds is undefined, here there is nothing. Beside the first and the last column
it looks into the row before or after, which is well defined and kept.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.cost_grid import LETHAL, NO_INFORMATION
from daemon.stacks.ros1.navfn.propagation import BLOCKED, DOUBTFUL, UNREACHED

PENDING: Final = 256
"""Flag of a cell that waits in a buffer; added to its costmap value: one look tells both."""
VALUE: Final = 255
"""Mask of the costmap value."""
THRESHOLD_STEP: Final = 100.0
"""Twice the neutral cost by default. Another ``neutral_cost`` does not change it: the setter that
would is hidden from who calls it (``Expander::setNeutralCost`` is not virtual)."""

MARGIN: Final = 8
"""Rows; even of a map one cell wide the neighbours of what is looked at lie within."""

Bytes: TypeAlias = npt.NDArray[np.uint8]
States: TypeAlias = npt.NDArray[np.uint16]


def cost_tables(
    lethal: int, neutral: int, factor: float, *, allow_unknown: bool
) -> tuple[Singles, Singles]:
    """Return cost and least gain by state, (512,) and with ``DOUBTFUL`` (1024,), float32 each.

    The cost is rounded down to a whole number, as the calculators take it; the gain, from which
    on a neighbour is looked at again, is 0.7 of the exact one, and infinite for cells that are
    blocked or wait already.
    """
    costs = np.zeros(2 * PENDING, dtype=np.float32)
    gains = np.full(2 * DOUBTFUL, np.inf, dtype=np.float32)
    for value in range(PENDING):
        if value >= lethal - 1 and not (allow_unknown and value == NO_INFORMATION):
            continue
        cost = np.float32(value) * np.float32(factor) + np.float32(neutral)
        if cost >= lethal:
            cost = np.float32(lethal - 1)
        costs[value] = costs[value + PENDING] = np.trunc(cost)
        gains[value] = gains[value + DOUBTFUL] = 0.707106781 * np.float64(cost)
    return costs, gains


def guide_table(costs: Singles, gains: Singles) -> States:
    """Return by costmap value the cost that navfn's remainder takes for it, (256,)."""
    whole = np.minimum(costs[:PENDING], BLOCKED - 1).astype(np.uint16)
    return np.where(np.isinf(gains[:PENDING]), np.uint16(BLOCKED), whole)


@kernel
def copy_window(
    cells: Bytes,
    states: States,
    guide: States,
    guide_costs: States,
    outline: bool,
    x0: int,
    y0: int,
    x1: int,
    y1: int,
) -> bool:
    """Renew the states of a half-open window; return whether any changed.

    ``guide`` takes their costs as navfn knows them, from a table of 256. With ``outline`` the
    outermost cells are lethal whatever the costmap says.
    """
    rows, columns = cells.shape
    offset = MARGIN * columns
    changed = False
    for row in range(max(y0, 0), min(y1, rows)):
        for column in range(max(x0, 0), min(x1, columns)):
            value = np.uint16(cells[row, column])
            at_border = row == 0 or column == 0 or row == rows - 1 or column == columns - 1
            if outline and at_border:
                value = np.uint16(LETHAL)
            n = offset + row * columns + column
            if value != states[n]:
                states[n] = value
                guide[n] = guide_costs[value]
                changed = True
    return changed


@kernel
def interpolate_potential(first: np.float32, second: np.float32, cost: np.float32) -> np.float32:
    """Return the potential of a cell from its lowest horizontal and vertical neighbour, float32.

    Beside that of navfn this one may be given a cost of 0.
    """
    lowest, difference = min(first, second), abs(first - second)
    if difference >= cost:
        return lowest + cost
    # The constants of the original are doubles: the polynomial is rounded only at its end.
    q = np.float64(difference / cost)
    return lowest + cost * np.float32(-0.2301 * q * q + 0.5307 * q + 0.7040)


@kernel
def seed_wave(
    states: States,
    potentials: Singles,
    gains: Singles,
    columns: int,
    size: int,
    start: int,
    neutral: int,
    precise: bool,
    x: float,
    y: float,
    queue: Integers,
    reached: Integers,
) -> tuple[int, int]:
    """Give the start its potentials and queue what lies around; return how many of each.

    When ``precise``, the robot is ``x``, ``y`` cells from the centre of ``start`` and the four
    cells between whose centres it stands get potentials, blocked or not; at the border of the map
    some of them would lie off it.
    """
    count, waiting = 0, 0
    begin = MARGIN * columns
    if precise:
        # Rounded to a hundredth, in single precision like floorf.
        u = np.float64(np.float32(math.floor(np.float32(x * 100.0 + 0.5))) / np.float32(100.0))
        v = np.float64(np.float32(math.floor(np.float32(y * 100.0 + 0.5))) / np.float32(100.0))
        for k in range(4):
            n = start + k % 2 + columns * (k // 2)
            if n >= begin + size:
                continue
            across = u if k % 2 == 0 else 1.0 - u
            along = v if k < 2 else 1.0 - v
            potentials[n] = np.float32(neutral * 2 * across * along)
            reached[count] = n
            count += 1
        line = columns
        around = (2, -1, line - 1, line + 2, -line, 1 - line, 2 * line, 2 * line + 1)
        for step in around:
            m = start + step
            if gains[states[m]] < np.inf:
                queue[waiting] = m
                waiting += 1
                states[m] |= PENDING
    else:
        potentials[start] = np.float32(0.0)
        reached[0] = start
        count = 1
        for step in (1, -1, -columns, columns):
            m = start + step
            if gains[states[m]] < np.inf:
                queue[waiting] = m
                waiting += 1
                states[m] |= PENDING
    return count, waiting


@kernel
def propagate_wave(
    states: States,
    potentials: Singles,
    costs: Singles,
    gains: Singles,
    quadratic: bool,
    lethal: int,
    columns: int,
    goal: int,
    cycles: int,
    buffers: Integers,
    waiting: int,
    reached: Integers,
    count: int,
) -> tuple[int, int]:
    """Spread the wave from the ``waiting`` cells of the first buffer until ``goal`` is reached.

    ``buffers`` of shape (3, size) is scratch; ``count`` cells in ``reached`` have a potential
    already. Returns how many have one in the end, and the fill, which is the largest number of
    cells that ever waited in one buffer.
    """
    # Event for event the original's loop: its order is the result, so it stays in one piece.
    capacity = buffers.shape[1]
    a, b, c = 0, 1, 2
    now, later, over = waiting, 0, 0
    threshold = np.float32(lethal)
    fill = 0
    # Unsigned, so that an index is not looked at for being negative.
    one, line = np.uintp(1), np.uintp(columns)
    for _ in range(cycles):
        if now == 0:
            break
        current, following, postponed = buffers[a], buffers[b], buffers[c]
        for i in range(now):
            states[current[i]] &= VALUE
        for i in range(now):
            n = np.uintp(current[i])
            left, right = potentials[n - one], potentials[n + one]
            up, down = potentials[n - line], potentials[n + line]
            across = left if left < right else right
            along = up if up < down else down
            if quadratic:
                p = interpolate_potential(across, along, costs[states[n]])
            else:
                p = min(across, along) + costs[states[n]]
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
                    m, value = n - one, left
                elif k == 1:
                    m, value = n + one, right
                elif k == 2:
                    m, value = n - line, up
                else:
                    m, value = n + line, down
                state = states[m]
                if value <= p + gains[state]:
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
        if potentials[goal] < UNREACHED:
            break
    for i in range(now):
        states[buffers[a, i]] &= VALUE
    for i in range(over):
        states[buffers[c, i]] &= VALUE
    return count, fill


@kernel
def fill_around_goal(
    states: States,
    potentials: Singles,
    quadratic: bool,
    neutral: int,
    wrap: bool,
    columns: int,
    size: int,
    goal: int,
    reached: Integers,
    count: int,
) -> int:
    """Give the 25 cells around the goal a potential where they have none, blocked or not.

    So the gradient is followed up to the exact goal (``Expander::clearEndpoint``). ``wrap``: a
    cost is one byte and 256 is 0. Returns how many cells have a potential now. A cell off the map
    is left out; the original writes there.
    """
    begin = MARGIN * columns
    for i in range(-2, 3):
        for j in range(-2, 3):
            n = goal + i + columns * j
            if n < begin or n >= begin + size or potentials[n] < UNREACHED:
                continue
            cost = byte_cost(states[n], neutral, wrap)
            across = min(potentials[n - 1], potentials[n + 1])
            along = min(potentials[n - columns], potentials[n + columns])
            if quadratic:
                potentials[n] = interpolate_potential(across, along, cost)
            else:
                # A lowest potential below 0 is the start's, at the border; it counts all the same.
                potentials[n] = min(across, along) + cost
            reached[count] = n
            count += 1
    return count


@kernel
def byte_cost(state: int, neutral: int, wrap: bool) -> np.float32:
    """Return costmap value and neutral cost as one byte, which starts again or stays at its end."""
    cost = (state & VALUE) + neutral
    return np.float32(cost & 255 if wrap else min(cost, 255))
