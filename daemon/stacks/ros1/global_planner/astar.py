"""A* of global_planner (``AStarExpansion``): four neighbours, each cell valued once.

The potential of a cell is what its first discoverer gave it and never improves, so paths are not
the cheapest. Which of equal candidates comes first depends on the heap: it is that of libstdc++
(``std::push_heap``, ``std::pop_heap``), move for move.
"""

from __future__ import annotations

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.cost_grid import NO_INFORMATION
from daemon.stacks.ros1.global_planner.expansion import (
    MARGIN,
    VALUE,
    States,
    byte_cost,
    interpolate_potential,
)
from daemon.stacks.ros1.navfn.propagation import UNREACHED


@kernel
def _sift_up(cells: Integers, costs: Singles, hole: int, cell: int, cost: np.float32) -> None:
    """Put an entry in at ``hole`` or above."""
    parent = (hole - 1) // 2
    while hole > 0 and costs[parent] > cost:
        cells[hole], costs[hole] = cells[parent], costs[parent]
        hole = parent
        parent = (hole - 1) // 2
    cells[hole], costs[hole] = cell, cost


@kernel
def pop_lowest(cells: Integers, costs: Singles, length: int) -> int:
    """Take the first of ``length`` entries out of the heap and return its cell."""
    lowest = cells[0]
    length -= 1
    if length == 0:
        return int(lowest)
    cell, cost = cells[length], costs[length]
    # Down to a leaf first and up from there, which is not the same among equals.
    hole, child = 0, 0
    while child < (length - 1) // 2:
        child = 2 * (child + 1)
        if costs[child] > costs[child - 1]:
            child -= 1
        cells[hole], costs[hole] = cells[child], costs[child]
        hole = child
    if length % 2 == 0 and child == (length - 2) // 2:
        child = 2 * (child + 1)
        cells[hole], costs[hole] = cells[child - 1], costs[child - 1]
        hole = child - 1
    _sift_up(cells, costs, hole, cell, cost)
    return int(lowest)


@kernel
def search_astar(
    states: States,
    potentials: Singles,
    quadratic: bool,
    allow_unknown: bool,
    lethal: int,
    neutral: int,
    wrap: bool,
    columns: int,
    size: int,
    start: int,
    goal: int,
    cells: Integers,
    totals: Singles,
    reached: Integers,
) -> int:
    """Search from ``start`` to ``goal``; ``cells`` and ``totals`` (size + 1,) are scratch.

    What is expected to remain is the distance along rows and columns in free cells. Returns how
    many cells in ``reached`` have a potential; the goal is among them unless there is no way.
    ``wrap``: a cost is one byte and 256 is 0.
    """
    begin = MARGIN * columns
    goal_row, goal_column = (goal - begin) // columns, (goal - begin) % columns
    cells[0], totals[0] = start, np.float32(0.0)
    potentials[start] = np.float32(0.0)
    reached[0] = start
    length, count = 1, 1
    for _ in range(2 * size):
        if length == 0:
            break
        n = pop_lowest(cells, totals, length)
        length -= 1
        if n == goal:
            return count
        for step in (1, -1, columns, -columns):
            m = n + step
            if m < begin or m >= begin + size or potentials[m] < UNREACHED:
                continue
            value = states[m] & VALUE
            if value >= lethal and not (allow_unknown and value == NO_INFORMATION):
                continue
            cost = byte_cost(value, neutral, wrap)
            if quadratic:
                across = min(potentials[m - 1], potentials[m + 1])
                along = min(potentials[m - columns], potentials[m + columns])
                p = interpolate_potential(across, along, cost)
            else:
                p = potentials[n] + cost
            potentials[m] = p
            reached[count] = m
            count += 1
            row, column = (m - begin) // columns, (m - begin) % columns
            away = np.float32(abs(goal_column - column) + abs(goal_row - row))
            _sift_up(cells, totals, length, m, p + away * np.float32(neutral))
            length += 1
    return count
