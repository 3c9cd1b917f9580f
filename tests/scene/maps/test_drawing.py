"""Buildings from DXF drawings, which ezdxf writes here as architects' programs do."""

import math
import os
from importlib.util import find_spec
from itertools import pairwise

import numpy as np
import pytest
import shapely

from grammars.maps import load_walls, walls_text
from grammars.maps.map_import import ImportSettings, vectorise
from grammars.text.diagnostics import Findings, InputError

pytestmark = pytest.mark.skipif(find_spec("ezdxf") is None, reason="needs the extra import")

OUTER = [
    *[(0, 0, 1, 0), (2, 0, 10, 0), (10, 0, 10, 6), (10, 6, 0, 6), (0, 6, 0, 0)],
    *[(0.3, 0.3, 1, 0.3), (2, 0.3, 9.7, 0.3), (9.7, 0.3, 9.7, 5.7)],
    *[(9.7, 5.7, 6.15, 5.7), (6, 5.7, 0.3, 5.7), (0.3, 5.7, 0.3, 0.3)],
]
"""Two lines 30 cm apart, open between x 1 m and 2 m, without lines at the jambs."""
INNER = [
    *[(6, 5.7, 6, 2.9), (6, 2.9, 6.15, 2.9), (6.15, 2.9, 6.15, 5.7)],
    *[(6, 0.3, 6, 2.0), (6, 2.0, 6.15, 2.0), (6.15, 2.0, 6.15, 0.3)],
]
"""A wall 15 cm thick between x 6 m and 6.15 m, with a gap of 90 cm."""
SINGLE = [(6.15, 3.5, 9.7, 3.5)]
"""A wall drawn as one line."""


def new_drawing(units=6):
    # Imported here, for every process of a round reads this file.
    import ezdxf

    return ezdxf.new("R2010", units=units)


def draw(path, *, unit=4, scale=1000.0, at=0.0):
    """Return a drawing of a house with three rooms, a doorway and a column; saved by ``path``."""
    drawing = new_drawing(unit)
    space = drawing.modelspace()
    wall = {"layer": "A-WALL"}
    for x0, y0, x1, y1 in (*OUTER, *INNER, *SINGLE):
        ends = [((x + at) * scale, (y + at) * scale) for x, y in ((x0, y0), (x1, y1))]
        space.add_line(*ends, dxfattribs=wall)
    corners = [(3.0, 3.0), (3.4, 3.0), (3.4, 3.4), (3.0, 3.4)]
    column = [((x + at) * scale, (y + at) * scale) for x, y in corners]
    space.add_lwpolyline(column, close=True, dxfattribs=wall)
    space.add_arc((6 * scale, 2 * scale), 0.9 * scale, 90, 180, dxfattribs={"layer": "A-DOOR"})
    space.add_text("Kitchen", dxfattribs={"layer": "A-ANNO"})
    drawing.saveas(path)
    return drawing


def drawn(path, layers=None, standing=(), unit="", thickness=0.1):
    """Return the map of a drawing, and the warnings about it as one text."""
    from grammars.maps.drawing import WALL_LAYERS, draw_map

    findings = Findings()
    grid = draw_map(path, layers or WALL_LAYERS, standing, unit, thickness, findings)
    return grid, "\n".join(map(str, findings.warnings))


def imported(path, **settings):
    """Return the building that the importer of maps finds in a drawing."""
    return vectorise(drawn(path, **settings)[0], ImportSettings("house")).building


def bounds(ring):
    """Return the extent of a ring, exact to two cells of 2 cm."""
    xs, ys = zip(*ring, strict=True)
    return pytest.approx((min(xs), min(ys), max(xs), max(ys)), abs=0.04)


def save(drawing, path):
    drawing.saveas(path)
    return path


def rooms(building):
    return [bounds(space.outline) for space in building.spaces.values()]


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    path = tmp_path_factory.mktemp("house") / "My house.dxf"
    draw(path)
    return path


def test_walls_rooms_and_doorways_are_found(house, tmp_path):
    building = imported(house)
    (door,) = building.entryways.values()
    assert (*door.start, *door.end, door.depth) == pytest.approx(
        (6.08, 2, 6.08, 2.9, 0.15), abs=0.03
    )
    path = tmp_path / "house.walls.yaml"
    path.write_text(walls_text(building), encoding="utf-8")
    plan = load_walls(path)
    assert plan.warnings == ()
    assert drawn(house)[1].endswith("lines on other layers were ignored: A-DOOR (1)")
    # The outer doorway ends the first room: half the wall belongs to it there.
    assert rooms(building) == [(0.3, 0, 6, 5.7), (6.15, 3.55, 9.7, 5.7), (6.15, 0.3, 9.7, 3.45)]
    assert [len(space.holes) for space in plan.spaces] == [1, 0, 0]
    assert [bounds(f.footprint) for f in plan.features] == [(0, 0, 10, 6), (3, 3, 3.4, 3.4)]


