"""Costs in the order of the original's queue (``inflation_queue_order``)."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.costmap import InflationLayer, LayeredCostmap, StaticLayer
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2
from grammars.model.grid import OccupancyGrid
from tests.stacks.ros1.costmap.plain import by_queue, cost

ORDERED = replace(FAST, inflation_queue_order=True)
INFLATION = InflationLayer(inflation_radius=0.25, cost_scaling_factor=3.0)
POINT = 0.02
"""Half the side of a robot so small that only its middle counts [m]."""
SQUARE = ((-POINT, -POINT), (-POINT, POINT), (POINT, POINT), (POINT, -POINT))
THREE = ((0, 0), (2, 1), (3, 3))


def costmap(cells, *, ordered, inflation=INFLATION):
    """A map below an inflation, for a robot without padding."""
    parameters = LayeredCostmap((StaticLayer(), inflation), footprint=SQUARE, footprint_padding=0.0)
    grid = OccupancyGrid(0.05, 0.0, 0.0, cells.astype(np.int8))
    quirks = ORDERED if ordered else FAST
    return Costmap(parameters, parameters.padded_footprint(), quirks, grid)


def occupied(rows, columns, places):
    """``places`` are columns and rows."""
    cells = np.zeros((rows, columns), dtype=np.int8)
    for x, y in places:
        cells[y, x] = 100
    return cells


def at(squared):
    """The cost at a squared distance [cells^2]."""
    return cost(math.sqrt(squared), INFLATION, POINT, 0.05)


def test_it_is_off_unless_asked_for():
    assert not FAST.inflation_queue_order
    assert not FIXED.inflation_queue_order


@pytest.mark.parametrize("updates", [0, 1, 3])
def test_a_cell_whose_neighbours_have_other_obstacles_never_hears_of_its_own(updates):
    """Four rows of four cells, the highest first, a and b and c occupied::

        . . . c
        . . . .
        . . b .
        a . . .

    The upper left corner is nearest to b, at squared distance 4 + 4; to a and c it is 9. The cell
    below it has a, at 4, not b, at 4 + 1; the cell right of it c, at 4, not b, at 4 + 1. Neither
    passes b on, and the corner gets a or c.
    """
    cells = occupied(4, 4, THREE)
    nearest, first = costmap(cells, ordered=False), costmap(cells, ordered=True)
    for _ in range(updates):
        nearest.update(Pose2(0.1, 0.1))
        first.update(Pose2(0.1, 0.1))
    squared = np.array(
        [[0, 1, 1, 2], [1, 1, 0, 1], [4, 2, 1, 1], [9, 4, 1, 0]],
    )
    exact = squared.copy()
    exact[3, 0] = 8
    as_costs = np.vectorize(at)
    np.testing.assert_array_equal(first.grid.cells, as_costs(squared))
    np.testing.assert_array_equal(nearest.grid.cells, as_costs(exact))
    assert at(9) < at(8)


def test_what_lies_farther_than_the_radius_costs_nothing():
    """With a radius of 2 cells the corner is reached by none of the three."""
    near = replace(INFLATION, inflation_radius=0.1)
    first = costmap(occupied(4, 4, THREE), ordered=True, inflation=near)
    assert first.grid.cells[3, 0] == 0
    assert first.grid.cells[2, 0] == at(4)
    nothing = replace(INFLATION, inflation_radius=0.0)
    first = costmap(occupied(4, 4, THREE), ordered=True, inflation=nothing)
    first.update(Pose2(0.1, 0.1))
    assert np.count_nonzero(first.grid.cells) == 3


def slanted(rng, rows, columns, walls):
    """Walls at random angles, and free and unknown cells around them."""
    cells = rng.choice(np.array([0, -1]), (rows, columns), p=[0.9, 0.1])
    for _ in range(walls):
        begin, angle = rng.uniform((0.0, 0.0), (rows, columns)), rng.uniform(0.0, math.pi)
        along = np.arange(0.0, rng.uniform(5.0, 40.0), float(rng.choice([0.3, 1.0, 1.7])))
        ends = begin + along[:, None] * (math.sin(angle), math.cos(angle))
        row, column = ends[((ends >= 0.0) & (ends < (rows, columns))).all(axis=1)].astype(int).T
        cells[row, column] = 100
    return cells


@given(
    seed=st.integers(0, 2**32 - 1),
    walls=st.integers(0, 6),
    radius=st.sampled_from([0.04, 0.1, 0.27, 0.55]),
)
def test_distances_are_those_of_the_plain_queue(seed, walls, radius):
    rng = np.random.default_rng(seed)
    cells = slanted(rng, 40, 50, walls)
    layer = replace(INFLATION, inflation_radius=radius)
    first = costmap(cells, ordered=True, inflation=layer)
    lethal = [(int(x), int(y)) for y, x in np.argwhere(cells == 100)]
    away = by_queue(lethal, (40, 50), math.ceil(radius / 0.05))
    expected = np.where(cells == -1, 255, 0)
    for y, x in np.argwhere(away < np.inf).tolist():
        value = cost(float(away[y, x]), layer, POINT, 0.05)
        if cells[y, x] != -1 or value >= 253:
            expected[y, x] = value
    np.testing.assert_array_equal(first.grid.cells, expected)


def test_all_sides_of_a_solid_block_are_inflated():
    block = tuple((x, y) for x in range(6, 11) for y in range(6, 11))
    made = costmap(occupied(17, 17, block), ordered=False)
    made.update(Pose2(0.1, 0.1))
    cells = made.grid.cells
    for away in range(1, 6):
        sides = (cells[8, 6 - away], cells[8, 10 + away], cells[6 - away, 8], cells[10 + away, 8])
        assert [int(cost) for cost in sides] == [at(away * away)] * 4
