"""The top view: dots where geometry says, in the right layer, with the right glyphs."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.geometry import Pose2
from grammars.model.kinematics import object_rings
from scenario_tui.dashboard.live_tracks import Tracks
from scenario_tui.dashboard.widgets.cell_view import Canvas
from scenario_tui.dashboard.widgets.map_frame import View, draw_view
from scenario_tui.dashboard.widgets.top_view import TopView
from tests.people.fake import MISSION, ROBOT, make_live, make_scene

# Dot positions of a braille cell by Unicode's own numbering: bit k is dot k+1.
_DOT_OF_BIT = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3)]


def dots_of(canvas):
    """Read the dots back out of the characters."""
    codes, _ = canvas.cells()
    found = set()
    for (row, column), code in np.ndenumerate(codes):
        if code > 0x2800:
            for bit, (x, y) in enumerate(_DOT_OF_BIT):
                if (code - 0x2800) >> bit & 1:
                    found.add((2 * column + x, 4 * row + y))
    return found


def view(**changes):
    return View(make_scene(), ROBOT, MISSION, (0.0,), **changes)


def text(frame):
    codes, _ = frame.cells()
    return "\n".join("".join(map(chr, row)) for row in codes)


coordinate = st.integers(-5, 45)


@given(st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=30))
def test_dots_are_where_they_were_set(points):
    canvas = Canvas(10, 6, 1)
    canvas.points(np.array(points, dtype=float), 0)
    assert dots_of(canvas) == {(x, y) for x, y in points if 0 <= x < 20 and 0 <= y < 24}


@given(*[st.integers(0, 19)] * 4)
def test_a_line_has_no_gaps_and_keeps_to_its_way(x0, y0, x1, y1):
    canvas = Canvas(10, 5, 1)
    canvas.lines(np.array([[x0, y0, x1, y1]], dtype=float), 0)
    dots = dots_of(canvas)
    assert {(x0, y0), (x1, y1)} <= dots
    assert len(dots) == max(abs(x1 - x0), abs(y1 - y0)) + 1
    length = math.dist((x0, y0), (x1, y1))
    for x, y in dots:
        off = abs((x1 - x0) * (y0 - y) - (x0 - x) * (y1 - y0))
        assert off <= 0.75 * max(length, 1.0)


def test_a_cell_belongs_to_its_highest_layer():
    canvas = Canvas(2, 1, 3)
    canvas.points(np.array([[0.0, 0.0]]), 0)
    canvas.points(np.array([[1.0, 3.0]]), 2)
    codes, owners = canvas.cells()
    assert owners.tolist() == [[2, -1]]
    assert "".join(map(chr, codes[0])) == "⢁ "


def test_lintels_are_above_the_eye_and_leave_the_doorway_open():
    frame = draw_view(view(), 76, 20)
    walls = frame.still.walls > 0
    ((x, y),) = frame.still.projection.dots(np.array([[5.5, 4.1]]))
    top = int(y // 4)
    wall = walls[top - 1 : top + 2].any(axis=0)
    assert not wall[int(x // 2)]
    assert wall[int(x // 2) - 10]
    assert wall[int(x // 2) + 10]


def test_a_door_is_drawn_at_its_angle():
    (name,) = make_scene().joint_names
    shut = object_rings(make_scene(), 0.3, {name: 0.0})[0]
    ajar = object_rings(make_scene(), 0.3, {name: -math.pi / 2})[0]
    assert max(y for _, y in shut) == pytest.approx(4.02)
    assert min(y for _, y in ajar) == pytest.approx(4.0 - 0.95)
    assert text(draw_view(view(), 76, 20)) != text(
        draw_view(View(make_scene(), ROBOT, MISSION, (-1.5,)), 76, 20)
    )


@pytest.mark.parametrize(
    ("yaw", "arrow"),
    [(0.0, "→"), (math.pi / 2, "↑"), (math.pi, "←"), (-math.pi / 2, "↓"), (0.8, "↗")],
)
def test_the_robot_is_an_arrow_that_points_where_it_looks(yaw, arrow):
    assert arrow in text(draw_view(view(robot_pose=Pose2(6.0, 2.0, yaw)), 76, 20))


def test_reached_waypoints_look_different():
    shown = text(draw_view(view(reached=2), 76, 20))
    assert (shown.count("◇"), shown.count("◆")) == (2, 1)


def test_zoom_keeps_the_robot_in_the_middle():
    shown = view(robot_pose=Pose2(9.0, 1.0, 0.0))
    rows = text(draw_view(shown, 76, 20, zoom=4, middle=(9.0, 1.0))).splitlines()
    assert rows[9][37] == "→" or rows[10][38] == "→" or rows[9][38] == "→" or rows[10][37] == "→"


def test_a_trail_grows_with_the_way_and_starts_anew_with_a_new_attempt():
    tracks = Tracks()
    for time in (0.0, 0.1, 20.0, 40.0):
        tracks.add(make_live(7, time))
    track = tracks.get(make_live(7).run)
    assert track is not None
    assert len(track.trail) == 3  # 5 mm are no step
    tracks.add(make_live(7, 0.0))
    again = tracks.get(make_live(7).run)
    assert again is not None
    assert len(again.trail) == 1


def test_the_runs_longest_unheard_of_are_forgotten():
    tracks = Tracks()
    for index in range(100):
        tracks.add(make_live(index))
    assert tracks.get(make_live(0).run) is None
    assert tracks.get(make_live(99).run) is not None


def test_a_robot_that_is_nowhere_is_not_come_nearer_to():
    top = TopView()
    top.show(view(robot_pose=Pose2(math.nan, 2.0, 0.0)))
    whole, _ = top.cells(80, 24)
    top.zoom()
    assert (top.cells(80, 24)[0] == whole).all()
    top.show(view(robot_pose=Pose2(6.0, 2.0, 0.0)))
    assert (top.cells(80, 24)[0] != whole).any()
