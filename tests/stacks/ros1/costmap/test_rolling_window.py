"""Where a rolling window goes, what it keeps and what new cells are.

What is expected was followed on paper through ``LayeredCostmap::updateMap``, ``getSizeInMetersX``
and ``Costmap2D::updateOrigin`` of the published costmap_2d (Noetic). The window aims at having the
robot in the middle of what the original takes for its size, which is half a cell too little:
(columns - 0.5) cells. It moves by (int)((aim - origin) / resolution) cells.
"""

import pytest

from grammars.model.geometry import Pose2
from tests.stacks.ros1.costmap.pictures import build, drawn, marked, rays
from tests.stacks.ros1.costmap.test_costmap import ROLLING
from tests.stacks.ros1.costmap.test_costmap import build as build_real

MIDDLE = (2.75, 1.75)
"""Of a window of six by four cells of a metre, as seen from its corner: 5.5 and 3.5 halved."""


def at(x, y):
    """Where the robot is for the window to aim at (x, y)."""
    return Pose2(x + MIDDLE[0], y + MIDDLE[1])


def corner(costmap):
    return costmap.grid.x, costmap.grid.y


def rolling(**values):
    return build(6, 4, rolling=True, obstacle_range=20.0, **values)


@pytest.mark.parametrize(
    ("aim", "moved"),
    [
        ((0.99, -0.99), (0, 0)),
        ((1.0, -1.0), (1, -1)),
        ((1.99, -1.99), (1, -1)),
        ((2.7, 0.3), (2, 0)),
        ((-0.3, -2.7), (0, -2)),
        ((7.5, 0.0), (7, 0)),
        ((-300.25, 4000.75), (-300, 4000)),
    ],
)
@pytest.mark.parametrize("origin", [(0.0, 0.0), (-8.0, 4.0)])
def test_the_window_moves_by_whole_cells_cut_off_toward_zero(aim, moved, origin):
    costmap = build(6, 4, rolling=True, origin=origin)
    costmap.update(at(origin[0] + aim[0], origin[1] + aim[1]))
    assert corner(costmap) == (origin[0] + moved[0], origin[1] + moved[1])


def test_what_a_step_fell_short_of_counts_with_the_next_one():
    # aim, (aim - corner): 0.6, 0.6 -> 0; 1.2, 1.2 -> 1; 1.8, 0.8 -> 0; 2.4, 1.4 -> 1. Back again it
    # stays until a whole cell behind: 1.5, -0.5 -> 0; 1.0, -1.0 -> -1; 0.1, -0.9 -> 0.
    costmap = rolling()
    corners = []
    for aim in (0.6, 1.2, 1.8, 2.4, 1.5, 1.0, 0.1):
        costmap.update(at(aim, 0.0))
        corners.append(costmap.grid.x)
    assert corners == [0.0, 1.0, 1.0, 2.0, 2.0, 1.0, 1.0]


def test_a_new_window_of_three_metres_leaves_the_robot_out_of_its_middle():
    # 60 cells are 2.975 m to the original: it aims at -1.4875, 29.75 cells from where a window
    # begins, and moves 29.
    costmap = build_real(ROLLING)
    costmap.update(Pose2())
    assert corner(costmap) == (-29 * 0.05, -29 * 0.05)
    # Half a metre on: (-0.9875 + 1.45) / 0.05 = 9.25, (-1.9875 + 1.45) / 0.05 = -10.75.
    costmap.update(Pose2(0.5, -0.5))
    assert corner(costmap) == (-29 * 0.05 + 9 * 0.05, -29 * 0.05 - 10 * 0.05)


def known():
    """A window at (0, 0) with something in every column and row."""
    costmap = rolling()
    ends = ((0.5, 3.5), (2.5, 1.5), (3.5, 2.5), (4.5, 0.5), (5.5, 3.5))
    costmap.update(at(0.0, 0.0), (rays((0.5, 0.5), *ends),))
    # To (2, 1) and (3, 2): (1, 1) and (1, 1), (2, 1). To (5, 3): dx 5, dy 3, error 2, then 5-5, 3,
    # 6-5, 4, 7-5: (1, 1), (2, 1), (3, 2), (4, 2).
    assert drawn(costmap) == [
        "#????#",
        ".??#.?",
        "..#???",
        "....#?",
    ]
    return costmap


