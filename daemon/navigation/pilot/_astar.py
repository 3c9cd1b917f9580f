"""A* on the clearance field: eight neighbours, a binary heap, a cost that keeps off the walls."""

from __future__ import annotations

import math

import numpy as np

from daemon.navigation.kernels import Integers, Singles, kernel

_ROWS = (0, 0, 1, -1, 1, 1, -1, -1)
_COLUMNS = (1, -1, 0, 0, 1, -1, 1, -1)
_ESCAPE_FACTOR = 30.0
"""Cost factor of cells too tight for the robot that it may only cross to get out of them."""


@kernel
def cost_factor(clearance: float, lethal: float, preferred: float, weight: float) -> float:
    """Return what a metre costs at ``clearance`` [m]: 1 in the open, 1 + weight at ``lethal``."""
    if clearance >= preferred:
        return 1.0
    near = (preferred - clearance) / (preferred - lethal)
    return 1.0 + weight * near * near


@kernel
def _factor(
    clearance: Singles,
    row: int,
    column: int,
    start_row: int,
    start_column: int,
    escape2: float,
    lethal: float,
    preferred: float,
    weight: float,
) -> float:
    """Return the cost factor of a cell, 0 when it cannot be crossed."""
    value = float(clearance[row, column])
    if value >= lethal:
        return cost_factor(value, lethal, preferred, weight)
    away2 = float((row - start_row) ** 2 + (column - start_column) ** 2)
    if away2 <= escape2 and value >= 0.5 * lethal:
        return _ESCAPE_FACTOR * (1.0 + weight)
    return 0.0


@kernel
def _push(keys: Singles, items: Integers, count: int, key: float, item: int) -> None:
    child = count
    while child > 0:
        parent = (child - 1) >> 1
        if keys[parent] <= key:
            break
        keys[child], items[child] = keys[parent], items[parent]
        child = parent
    keys[child], items[child] = key, item


@kernel
def _pop(keys: Singles, items: Integers, count: int) -> None:
    """Remove the root of a heap of ``count`` entries."""
    last = count - 1
    key, item = keys[last], items[last]
    parent = 0
    while True:
        child = 2 * parent + 1
        if child >= last:
            break
        if child + 1 < last and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[parent], items[parent] = keys[child], items[child]
        parent = child
    keys[parent], items[parent] = key, item


@kernel
def search(
    clearance: Singles,
    start_row: int,
    start_column: int,
    goal_row: int,
    goal_column: int,
    lethal: float,
    preferred: float,
    weight: float,
    escape: float,
) -> tuple[Integers, float]:
    """Return the cheapest path as flat cell indices from start to goal, and its cost [cells].

    Cells with ``clearance`` below ``lethal`` [m] are closed; within ``escape`` cells of the start,
    where the robot may already stand too close to something, only those below half of it. A step
    costs its length times the mean cost factor of its two cells; a diagonal needs both cells
    beside it. Without a path the result is empty and the cost infinite.
    """
    rows, columns = clearance.shape
    goal = goal_row * columns + goal_column
    start = start_row * columns + start_column
    spent = np.full(rows * columns, np.inf, dtype=np.float32)
    came = np.full(rows * columns, -1, dtype=np.int8)
    done = np.zeros(rows * columns, dtype=np.uint8)
    keys, items = np.empty(1 << 16, dtype=np.float32), np.empty(1 << 16, dtype=np.int32)
    diagonal = math.sqrt(2.0)
    spent[start] = 0.0
    keys[0], items[0] = 0.0, start
    count = 1
    escape2 = escape * escape
    while count > 0:
        here = items[0]
        _pop(keys, items, count)
        count -= 1
        if done[here]:
            continue
        done[here] = 1
        if here == goal:
            break
        row, column = here // columns, here % columns
        factor = _factor(
            clearance, row, column, start_row, start_column, escape2, lethal, preferred, weight
        )
        for k in range(8):
            r, c = row + _ROWS[k], column + _COLUMNS[k]
            if r < 0 or c < 0 or r >= rows or c >= columns:
                continue
            there = r * columns + c
            if done[there]:
                continue
            other = _factor(
                clearance, r, c, start_row, start_column, escape2, lethal, preferred, weight
            )
            if other == 0.0:
                continue
            length = 1.0
            if k >= 4:
                length = diagonal
                if (
                    _factor(clearance, row, c, start_row, start_column, escape2, lethal,
                            preferred, weight) == 0.0
                    or _factor(clearance, r, column, start_row, start_column, escape2, lethal,
                               preferred, weight) == 0.0
                ):  # fmt: skip
                    continue
            cost = spent[here] + 0.5 * length * (factor + other)
            if cost >= spent[there]:
                continue
            spent[there] = cost
            came[there] = k
            dr, dc = abs(r - goal_row), abs(c - goal_column)
            ahead = max(dr, dc) + (diagonal - 1.0) * min(dr, dc)
            if count == keys.shape[0]:
                keys = np.concatenate((keys, np.empty_like(keys)))
                items = np.concatenate((items, np.empty_like(items)))
            _push(keys, items, count, cost + ahead, there)
            count += 1
    if not done[goal]:
        return np.empty(0, dtype=np.int32), np.inf
    length_of_path = 1
    cell = goal
    while cell != start:
        cell -= _ROWS[came[cell]] * columns + _COLUMNS[came[cell]]
        length_of_path += 1
    path = np.empty(length_of_path, dtype=np.int32)
    cell = goal
    for i in range(length_of_path - 1, -1, -1):
        path[i] = cell
        if cell != start:
            cell -= _ROWS[came[cell]] * columns + _COLUMNS[came[cell]]
    return path, float(spent[goal])