@pytest.mark.parametrize(
    ("unit", "scale", "given"), [(6, 1.0, ""), (1, 1 / 0.0254, ""), (0, 100.0, "cm"), (4, 1.0, "m")]
)
def test_units_are_those_of_the_file_or_given(unit, scale, given, tmp_path):
    draw(tmp_path / "house.dxf", unit=unit, scale=scale)
    read = imported(tmp_path / "house.dxf", unit=given)
    assert rooms(read) == [(0.3, 0, 6, 5.7), (6.15, 3.55, 9.7, 5.7), (6.15, 0.3, 9.7, 3.45)]


def test_coordinates_of_a_country_are_moved(tmp_path):
    draw(tmp_path / "house.dxf", unit=6, scale=1.0, at=5_600_000.0)
    assert "was moved by (-5600000 m, -5600000 m)" in drawn(tmp_path / "house.dxf")[1]
    (dx, dy), *_ = imported(tmp_path / "house.dxf").spaces["room_1"].outline
    assert 0.0 <= min(dx, dy) <= max(dx, dy) <= 7.0


def lines_of(path, *lines, **settings):
    """Save a drawing in metres of these lines on a layer of walls."""
    drawing = new_drawing()
    for x0, y0, x1, y1 in lines:
        drawing.modelspace().add_line((x0, y0), (x1, y1), dxfattribs={"layer": "wall"})
    drawing.saveas(path)
    return path


HALL = [(0, 0, 12, 0), (0, 0, 0, 8), (0, 8, 12, 8), (12, 0, 12, 2), (12, 5.5, 12, 8)]
"""A hall of single lines whose outer wall has a gate 3.5 m wide."""


def test_a_hall_with_a_gate_in_its_outer_wall_is_a_room_up_to_the_gate(tmp_path):
    hall = imported(lines_of(tmp_path / "hall.dxf", *HALL))
    assert rooms(hall) == [(0.05, 0.05, 12, 7.95)]


def test_small_gaps_are_closed_and_lines_without_a_length_left_out(tmp_path):
    walls = [(0, 0, 6, 0), (6, 0.4, 6, 4), (6, 4, 0, 4), (0, 4, 0, 0), (3, 2, 3, 2)]
    building = imported(lines_of(tmp_path / "shed.dxf", *walls))
    assert rooms(building) == [(0.05, 0.05, 5.95, 3.95)]
    assert [len(wall.holes) for wall in building.standing] == [1]


L_SHAPE = [(0, 0), (12, 0), (12, 3), (3, 3), (3, 9), (0, 9), (0, 0)]
U_SHAPE = [(0, 0), (12, 0), (12, 9), (9, 9), (9, 3), (3, 3), (3, 9), (0, 9), (0, 0)]


@pytest.mark.parametrize("corners", [L_SHAPE, U_SHAPE], ids=["corner", "yard"])
def test_floor_outside_that_is_open_is_no_room(corners, tmp_path):
    walls = [(*a, *b) for a, b in pairwise(corners)]
    (room,) = imported(lines_of(tmp_path / "house.dxf", *walls)).spaces.values()
    # Corners of thickened lines are round, which may take a corner more.
    assert shapely.Polygon(room.outline).area == pytest.approx(
        shapely.Polygon(corners).area - 2.1, abs=0.7
    )
    assert bounds(room.outline) == (0.05, 0.05, 11.95, 8.95)


def spoil(change):
    def made(path):
        drawing = draw(path)
        change(drawing)
        drawing.saveas(path)

    return made


