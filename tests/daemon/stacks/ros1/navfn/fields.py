"""Fields and waves of navfn on small maps, addressed by flat cells."""

import numpy as np

from daemon.stacks.ros1.navfn.field import PotentialField
from daemon.stacks.ros1.navfn.planner import navfn_rules
from daemon.stacks.ros1.navfn.propagation import BUFFER, MARGIN, navfn_costs, new_wave


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
    begin = MARGIN * columns
    wave = new_wave(navfn_costs(allow_unknown=True), len(costs) + 2 * begin, columns)
    wave.states[begin:-begin] = costs
    return wave._replace(buffers=np.empty((3, buffer), dtype=np.int32)), begin
