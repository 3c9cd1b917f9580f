"""Small maps; fields and waves of navfn on them, addressed by flat cells."""

import numpy as np

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.navfn.field import PotentialField
from daemon.stacks.ros1.navfn.planner import navfn_rules
from daemon.stacks.ros1.navfn.propagation import BUFFER, SPARE_ROWS, navfn_costs, new_wave
from grammars.model.geometry import Pose2


def a_grid(rows=20, columns=40):
    """Return a free map of cells of 5 cm."""
    return CostGrid(0.05, 0.0, 0.0, np.zeros((rows, columns), dtype=np.uint8))


def centre(grid, column, row, yaw=0.0):
    """Return the pose in the middle of a cell."""
    r = grid.resolution
    return Pose2(grid.x + (column + 0.5) * r, grid.y + (row + 0.5) * r, yaw)


def a_field(grid, **given):
    """Return a field of navfn; ``given`` are its margins and from where on they are worthwhile."""
    return PotentialField(grid, navfn_rules(allow_unknown=True), **given)


def path(field, start, goal):
    """Return the path between flat cells of the map."""
    ends = [(n % field.columns, n // field.columns) for n in (start, goal)]
    points = [(float(column), float(row)) for column, row in ends]
    return field.path(*points, ends[1])


def wave_over(costs, columns, buffer=BUFFER):
    """Return a wave over flat costs of navfn, and where its map begins."""
    begin = SPARE_ROWS * columns
    wave = new_wave(navfn_costs(allow_unknown=True), len(costs) + 2 * begin, columns)
    wave.states[begin:-begin] = costs
    return wave._replace(buffers=np.empty((3, buffer), dtype=np.int32)), begin
