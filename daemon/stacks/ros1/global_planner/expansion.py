"""Costs of cells for Dijkstra of global_planner, and the two ends of its wave.

Costs are those of ``DijkstraExpansion::getCost``. The wave of its ``calculatePotentials`` with the
values of ``QuadraticCalculator`` is that of navfn (:func:`.navfn.propagation.propagate_wave`).

Arrays are flat with ``MARGIN`` rows before the first and behind the last one, which are lethal
and never reached. The original looks there, off its arrays, wherever the map has no
outline: what it finds is undefined, here there is nothing. Beside the first and the last column
it looks into the row before or after, which is well defined and kept.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.cost_grid import LETHAL, NO_INFORMATION
from daemon.stacks.ros1.navfn.propagation import (
    BLOCKED,
    DOUBTFUL,
    PENDING,
    UNREACHED,
    VALUE,
    Bytes,
    States,
    interpolate_potential,
)

MARGIN: Final = 8
"""Rows; even of a map one cell wide the neighbours of what is looked at lie within."""


def cost_tables(
    lethal: int, neutral: int, factor: float, *, allow_unknown: bool
) -> tuple[Singles, Singles]:
    """Return cost by costmap value, (256,), and least gain by state, (1024,), float32 each.

    The cost is rounded down to a whole number, as the calculators take it; the gain, from which
    on a neighbour is looked at again, is 0.7 of the exact one, and infinite for cells that are
    blocked or wait already.
    """
    costs = np.zeros(PENDING, dtype=np.float32)
    gains = np.full(2 * DOUBTFUL, np.inf, dtype=np.float32)
    for value in range(PENDING):
        if value >= lethal - 1 and not (allow_unknown and value == NO_INFORMATION):
            continue
        cost = np.float32(value) * np.float32(factor) + np.float32(neutral)
        if cost >= lethal:
            cost = np.float32(lethal - 1)
        costs[value] = np.trunc(cost)
        gains[value] = gains[value + DOUBTFUL] = 0.707106781 * np.float64(cost)
    return costs, gains


def guide_table(costs: Singles, gains: Singles) -> States:
    """Return by costmap value the cost that navfn's remainder takes for it, (256,)."""
    whole = np.minimum(costs, BLOCKED - 1).astype(np.uint16)
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
def fill_around_goal(
    states: States,
    potentials: Singles,
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
            byte = (states[n] & VALUE) + neutral
            cost = np.float32(byte & 255 if wrap else min(byte, 255))
            across = min(potentials[n - 1], potentials[n + 1])
            along = min(potentials[n - columns], potentials[n + columns])
            # At the border the start's potential may lie below 0; it counts all the same.
            free = cost == np.float32(0.0)
            potentials[n] = (
                min(across, along) if free else interpolate_potential(across, along, cost)
            )
            reached[count] = n
            count += 1
    return count