@pytest.mark.parametrize(
    ("make", "settings", "message"),
    [
        (lambda p: p.write_bytes(b"AC1032\0\0\0"), {}, "no DXF drawing\n    .* convert a DWG"),
        (lambda p: p.write_bytes(b""), {}, "is no DXF drawing"),
        (lambda p: p.write_text("walls: hut\nspaces: {}\n"), {}, "is no DXF drawing"),
        (lambda p: None, {}, "no such file"),
        (lambda p: os.mkfifo(p), {}, "is no ordinary file"),
        (lambda p: draw(p, unit=0), {}, "no known unit\n    give its unit with --unit: mm, cm"),
        (lambda p: draw(p, unit=3), {}, "names no known unit"),
        (draw, {"unit": "km"}, '"km" is no unit'),
        (draw, {"unit": "m"}, "measure 1e\\+04 m by 6e\\+03 m, which is no building"),
        (draw, {"layers": ("A-FLOR*",)}, r"choose one with --layer: A-WALL \(19\)"),
        (lambda p: lines_of(p, (0, 0, 9, 0), (0, 4, 9, 4)), {}, "the walls enclose no room"),
        (spoil(lambda d: d.modelspace().delete_all_entities()), {}, "it holds no lines"),
    ],
)  # fmt: skip
def test_what_is_no_building_is_refused_with_a_remedy(make, settings, message, tmp_path):
    make(tmp_path / "house.dxf")
    with pytest.raises(InputError, match=message):
        drawn(tmp_path / "house.dxf", **settings)


def test_walls_may_be_arcs_or_wide_lines_and_texts_are_none(tmp_path):
    drawing = new_drawing()
    # A tower: bulges of 1 are half circles; inside, a polyline of the old kind.
    space = drawing.modelspace()
    walls = {"layer": "Mur exterieur"}
    space.add_lwpolyline([(-4, 0, 1), (4, 0, 1)], format="xyb", close=True, dxfattribs=walls)
    inner = space.add_polyline2d([(-3.7, 0), (3.7, 0)], close=True, dxfattribs=walls)
    for vertex in inner.vertices:
        vertex.dxf.bulge = 1.0
    (room,) = imported(save(drawing, tmp_path / "tower.dxf")).spaces.values()
    assert all(math.hypot(x, y) == pytest.approx(3.7, abs=0.05) for x, y in room.outline)
    drawing = new_drawing()
    corners, wide = [(0, 0), (6, 0), (6, 4), (0, 4)], {"layer": "walls", "const_width": 0.4}
    drawing.modelspace().add_lwpolyline(corners, close=True, dxfattribs=wide)
    drawing.modelspace().add_text("walls", height=2.0, dxfattribs={"layer": "walls"})
    assert rooms(imported(save(drawing, tmp_path / "hall.dxf"))) == [(0.2, 0.2, 5.8, 3.8)]


def test_blocks_are_looked_into_and_windows_are_chosen_by_their_layer(tmp_path):
    drawing = new_drawing()
    storey = drawing.blocks.new("STOREY")
    # On layer 0: on that of the block's insertion then.
    storey.add_lwpolyline([(1, 0), (0, 0), (0, 4), (5, 4), (5, 0), (3, 0)])
    storey.add_line((1, 0), (3, 0), dxfattribs={"layer": "WINDOWS"})
    drawing.modelspace().add_blockref("STOREY", (10, 10), dxfattribs={"layer": "walls"})
    drawing.saveas(tmp_path / "storey.dxf")
    closed = imported(tmp_path / "storey.dxf", layers=("*wall*", "*window*"))
    assert rooms(closed) == [(10.05, 10.05, 14.95, 13.95)]
    assert (
        len(imported(tmp_path / "storey.dxf").standing[0].holes)
        == 0
        < len(closed.standing[0].holes)
    )


ACROSS = (0, 2, 6, 2.2)
INSIDE = (0.05, 0.05, 5.95, 3.95)


def hall_of(*rectangles, **attributes):
    """Return a drawing in metres of a hall 6 m by 4 m, and of rectangles on other layers."""
    drawing = new_drawing()
    for layer, (x0, y0, x1, y1) in (("walls", (0, 0, 6, 4)), *rectangles):
        corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        own = attributes if layer != "walls" else {}
        drawing.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": layer} | own)
    return drawing


def switched(layer, state):
    """Return a drawing with a wall across the hall on a layer of that state."""
    drawing = hall_of((layer, ACROSS))
    getattr(drawing.layers.add(layer), state)()
    return drawing


def inserted_on_frozen_layer():
    drawing = switched("old walls", "freeze")
    drawing.modelspace().query("LWPOLYLINE[layer=='old walls']").first.dxf.layer = "walls"
    block = drawing.blocks.new("OLD")
    drawing.modelspace().move_to_layout(drawing.modelspace()[-1], block)
    drawing.modelspace().add_blockref("OLD", (0, 0), dxfattribs={"layer": "old walls"})
    return drawing


