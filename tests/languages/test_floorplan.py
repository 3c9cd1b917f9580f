"""What a plan means: geometry of small plans worked out by hand."""

import math

import pytest

from grammars.floorplan import frames, load_floorplan, parse_floorplan
from grammars.model.geometry import Pose2

HEAD = """Floor plan: demo
Defaults:
    walls:
        thickness: 0.2 m
        height: 2.4 m
"""
CELL = """Space cell:
    shape: Rectangle width=2.0 m, length=2.0 m
    location:
        wrt: world
        of: this
        translation: x: 3.0 m, y: 1.0 m
"""


def room(location, shape="Rectangle width=2 m, length=1 m", rest=""):
    return f"Space room: shape: {shape} location: {location} {rest}\n"


def plan(*elements):
    return parse_floorplan(HEAD + CELL + "\n".join(elements), "demo.fpm")


def messages(found):
    return [warning.message for warning in found.warnings]


def close(values):
    return pytest.approx(values, abs=1e-9)


def test_a_rectangle_is_clockwise_from_its_left_top_corner():
    (cell,) = plan().spaces
    assert list(cell.outline) == [close(p) for p in [(2, 2), (4, 2), (4, 0), (2, 0)]]
    assert cell.where.line == 6


def test_wall_frames_sit_on_the_inner_edges_and_look_outwards():
    (cell,) = plan().spaces
    poses = [(w.frame.x, w.frame.y, abs(w.frame.yaw)) for w in cell.walls]
    half = math.pi / 2
    assert poses == [close(p) for p in [(3, 2, 0), (4, 1, half), (3, 0, math.pi), (2, 1, half)]]
    assert cell.walls[1].frame.yaw == close(-half)
    assert [w.id for w in cell.walls] == [f"cell-wall-{i}" for i in range(4)]


def test_walls_grow_outwards_to_mitred_corners():
    (cell,) = plan().spaces
    assert list(cell.walls[0].footprint) == [
        close(p) for p in [(1.8, 2.2), (4.2, 2.2), (4, 2), (2, 2)]
    ]
    assert list(cell.walls[1].footprint) == [
        close(p) for p in [(4.2, 2.2), (4.2, -0.2), (4, 0), (4, 2)]
    ]
    assert (cell.walls[0].thickness, cell.walls[0].height, cell.walls[0].length) == (0.2, 2.4, 2.0)


def test_a_door_is_cut_from_the_inner_face_outwards():
    found = plan(
        "Entryway door: shape: Rectangle width=0.9 m, height=2.0 m "
        "location: in: cell.walls[0] translation: x: 0.3 m, z: 1.0 m"
    )
    (door,) = found.openings
    corners = [(2.85, 2, 2), (3.75, 2, 2), (3.75, 2, 0), (2.85, 2, 0)]
    assert list(door.near) == [close(p) for p in corners]
    assert list(door.far) == [close((x, 2.2, z)) for x, _, z in corners]
    assert (door.kind, door.walls, door.depth) == ("entryway", ("cell-wall-0",), 0.2)
    assert (door.width, door.z_min, door.z_max) == (close(0.9), close(0.0), close(2.0))
    assert door.centre == close((3.3, 2.1))
    assert not found.warnings


def test_a_tilted_window_turns_clockwise_seen_from_inside():
    found = plan(
        "Window w: shape: Rectangle width=1.0 m, height=0.5 m "
        "location: in: cell.walls[0] translation: z: 1.5 m rotation: y: 90 deg"
    )
    (window,) = found.openings
    assert window.near[1] == close((3.25, 2.0, 1.0))
    assert (window.width, window.z_min, window.z_max) == (close(0.5), close(1.0), close(2.0))


def test_a_polygonal_opening_has_points_in_its_wall():
    text = "Window w: shape: Polygon points: [{}] location: in: cell.walls[0] translation: z: 1 m"
    solid = plan(text.format("(-0.5 m, 0 m, 0 m), (0.5 m, 0 m, 0 m), (0 m, 0 m, 0.8 m)"))
    flat = plan(text.format("(-0.5 m, 0 m), (0.5 m, 0 m), (0 m, 0.8 m)"))
    assert solid.openings == flat.openings
    assert solid.openings[0].z_max == close(1.8)
    assert "second number is taken as z" in messages(flat)[0]


def test_rooms_can_be_placed_against_rooms_defined_later():
    found = parse_floorplan(HEAD + room("wrt: cell of: this.walls[1] translation: y: 5 m") + CELL)
    assert (found.spaces[0].frame.x, found.spaces[0].frame.y) == close((3.0, 5.0))


def test_features_stand_against_their_space_its_walls_or_other_spaces():
    column = "Column {}: shape: Rectangle width=0.4 m, length=0.2 m height: 1 m location: {}"
    found = plan(
        "features: ",
        column.format("a", "translation: x: 0.5 m wrt: this rotation: z: 90 deg "),
        column.format("b", "wrt: this.walls[1] translation: y: -0.1 m "),
        room("wrt: cell of: this translation: x: 9 m"),
        column.format("c", "wrt: room.walls[0] "),
    )
    a, b, c = found.features
    assert (a.frame.x, a.frame.y, a.frame.yaw) == close((3.5, 1.0, math.pi / 2))
    assert (b.frame.x, b.frame.y) == close((3.9, 1.0))
    assert (c.frame.x, c.frame.y, c.space) == (close(12.0), close(1.5), "")
    assert a.footprint[0] == close((3.4, 0.8))


