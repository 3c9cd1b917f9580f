"""The map in cells: one orientation, filled walls, texts that cover nothing, what decides."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.movers import with_planar_chain
from grammars.model.scene import Link, SceneObject
from scenario_tui.dashboard.widgets.block_cells import (
    fill_areas,
    middle_line,
    ring_edges,
)
from scenario_tui.dashboard.widgets.map_frame import View, draw_view
from scenario_tui.dashboard.widgets.map_names import place_beside, place_inside
from scenario_tui.dashboard.widgets.map_projection import fit, main_axis, map_turn
from scenario_tui.dashboard.widgets.map_style import Layer, MapSigns, legend_lines
from scenario_tui.dashboard.widgets.top_view import TopView
from templates.plan_shapes import MeasuredMark
from tests.people.fake import MISSION, ROBOT, make_scene


def view(**changes):
    return View(make_scene(), ROBOT, MISSION, (0.0,), **changes)


def rows_of(frame):
    codes, _ = frame.cells()
    return ["".join(map(chr, row)) for row in codes]


def turned(scene, angle):
    """Return the scene turned around the origin, without its door."""
    pose = Pose2(0.0, 0.0, angle)
    return replace(
        scene,
        solids=tuple(replace(s, polygon=pose.apply_ring(s.polygon)) for s in scene.solids),
        regions=tuple(replace(r, outline=pose.apply_ring(r.outline)) for r in scene.regions),
        objects=(),
    )


def askew(degrees, **changes):
    pose = Pose2(0.0, 0.0, math.radians(degrees))
    points = [pose.apply((w.x, w.y)) for w in MISSION.waypoints]
    stops = tuple(Waypoint(f"w{i}", x, y) for i, (x, y) in enumerate(points))
    scene = turned(make_scene(), pose.yaw)
    mission = Mission("askew", pose @ MISSION.start, stops)
    return View(scene, ROBOT, mission, (), **changes)


def waypoints(*places):
    return tuple(Waypoint(f"w{i}", x, y) for i, (x, y) in enumerate(places))


def with_waypoints(*places):
    mission = replace(MISSION, waypoints=waypoints(*places))
    return View(make_scene(), ROBOT, mission, (0.0,))


def marked(**changes):
    leaf = ((9.0, 1.0), (9.1, 1.0), (9.1, 2.0), (9.0, 2.0))
    mark = MeasuredMark("door-1.leaf", ((6.3, 1.5), (9.0, 1.5)), "0.03 m, limit 0.05 m", (leaf,))
    return view(robot_pose=Pose2(6.0, 1.5), decisive=replace(mark, **changes))


def visited(x):
    body = Link("body", (((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2)),), 70.0, 0.0, 1.7)
    links, joints = with_planar_chain((body,), (), "body")
    visitor = SceneObject("visitor", "person", Pose2(), links, joints, (0.0, 0.0, 0.0))
    return View(replace(make_scene(), objects=(visitor,)), ROBOT, MISSION, (x, 1.0, 0.0))


WAY = {
    "trail": tuple((1.0 + 0.1 * i, 2.0) for i in range(90)),
    "robot_pose": Pose2(11.5, 3.5),
}
NEAR = {"clearances": (1.0,) * 30 + (0.1,) * 30 + (0.0,) * 30, "limit": 0.2}
SEEN = tuple((2.0 + 0.05 * i, 4.0) for i in range(40))
MIDDLE = Pose2(6.0, 2.0)
PICTURES = {
    "a corridor": (view(), (76, 20)),
    "the same, small": (view(), (40, 10)),
    "a door ajar": (View(make_scene(), ROBOT, MISSION, (-1.5,)), (76, 20)),
    "a building that stands askew": (
        askew(33.0, robot_pose=Pose2(5.0, 5.0, math.radians(33.0))), (100, 20)
    ),
    "two waypoints at one place": (with_waypoints((4, 2), (8, 1), (11, 2), (4, 2)), (76, 20)),
    "two waypoints reached": (view(robot_pose=MIDDLE, reached=2), (76, 20)),
    "a robot where the name of the room was": (view(robot_pose=Pose2(6.0, 1.9)), (76, 20)),
    "a trail": (view(**WAY), (100, 30)),
    "a trail that came near and touched": (view(**WAY, **NEAR), (100, 30)),
    "walls the laser meets": (view(returns=SEEN, robot_pose=MIDDLE), (100, 30)),
    "somebody who walks": (visited(3.0), (76, 20)),
    "the same later": (visited(7.5), (76, 20)),
    "a failure": (marked(), (100, 30)),
    "a failure in little room": (marked(), (60, 14)),
    "a measure that decides for the run": (marked(fails=False), (100, 30)),
    "a measure beside a wall": (marked(line=((6.0, 3.0), (6.0, 3.9))), (100, 30)),
}  # fmt: skip
"""Maps, and the cells they are drawn in."""


def test_maps_look_as_they_did(golden):
    """Below each map stands how many cells each of its layers has, which are their colours."""
    texts = []
    for name, (shown, size) in PICTURES.items():
        frame = draw_view(shown, *size)
        cells = Counter(frame.cells()[1].ravel().tolist())
        layers = "  ".join(f"{layer.name} {cells[layer]}" for layer in Layer if cells[layer])
        lines = "\n".join(row.rstrip() for row in rows_of(frame))
        texts.append(f"--- {name}\n{lines}\n{layers}\n")
    golden("screens/maps.txt", "\n".join(texts))


def test_the_robot_is_an_arrow_that_points_where_it_looks():
    yaws = (0.0, 0.8, math.pi / 2, math.pi, -math.pi / 2)
    for yaw, arrow in zip(yaws, "→↗↑←↓", strict=True):
        shown = view(robot_pose=Pose2(6.0, 2.0, yaw))
        assert arrow in "".join(rows_of(draw_view(shown, 76, 20)))


@pytest.mark.parametrize(
    ("degrees", "size", "turn"),
    [
        (0.0, (10.0, 15.0), 0.0),  # people know their map as it is drawn
        (0.5, (10.0, 5.0), 0.0),
        (0.0, (5.0, 15.0), 90.0),
        (20.0, (10.0, 5.0), -20.0),
        (20.0, (5.0, 10.0), 70.0),
        (-20.0, (5.0, 10.0), -70.0),
    ],
)
def test_walls_become_straight_and_long_buildings_lie(degrees, size, turn):
    corners = np.array([(x, y) for x in (0.0, size[0]) for y in (0.0, size[1])])
    axis = math.radians(degrees)
    c, s = math.cos(axis), math.sin(axis)
    found = map_turn(axis, corners @ np.array([[c, s], [-s, c]]))
    assert math.degrees(found) == pytest.approx(turn)


def test_a_map_has_one_orientation_in_every_pane():
    sizes = [(40, 10), (20, 60), (100, 20), (100, 60), (200, 50)]
    for shown in (askew(0.0), askew(33.0), askew(90.0)):
        turns = {draw_view(shown, *size).still.projection.turn for size in sizes}
        assert len(turns) == 1


@given(st.floats(-math.pi, math.pi), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_a_way_on_the_screen_is_as_long_on_the_map(axis, right, up):
    corners = np.array([(0.0, 0.0), (30.0, 0.0), (30.0, 4.0), (0.0, 4.0)])
    turn = np.array([[math.cos(axis), math.sin(axis)], [-math.sin(axis), math.cos(axis)]])
    projection = fit(corners @ turn, -axis, 200, 80)
    (a, b) = projection.dots(
        np.array([(1.0, 2.0), np.add((1.0, 2.0), projection.metres(right, up))])
    )
    assert b - a == pytest.approx((right, -up), abs=1e-6)


def test_the_axis_is_that_of_most_walls_not_the_mean():
    square = ring_edges([np.array([(0.0, 0.0), (9.0, 0.0), (9.0, 5.0), (0.0, 5.0)])])
    wing = np.array([[9.0, 0.0, 12.0, 2.0]])
    assert main_axis(np.vstack([square, wing])) == pytest.approx(0.0)
    assert main_axis(np.empty((0, 4))) == 0.0


coordinate = st.integers(-4, 24)


@given(coordinate, coordinate, st.integers(1, 20), st.integers(1, 20))
def test_an_area_holds_the_squares_whose_middle_lies_in_it(x, y, wide, high):
    ring = np.array([(x, y), (x + wide, y), (x + wide, y + high), (x, y + high)], dtype=float)
    mask = fill_areas(ring_edges([ring]), 20, 16)
    rows, columns = np.indices(mask.shape)
    inside = (columns >= x) & (columns < x + wide) & (rows >= y) & (rows < y + high)
    assert (mask == inside).all()


def test_areas_that_overlap_are_one_and_holes_are_left_out():
    outer, inner = (
        np.array([(a, a), (b, a), (b, b), (a, b)], dtype=float) for a, b in ((0, 10), (3, 7))
    )
    assert fill_areas(ring_edges([outer, inner[::-1]]), 10, 10).sum() == 100
    free = np.ones((10, 10), dtype=bool)
    name = place_inside("a", Layer.SPACE_NAME, [outer, inner], free)
    assert name is not None
    assert not (3 <= name.row < 7 and 3 <= name.column < 7)


def test_a_name_too_long_for_its_room_is_left_out():
    room = [np.array([(0.0, 0.0), (14.0, 0.0), (14.0, 6.0), (0.0, 6.0)])]
    free = np.ones((6, 14), dtype=bool)
    name = place_inside("living_room_", Layer.SPACE_NAME, room, free)
    assert name is not None
    assert (name.row, name.column) in ((2, 1), (3, 1))
    assert place_inside("x" * 13, Layer.SPACE_NAME, room, free) is None


near = st.tuples(st.floats(3.0, 5.0), st.floats(0.3, 3.7))


@given(st.lists(near, min_size=1, max_size=9), st.integers(24, 120), st.integers(8, 40))
def test_numbers_cover_neither_signs_nor_each_other(places, columns, rows):
    # The robot, which hides numbers, is elsewhere.
    shown = replace(with_waypoints(*places), robot_pose=Pose2(11.0, 2.0))
    frame = draw_view(shown, columns, rows)
    lines = rows_of(frame)
    covered = set()
    for number in frame.still.numbers.values():
        row, cells = number.cells
        assert lines[row][cells] == number.text
        mine = {(row, column) for column in range(cells.start - 1, cells.stop + 1)}
        assert not covered & mine
        covered |= {(row, column) for column in range(cells.start, cells.stop)}
    signs = set(frame.still.numbers)
    assert not covered & signs
    assert all(lines[row][column] in "◆→" for row, column in signs)


@given(st.integers(20, 200), st.integers(1, 6))
def test_a_legend_is_never_cut(width, most):
    everything = MapSigns(frozenset(Layer), 0.2)
    whole = {
        part for line in legend_lines([everything], 2000, 1) for part in line.plain.split("   ")
    }
    lines = legend_lines([everything], width, 8 * most)
    assert len(lines) <= most
    assert all(line.cell_len <= max(width, 24) for line in lines)
    assert {part for line in lines for part in line.plain.split("   ")} <= whole


def test_zooming_and_panning_keep_what_they_show_where_it_is():
    for degrees in (0.0, 33.0):
        shown = askew(degrees)
        frame = draw_view(shown, 100, 30, zoom=4, middle=(3.0, 2.0))
        ((x, y),) = frame.still.projection.dots(np.array([(3.0, 2.0)]))
        assert (x, y) == pytest.approx(frame.still.projection.centre)


def test_middle_lines_end_where_a_wall_is_cut_aslant():
    mitred = np.array([(0.0, 0.0), (10.0, 0.0), (9.0, 1.0), (1.0, 1.0)])
    assert middle_line(mitred) == pytest.approx([0.5, 0.5, 9.5, 0.5])


def test_a_text_stands_beside_its_thing_where_there_is_room():
    free = np.ones((5, 20), dtype=bool)
    box = (8, 2, 9, 2)
    places = []
    while (text := place_beside("door", Layer.DOOR_NAME, box, free)) is not None:
        places.append((text.row, text.column))
    assert places[:3] == [(2, 11), (2, 3), (1, 7)]
    assert {row for row, _ in places} == set(range(5))


def test_a_robot_that_is_nowhere_is_not_come_nearer_to():
    top = TopView()
    top.show(view(robot_pose=Pose2(math.nan, 2.0, 0.0)))
    whole, _ = top.cells(80, 24)
    top.zoom()
    assert (top.cells(80, 24)[0] == whole).all()
    top.show(view(robot_pose=Pose2(6.0, 2.0, 0.0)))
    assert (top.cells(80, 24)[0] != whole).any()
