"""Which cells a scan clears and marks, one by one.

What is expected was followed on paper through the published costmap_2d (Noetic): the clipping in
``ObstacleLayer::raytraceFreespace``, the lines in ``Costmap2D::raytraceLine`` and ``bresenham2D``,
marking in ``ObstacleLayer::updateBounds``, the polygon in ``Costmap2D::convexFillCells``. Cells are
one metre large, so that a cell is the whole part of a coordinate.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from grammars.model.geometry import Pose2
from tests.stacks.ros1.costmap.pictures import HERE, build, drawn, free, marked, rays


# raytraceLine: the axis with more cells leads (x of equals), the error begins at half its cells
# rounded down, grows by the cells of the other axis, and steps aside when it reaches the cells of
# the leading one; bresenham2D acts before each step and once more at the end.
@pytest.mark.parametrize(
    ("begin", "end", "cells"),
    [
        # dx 7, dy 3, error 3, then 6, 9-7, 5, 8-7, 4, 7-7, 3.
        ((1, 1), (8, 4), [(1, 1), (2, 1), (3, 2), (4, 2), (5, 3), (6, 3), (7, 4), (8, 4)]),
        # dx 4, dy 2, error 2, then 4-4, 2, 4-4, 2: half a cell to the side is a step already, so
        # the way back clears other cells.
        ((1, 1), (5, 3), [(1, 1), (2, 2), (3, 2), (4, 3), (5, 3)]),
        ((5, 3), (1, 1), [(5, 3), (4, 2), (3, 2), (2, 1), (1, 1)]),
        # dy leads: dx 2, dy 5, error 2, then 4, 6-5, 3, 5-5, 2.
        ((1, 1), (3, 6), [(1, 1), (1, 2), (2, 3), (2, 4), (3, 5), (3, 6)]),
        # dx -3, dy 5, error 2, then 5-5, 3, 6-5, 4, 7-5.
        ((8, 1), (5, 6), [(8, 1), (7, 2), (7, 3), (6, 4), (6, 5), (5, 6)]),
        ((6, 6), (3, 3), [(6, 6), (5, 5), (4, 4), (3, 3)]),
        ((3, 4), (3, 4), [(3, 4)]),
        ((9, 2), (6, 2), [(9, 2), (8, 2), (7, 2), (6, 2)]),
        ((2, 6), (2, 3), [(2, 6), (2, 5), (2, 4), (2, 3)]),
    ],
)
@pytest.mark.parametrize(
    ("origin", "yaw"), [((0.0, 0.0), 0.0), ((-5.0, -3.0), 2.5), ((40.0, -60.0), -0.7)]
)
def test_a_ray_clears_the_cells_of_a_line_with_both_its_ends(begin, end, cells, origin, yaw):
    costmap = build(12, 8, origin=origin)
    near, far = ((origin[0] + x + 0.4, origin[1] + y + 0.4) for x, y in (begin, end))
    costmap.update(HERE, (rays(near, (far[0] + 0.2, far[1] + 0.2), yaw=yaw),))
    assert free(costmap) == set(cells)


# cellDistance rounds the range up to whole cells; of those the share that the leading axis has in
# the length of the line is taken, rounded down: scale = min(1, cells / hypot(dx, dy)).
@pytest.mark.parametrize(
    ("reach", "cells"),
    [
        # 8.0 cells of 7.62: the whole line.
        (8.0, [(1, 1), (2, 1), (3, 2), (4, 2), (5, 3), (6, 3), (7, 4), (8, 4)]),
        # 3.2 m are 4 cells: 4 / 7.62 * 7 = 3.7, three steps.
        (3.2, [(1, 1), (2, 1), (3, 2), (4, 2)]),
        (4.0, [(1, 1), (2, 1), (3, 2), (4, 2)]),
        # 4.001 m are 5: 4.6 steps.
        (4.001, [(1, 1), (2, 1), (3, 2), (4, 2), (5, 3)]),
        (3.0, [(1, 1), (2, 1), (3, 2)]),
        (0.0, [(1, 1)]),
    ],
)
def test_the_raytrace_range_counts_whole_cells_along_the_leading_axis(reach, cells):
    costmap = build(12, 8, raytrace_range=reach)
    costmap.update(HERE, (rays((1.5, 1.5), (8.5, 4.5)),))
    assert free(costmap) == set(cells)


def test_the_share_of_a_straight_line_may_round_to_a_cell_less():
    # 13 / 23 * 23 is 12.999999999999998 in double precision: twelve steps instead of thirteen.
    costmap = build(30, 1, raytrace_range=13.0)
    costmap.update(HERE, (rays((0.5, 0.5), (23.5, 0.5)),))
    assert free(costmap) == {(x, 0) for x in range(13)}
    costmap = build(30, 1, raytrace_range=13.0)
    costmap.update(HERE, (rays((0.5, 0.5), (24.5, 0.5)),))
    assert free(costmap) == {(x, 0) for x in range(14)}


@pytest.mark.parametrize(
    ("end", "cells"),
    [
        # a 7, b 3: t = 3.5 / 7, so y = 4.4 + 1.5 = 5.9, x = 11.999.
        ((15.5, 7.4), [(8, 4), (9, 4), (10, 5), (11, 5)]),
        # Off the left side x is 0 itself: t = 8.5 / 17, y = 4.4 - 2; error 4, 6, 8-8, ...
        ((-8.5, 0.4), [(8, 4), (7, 4), (6, 3), (5, 3), (4, 3), (3, 3), (2, 2), (1, 2), (0, 2)]),
        # Off the top: t = 3.6 / 7.2, x = 8.5 + 1.
        ((10.5, 11.6), [(8, 4), (8, 5), (9, 6), (9, 7)]),
        # Off the bottom y is 0: t = 4.4 / 8.8, x = 8.5 - 1.55; error 2, 4-4, 2, 4-4.
        ((5.4, -4.4), [(8, 4), (7, 3), (7, 2), (6, 1), (6, 0)]),
        # Off the right first (y would be 8.6), then off the top: t = 3.6 / 12, x = 8.5 + 3 = 11.5.
        ((18.5, 16.4), [(8, 4), (9, 5), (10, 6), (11, 7)]),
        # Off the left (y = -4.1), then off the bottom: t = 4.4 / 17, x = 8.5 - 4.4 = 4.1.
        ((-8.5, -12.6), [(8, 4), (7, 3), (6, 2), (5, 1), (4, 0)]),
    ],
)
def test_a_ray_that_leaves_the_grid_ends_at_its_edge(end, cells):
    costmap = build(12, 8)
    costmap.update(HERE, (rays((8.5, 4.4), end),))
    assert free(costmap) == set(cells)


def test_an_edge_below_and_left_belongs_to_the_grid_and_one_above_and_right_does_not():
    # worldToMap: not below the origin, and a whole part less than the size. A ray that ends on the
    # far edge is not beyond it either, so it is not cut off, has no cell to end in, clears nothing
    # and marks nothing.
    for end in ((12.0, 4.5), (8.5, 8.0)):
        costmap = build(12, 8, obstacle_range=20.0)
        costmap.update(HERE, (rays((8.5, 4.5), end),))
        assert free(costmap) == marked(costmap) == set()
        # Nor at the other end of the grid, as this ray shows: its bounds hold columns 0 to 8.
        costmap.update(HERE, (rays((8.5, 4.5), (0.5, 6.5)),))
        assert marked(costmap) == {(0, 6)}
    costmap = build(12, 8)
    costmap.update(HERE, (rays((3.5, 4.5), (0.0, 4.5)),))
    assert free(costmap) == {(x, 4) for x in range(4)}


@pytest.mark.parametrize("begin", [(-0.5, 4.5), (12.0, 4.5), (4.5, -0.001), (4.5, 8.0)])
def test_a_laser_off_the_grid_clears_nothing_but_marks(begin):
    costmap = build(12, 8, obstacle_range=20.0)
    costmap.update(HERE, (rays(begin, (5.5, 2.5)),))
    assert free(costmap) == set()
    assert costmap.grid.cells[2, 5] == 254


def test_a_return_marks_nearer_than_the_obstacle_range_and_is_cleared_beyond_it():
    # sq_dist >= sq_obstacle_range leaves it out; the end of the line has been cleared before.
    for reach, sign in ((5.0, "."), (5.001, "#")):
        costmap = build(8, 1, obstacle_range=reach)
        costmap.update(HERE, (rays((0.5, 0.5), (5.5, 0.5)),))
        assert drawn(costmap) == ["....." + sign + "??"]


def test_of_one_scan_all_rays_clear_before_any_return_marks():
    costmap = build(8, 3, obstacle_range=20.0)
    costmap.update(HERE, (rays((0.5, 1.5), (3.5, 1.5), (6.5, 1.5), (4.5, 2.5)),))
    # To (4, 2): dx 4, dy 1, error 2, then 3, 4-4.
    assert drawn(costmap) == [
        "??..#???",
        "...#..#?",
        "????????",
    ]


def test_what_was_marked_is_cleared_by_the_line_of_a_later_ray_only():
    costmap = build(8, 5, obstacle_range=20.0)
    costmap.update(HERE, (rays((0.5, 0.5), (2.5, 1.5), (3.5, 1.5), (4.5, 3.5)),))
    assert marked(costmap) == {(2, 1), (3, 1), (4, 3)}
    # To (6, 2): dx 6, dy 2, error 3, then 5, 7-6, 3, 5, 7-6, 3: through (2, 1) and (3, 1).
    costmap.update(HERE, (rays((0.5, 0.5), (6.5, 2.5)),))
    assert marked(costmap) == {(4, 3), (6, 2)}


@pytest.mark.parametrize(
    ("away", "seen"),
    [(0.9, False), (1.0, True), (math.nextafter(5.0, 0.0), False), (4.9999, True), (5.0, False)],
)
def test_a_ray_counts_from_the_least_range_on_and_below_the_greatest(away, seen):
    # laser_geometry: range >= range_min and range < range_cutoff, all in single precision, in which
    # the double before 5 is 5.
    costmap = build(8, 1)
    costmap.update(HERE, (rays((0.5, 0.5), (0.5 + away, 0.5), nearest=1.0, farthest=5.0),))
    assert bool(free(costmap)) == seen


def test_a_valid_infinity_marks_at_the_end_of_the_range_where_obstacles_may_be_that_far():
    # laserScanValidInfCallback makes it a return at range_max - 0.0001 like any other.
    scan = replace(
        rays((0.5, 0.5), (1.5, 0.5), farthest=4.0), ranges=np.array([np.inf], np.float32)
    )
    costmap = build(8, 1, inf_is_valid=True, obstacle_range=3.9)
    costmap.update(HERE, (scan,))
    assert drawn(costmap) == [".....???"]
    costmap = build(8, 1, inf_is_valid=True, obstacle_range=4.0)
    costmap.update(HERE, (scan,))
    assert drawn(costmap) == ["....#???"]


def test_points_are_moved_in_single_precision():
    """A point that rounds into another cell on its way (``doTransform`` of tf2_sensor_msgs).

    At 50 m a number of single precision is 3.8 um large. The laser stands at y = 50 + 1.7 um,
    which is 50 in single precision, and looks along y: 3.0000002 more makes 53.0000002, which is
    53. In double the sum is 53.0000019, which rounds to the next number, 53.0000038. With an edge
    of cells at 53.000002 that is one cell or the next.
    """
    scan = replace(
        rays((50.5, 50.0000017), (50.5, 53.0)),
        ranges=np.array([3.0000002], dtype=np.float32),
        angles=np.array([math.pi / 2]),
    )
    assert np.float32(50.0000017) == 50.0
    assert float(np.float32(50.0000017 + float(scan.ranges[0]))) > 53.000002
    costmap = build(2, 8, origin=(50.0, 48.000002), obstacle_range=9.0)
    costmap.update(HERE, (scan,))
    assert costmap.grid.cells[:, 0].tolist() == [255, 0, 0, 0, 254, 255, 255, 255]


# convexFillCells: the lines between corners as above, then in each column all from the lowest to
# the highest of their cells.
def test_the_footprint_frees_its_outline_and_what_lies_in_each_column_between():
    corners = ((2.5, 1.5), (8.5, 1.5), (5.5, 6.5))
    costmap = build(10, 8, under=corners, origin=(-7.0, 30.0))
    costmap.update(Pose2(-7.0, 30.0))
    # (8, 1) to (5, 6) as in the table of lines; back to (2, 1): dx -3, dy -5, error 2, then 5-5, 3,
    # 6-5, 4, 7-5: (5, 6), (4, 5), (4, 4), (3, 3), (3, 2), (2, 1).
    assert drawn(costmap) == [
        "??????????",
        "?????.????",
        "????...???",
        "????...???",
        "???.....??",
        "???.....??",
        "??.......?",
        "??????????",
    ]


def test_a_footprint_with_a_corner_off_the_grid_frees_nothing():
    corners = ((2.5, 1.5), (8.5, 1.5), (5.5, 8.0))
    costmap = build(10, 8, under=corners)
    costmap.update(Pose2())
    assert free(costmap) == set()


def test_the_footprint_is_free_after_returns_under_it_were_marked():
    # updateBounds marks, updateCosts clears the footprint before it merges.
    costmap = build(
        8, 3, obstacle_range=20.0, under=((2.5, 0.5), (4.5, 0.5), (4.5, 1.5), (2.5, 1.5))
    )
    costmap.update(Pose2(), (rays((0.5, 1.5), (3.5, 1.5), (6.5, 1.5)),))
    assert drawn(costmap) == [
        "????????",
        "......#?",
        "??...???",
    ]


def test_bounds_end_where_the_range_does_and_hide_the_last_cell_of_a_line():
    """``updateRaytraceBounds`` cuts a ray off in metres, ``raytraceLine`` in cells.

    A range of 3.2 m clears four cells beyond the first of a straight ray, up to x = 4; the bounds
    end at 0.5 + 3.2 = 3.7. The master shows the cell of the laser and three more, until other
    bounds reach as far.
    """
    costmap = build(8, 1, raytrace_range=3.2)
    costmap.update(Pose2(), (rays((0.5, 0.5), (6.5, 0.5)),))
    assert drawn(costmap) == ["....????"]