@pytest.mark.parametrize(
    ("make", "hidden"),
    [
        (lambda: switched("old walls", "off"), "old walls (1)"),
        (lambda: switched("old walls", "freeze"), "old walls (1)"),
        (lambda: hall_of(("walls 2", ACROSS), invisible=1), "walls 2 (1)"),
        (inserted_on_frozen_layer, "old walls (1)"),
    ],
    ids=["off", "frozen", "invisible", "block on a frozen layer"],
)
def test_what_the_drawing_hides_is_no_wall(make, hidden, tmp_path):
    path = save(make(), tmp_path / "hall.dxf")
    grid, warnings = drawn(path)
    assert f"what the drawing hides was left out: {hidden}" in warnings
    assert rooms(vectorise(grid).building) == [INSIDE]


def test_blocks_that_lie_in_other_files_are_named(tmp_path):
    drawing = hall_of()
    drawing.add_xref_def("neighbour.dxf", "NEIGHBOUR")
    for name in ("NEIGHBOUR", "GONE"):
        drawing.modelspace().add_blockref(name, (0, 0), dxfattribs={"layer": "walls"})
    warnings = drawn(save(drawing, tmp_path / "hall.dxf"))[1]
    assert "blocks that the file does not hold were left out: NEIGHBOUR (1), GONE (1)" in warnings


@pytest.mark.parametrize("form", ["asc", "bin"])
def test_drawings_of_either_form_are_read_whole_or_refused(form, tmp_path):
    path = tmp_path / "hall.dxf"
    hall_of().saveas(path, fmt=form)
    assert rooms(imported(path)) == [INSIDE]
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError, match="is cut off"):
        drawn(path)


def test_racks_and_columns_of_their_layer_stand_in_the_room(tmp_path):
    racks = (("racks", (1, 1, 4.5, 1.6)), ("columns", (1, 2.5, 1.4, 2.9)), ("racks", (9, 0, 10, 1)))
    path = save(hall_of(*racks), tmp_path / "hall.dxf")
    hall = imported(path, standing=("Rack*", "columns"))
    standing = [bounds(wall.outline) for wall in hall.standing[1:]]
    assert standing == [(1, 2.5, 1.4, 2.9), (1, 1, 4.5, 1.6)]
    assert len(hall.spaces["room_1"].holes) == 2
    assert "racks (2)" in drawn(path)[1]


def test_the_largest_area_is_named_where_it_is_open(tmp_path):
    walls = [(0, 0, 9, 0), (0, 0, 0, 6), (0, 6, 9, 6), (0, 3, 3, 3), (3, 3, 3, 2), (3, 1, 3, 0)]
    grid, warnings = drawn(lines_of(tmp_path / "hall.dxf", *walls))
    assert "the largest area, 44 m² around [5.2, 3.3], is open to the outside" in warnings
    # Floor beside the doorway of the office is no room.
    assert rooms(vectorise(grid).building) == [(0.05, 0.05, 3, 2.95)]
    whole = lines_of(tmp_path / "whole.dxf", *walls, (9, 0, 9, 2), (9, 5, 9, 6))
    assert "is open" not in drawn(whole)[1]


def test_ends_of_hatching_are_joined_with_the_nearest_alone():
    from grammars.maps.drawing import _caps

    strokes = [np.array([(k, row), (k, row + 2.0)]) for k in range(100) for row in (0, 4, 8)]
    assert sum(1 for _ in _caps(strokes, cell=0.02)) <= 8 * 2 * len(strokes)


@pytest.mark.parametrize(("rows", "depth"), [(30_000, 1), (2, 60)])
def test_blocks_without_end_are_counted_before_they_are_drawn(tmp_path, rows, depth):
    drawing = new_drawing(units=0)
    inner = drawing.blocks.new("B0")
    inner.add_line((0, 0), (1, 0))
    for level in range(1, depth):
        below, inner = inner, drawing.blocks.new(f"B{level}")
        inner.add_blockref(below.name, (0, 0))
        inner.add_blockref(below.name, (0, 1))
    array = {"row_count": rows, "column_count": rows, "row_spacing": 1, "column_spacing": 1}
    drawing.modelspace().add_blockref(inner.name, (0, 0), dxfattribs=array)
    drawing.saveas(tmp_path / "array.dxf")
    with pytest.raises(InputError, match="holds more than 500,000 entities"):
        drawn(tmp_path / "array.dxf")
