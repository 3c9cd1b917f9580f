"""Cost of the cells under a footprint (base_local_planner ``CostmapModel``)."""

from __future__ import annotations

import math

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.map_grid import Cells, place_of
from daemon.stacks.ros1.cost_grid import INSCRIBED, LETHAL
from grammars.model.geometry import Floats


@kernel
def line_cost(cells: Cells, start: tuple[int, int], end: tuple[int, int], spans: Integers) -> int:
    """Return the highest cost on the line between two cells, -1 if one is lethal or unknown.

    A cell is row and column. Bresenham as in base_local_planner ``LineIterator``. ``spans``
    (rows, 2) collects the first and last column per row, unless it has no rows.
    """
    (y, x), (to_y, to_x) = start, end
    dx, dy = abs(to_x - x), abs(to_y - y)
    step_x, step_y = (1 if to_x >= x else -1), (1 if to_y >= y else -1)
    steep = dy > dx
    length, across = (dy, dx) if steep else (dx, dy)
    rest, inside = length // 2, spans.shape[0] > 0
    worst = 0
    for _ in range(length + 1):
        cost = int(cells[y, x])
        if cost >= LETHAL:
            return -1
        worst = max(worst, cost)
        if inside:
            spans[y, 0], spans[y, 1] = min(spans[y, 0], x), max(spans[y, 1], x)
        rest += across
        turn = rest >= length
        if turn:
            rest -= length
        if steep or turn:
            y += step_y
        if turn or not steep:
            x += step_x
    return worst


@kernel
def footprint_cost(
    cells: Cells, frame: Floats, outline: Floats, scale: float, pose: Floats, spans: Integers
) -> int:
    """Return the highest cost under the outline and the centre, -1 for an impossible pose.

    ``pose`` is x, y, yaw, cos(yaw), sin(yaw). A pose is impossible with a lethal or unknown cell
    under the outline or a corner off the grid; inscribed cells do not matter (``CostmapModel``).
    Fewer than three corners are a circle whose centre must stay off inscribed cells. ``spans``
    (rows, 2) is scratch for the cells between the lines; without rows they do not count.
    """
    # Outline and inside in one kernel, called for every pose of every scored trajectory.
    rows, columns = cells.shape
    at = place_of(pose[0], pose[1], frame, rows, columns)
    if at[0] < 0:
        return -1
    worst = int(cells[at[0], at[1]])
    corners = outline.shape[0]
    if corners < 3:
        return worst if worst < INSCRIBED else -1
    if scale == math.inf:
        return -1
    spans[:, 0], spans[:, 1] = columns, -1
    first = previous = at
    for k in range(corners + 1):
        at = first
        if k < corners:
            x, y = scale * outline[k, 0], scale * outline[k, 1]
            x, y = x * pose[3] - y * pose[4], x * pose[4] + y * pose[3]
            at = place_of(pose[0] + x, pose[1] + y, frame, rows, columns)
            if at[0] < 0:
                return -1
        if k == 0:
            first = at
        else:
            cost = line_cost(cells, previous, at, spans)
            if cost < 0:
                return -1
            worst = max(worst, cost)
        previous = at
    for row in range(spans.shape[0]):
        for column in range(spans[row, 0], spans[row, 1] + 1):
            cost = int(cells[row, column])
            if cost >= LETHAL:
                return -1
            worst = max(worst, cost)
    return worst