@pytest.mark.parametrize(
    ("aim", "picture"),
    [
        ((0.0, 0.0), ["#????#", ".??#.?", "..#???", "....#?"]),
        ((2.0, 0.0), ["???#??", "?#.???", "#?????", "..#???"]),
        ((0.0, 1.0), ["??????", "#????#", ".??#.?", "..#???"]),
        ((-1.0, -2.0), ["?..#??", "?....#", "??????", "??????"]),
        ((3.0, -1.0), ["#.????", "??????", ".#????", "??????"]),
        ((5.0, 0.0), ["#?????", "??????", "??????", "??????"]),
        ((-5.0, 3.0), ["??????", "??????", "??????", "?????#"]),
        # A whole window away, or farther: nothing is left.
        ((6.0, 0.0), ["??????"] * 4),
        ((0.0, -4.0), ["??????"] * 4),
        ((-60.0, 2.0), ["??????"] * 4),
    ],
)
def test_cells_that_lie_in_both_windows_are_kept(aim, picture):
    costmap = known()
    costmap.update(at(*aim))
    assert drawn(costmap) == picture


def test_what_has_left_the_window_is_forgotten():
    costmap = known()
    costmap.update(at(3.0, 0.0))
    costmap.update(at(0.0, 0.0))
    assert drawn(costmap) == [
        "?????#",
        "???#.?",
        "??????",
        "???.#?",
    ]


def test_a_scan_is_taken_in_after_the_window_has_moved():
    # From (3, 1) of the old window, two columns on: (1, 1); its return at x = 7 lay off that one.
    costmap = known()
    costmap.update(at(2.0, 0.0), (rays((3.5, 1.5), (7.5, 1.5)),))
    assert drawn(costmap) == [
        "???#??",
        "?#.???",
        "#....#",
        "..#???",
    ]
    # Now the laser itself is a column left of the window: no ray clears, the return is marked.
    costmap.update(at(4.0, 0.0), (rays((3.5, 1.5), (5.5, 1.5)),))
    assert drawn(costmap) == [
        "?#????",
        ".?????",
        ".#.#??",
        "#?????",
    ]


@pytest.mark.parametrize(
    ("unknown", "layer_unknown", "new", "redone"),
    [
        # resetMaps gives new cells the value of the master, until bounds reach them; then the
        # layer's own is merged, which unknown leaves as it was and free writes over unknown.
        (True, True, "?", "?"),
        (True, False, "?", "."),
        (False, True, ".", "."),
        (False, False, ".", "."),
    ],
)
def test_new_cells_are_unknown_where_the_costmap_tracks_it_until_they_are_redone(
    unknown, layer_unknown, new, redone
):
    costmap = rolling(unknown=unknown, layer_unknown=layer_unknown)
    costmap.update(at(0.0, 0.0))
    assert drawn(costmap) == [new * 6] * 4
    costmap.update(at(2.0, 1.0))
    assert drawn(costmap) == [new * 6] * 4
    # The bounds of this ray are rows 1 and 2 of columns 1 to 4.
    costmap.update(at(2.0, 1.0), (rays((3.5, 2.5), (6.5, 3.5)),))
    # dx 3, dy 1, error 1, then 2, 3-3, 1: (1, 1), (2, 1), (3, 2), (4, 2).
    assert drawn(costmap) == [
        new * 6,
        new + redone * 2 + ".#" + new,
        new + ".." + redone * 2 + new,
        new * 6,
    ]


def test_a_laser_that_is_kept_for_longer_stays_where_it_was():
    costmap = build(6, 4, rolling=True, obstacle_range=20.0, observation_persistence=1.0)
    scan = rays((0.5, 0.5), (4.5, 0.5))
    costmap.update(at(0.0, 0.0), (scan,))
    assert marked(costmap) == {(4, 0)}
    costmap.update(at(2.0, 0.0), (scan,))
    assert marked(costmap) == {(2, 0)}
    # Out of the window and in again, it is marked anew.
    costmap.update(at(20.0, 0.0), (scan,))
    assert marked(costmap) == set()
    costmap.update(at(1.0, 0.0), (scan,))
    assert marked(costmap) == {(3, 0)}