def test_a_circle_is_a_clockwise_polygon_of_40_corners():
    found = plan(room("wrt: world of: this", "Circle radius=1.5 m"))
    outline = found.spaces[1].outline
    assert len(found.spaces[1].walls) == 40
    assert outline[0] == close((0.0, 1.5))
    assert outline[10] == close((1.5, 0.0))


def test_walls_may_be_split_in_line():
    shape = "Polygon points: [(0 m, 0 m), (0 m, 1 m), (0 m, 2 m), (2 m, 2 m), (2 m, 0 m)]"
    walls = plan(room("wrt: world of: this translation: x: 9 m", shape)).spaces[1].walls
    assert walls[0].footprint[1] == close((8.8, 1.0))


def test_values_come_from_variables_units_and_signs():
    text = HEAD.replace("0.2 m", "-t") + (
        "var t = -0.3 m var a = 0.5 rad var m = 4 m "
        "Space s: shape: Rectangle width=m, length=2 location: "
        "wrt: world of: this translation: x: - m, y: 1e0 m rotation: z: -a"
    )
    (space,) = parse_floorplan(text).spaces
    assert space.walls[0].thickness == 0.3
    assert (space.frame.x, space.frame.y, space.frame.yaw) == close((-4.0, 1.0, -0.5))
    assert space.walls[0].length == close(4.0)


def test_layout_comments_and_keywords_as_names_mean_nothing():
    text = (
        "Floor plan:features// x\nSpace Space:shape:Rectangle width=1,length=1 "
        "location:spaced//\r\nof:this wrt:worldly.walls[ 0 ]\twalls:height:2 m thickness:1 m "
        "Space worldly : shape : Rectangle width = 1 , length = 1 location : wrt : world of : this "
        "walls : thickness : 1 height : 2 Entryway this: shape: Rectangle width=1, height=1 "
        "location: rotation: translation: z: 0.5 in : Space . walls [0] and worldly.walls[1]"
    )
    found = parse_floorplan(text)
    assert [s.name for s in found.spaces] == ["Space", "worldly"]
    assert found.openings[0].walls == ("Space-wall-0", "worldly-wall-1")


def test_names_are_resolved_by_kind():
    found = parse_floorplan(
        "Floor plan: cell\nDefaults: walls: thickness: cell height: 2 m\nvar cell = 0.1 m\n"
        + CELL
        + "Entryway cell: shape: Rectangle width=1 m, height=2 m location: in: cell.walls[0]"
    )
    assert found.openings[0].walls == ("cell-wall-0",)


def test_equal_feature_names_in_two_spaces_get_scoped_ids():
    column = "features: Column c: shape: Circle radius=0.1 m height: 1 m location: wrt: this "
    found = plan(column, room("wrt: cell of: this translation: x: 5 m", rest=column))
    assert [f.id for f in found.features] == ["cell-c", "room-c"]
    assert [f.name for f in found.features] == ["c", "c"]
    assert frames(found)["column-room-c-frame"] == Pose2(8.0, 1.0, 0.0)
    assert sum("several spaces" in m for m in messages(found)) == 2


def test_every_element_publishes_its_frame():
    found = plan(
        "features: Divider d: shape: Circle radius=0.1 m height: 1 m location: wrt: this ",
        "Window w: shape: Circle radius=0.1 m location: in: cell.walls[1] translation: z: 1 m",
        "Entryway e: shape: Rectangle width=1 m, height=2 m location: in: cell.walls[0] "
        "translation: z: 1 m",
    )
    assert list(frames(found)) == [
        "world-frame",
        "cell-frame",
        *(f"cell-wall-{i}-frame" for i in range(4)),
        "divider-d-frame",
        "window-w-frame",
        "entryway-e-frame",
    ]
    assert frames(found)["cell-wall-1-frame"] == found.walls[1].frame
    with pytest.raises(KeyError):
        frames(found)["cell-wall-4-frame"]


def test_a_plan_is_loaded_from_its_file(tmp_path):
    path = tmp_path / "café.fpm"
    path.write_bytes(b"\xef\xbb\xbf" + (HEAD + CELL).replace("\n", "\r\n").encode())
    assert load_floorplan(path) == plan()
    assert load_floorplan(str(path)).spaces[0].where.file == str(path)


DOOR = "Entryway e: shape: Rectangle width=1 m, height=2 m location: in: {}"


def test_touching_rooms_and_fitting_doors_raise_no_warning():
    found = plan(
        room("wrt: cell.walls[0] of: this.walls[2] spaced"),
        DOOR.format("cell.walls[0] and room.walls[2] translation: x: -0.4 m, z: 1 m"),
    )
    assert found.warnings == ()
    assert found.openings[0].depth == close(0.4)


def test_a_long_chain_of_rooms_is_placed_without_recursion():
    count = 1100
    shape = "shape: Circle radius=1 m location: of: this"
    rooms = "".join(f"Space s{k}: {shape} translation: x: 5 wrt: s{k + 1}\n" for k in range(count))
    found = parse_floorplan(f"{HEAD}{rooms}Space s{count}: {shape} wrt: world")
    assert found.spaces[0].frame.x == 5.0 * count
