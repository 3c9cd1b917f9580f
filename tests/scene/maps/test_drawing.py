"""Buildings from DXF drawings, which ezdxf writes here as architects' programs do."""

import math
import os
from importlib.util import find_spec

import numpy as np
import pytest
from scipy import ndimage

from grammars.maps import load_walls, walls_text
from grammars.maps.map_import import ImportSettings, vectorise
from grammars.model.grid import FREE, OCCUPIED
from grammars.text.diagnostics import Findings, InputError

pytestmark = pytest.mark.skipif(find_spec("ezdxf") is None, reason="needs the extra cad")

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


def bounds(ring):
    """Return the extent of a ring, exact to two cells of 2 cm."""
    xs, ys = zip(*ring, strict=True)
    return pytest.approx((min(xs), min(ys), max(xs), max(ys)), abs=0.04)


def areas(grid, kind=FREE):
    """Return the extents of connected cells of a kind on a map, exact to two cells of 2 cm."""
    cell, x, y = grid.resolution, grid.x, grid.y
    return [
        pytest.approx(
            (x + at.start * cell, y + up.start * cell, x + at.stop * cell, y + up.stop * cell),
            abs=0.04,
        )
        for up, at in ndimage.find_objects(ndimage.label(grid.cells == kind)[0])
    ]


def save(drawing, path):
    drawing.saveas(path)
    return path


def test_walls_rooms_and_doorways_are_found(tmp_path):
    draw(tmp_path / "My house.dxf")
    grid, warnings = drawn(tmp_path / "My house.dxf")
    building = vectorise(grid, ImportSettings("house")).building
    (door,) = building.entryways.values()
    assert (*door.start, *door.end, door.depth) == pytest.approx(
        (6.08, 2, 6.08, 2.9, 0.15), abs=0.03
    )
    path = tmp_path / "house.walls.yaml"
    path.write_text(walls_text(building), encoding="utf-8")
    plan = load_walls(path)
    assert plan.warnings == ()
    assert warnings.endswith("lines on other layers were ignored: A-DOOR (1)")
    # The outer doorway ends the first room: half the wall belongs to it there.
    rooms = [bounds(space.outline) for space in building.spaces.values()]
    assert rooms == [(0.3, 0, 6, 5.7), (6.15, 3.55, 9.7, 5.7), (6.15, 0.3, 9.7, 3.45)]
    assert [len(space.holes) for space in plan.spaces] == [1, 0, 0]
    assert [bounds(f.footprint) for f in plan.features] == [(0, 0, 10, 6), (3, 3, 3.4, 3.4)]


@pytest.mark.parametrize(
    ("unit", "scale", "given", "at"), [(1, 1 / 0.0254, "", 0.0), (6, 100.0, "cm", 5_600_000.0)]
)
def test_units_are_those_of_the_file_or_given_and_coordinates_of_a_country_are_moved(
    unit, scale, given, at, tmp_path
):
    draw(tmp_path / "house.dxf", unit=unit, scale=scale, at=at)
    grid, warnings = drawn(tmp_path / "house.dxf", unit=given)
    assert ("was moved by (-5600000 m, -5600000 m)" in warnings) is (at > 0.0)
    assert areas(grid) == [(0.3, 0, 9.7, 5.7), (6.15, 3.55, 9.7, 5.7)]


def test_a_building_as_large_as_by_a_wrong_unit_is_questioned(tmp_path, monkeypatch):
    monkeypatch.setattr("grammars.maps.drawing._MOST_CELLS", 1e5)
    draw(tmp_path / "house.dxf", unit=1, scale=1000.0)
    measures = "the walls measure 254 m by 152 m: the file says in"
    assert measures in drawn(tmp_path / "house.dxf")[1]
    assert measures not in drawn(tmp_path / "house.dxf", unit="IN")[1]


def lines_of(path, *lines):
    """Save a drawing in metres of these lines on a layer of walls."""
    drawing = new_drawing()
    for x0, y0, x1, y1 in lines:
        drawing.modelspace().add_line((x0, y0), (x1, y1), dxfattribs={"layer": "wall"})
    return save(drawing, path)


SHED = [(0, 0, 6, 0), (6, 0.4, 6, 4), (6, 4, 0, 4), (0, 4, 0, 0), (3, 2, 3, 2)]
GATE = [(0, 0, 8, 0), (0, 0, 0, 6), (0, 6, 8, 6), (8, 0, 8, 1.2), (8, 4.7, 8, 6)]
YARD = [
    *[(0, 0, 10, 0), (10, 0, 10, 6), (10, 6, 8, 6), (8, 6, 8, 2)],
    *[(8, 2, 2, 2), (2, 2, 2, 6), (2, 6, 0, 6), (0, 6, 0, 0)],
]


@pytest.mark.parametrize(
    ("walls", "room", "size"),
    [
        # A small gap is closed, and a line without a length left out.
        (SHED, (0.05, 0.05, 5.95, 3.95), 5.9 * 3.9),
        # A gate 3.5 m wide in the outer wall ends a hall.
        (GATE, (0.05, 0.05, 8, 5.95), 7.95 * 5.9),
        # Floor between two wings is outside.
        (YARD, (0.05, 0.05, 9.95, 5.95), 9.9 * 1.9 + 2 * 1.9 * 4),
    ],
    ids=["gap", "gate", "yard"],
)
def test_rooms_end_at_gaps_and_gates_and_where_it_is_open(walls, room, size, tmp_path):
    grid, _ = drawn(lines_of(tmp_path / "house.dxf", *walls))
    assert areas(grid) == [room]
    # Corners of thickened lines are round.
    assert np.count_nonzero(grid.cells == FREE) * grid.resolution**2 == pytest.approx(size, abs=0.7)


def spoil(change):
    def made(path):
        drawing = draw(path)
        change(drawing)
        drawing.saveas(path)

    return made


@pytest.mark.parametrize(
    ("make", "settings", "message"),
    [
        (lambda p: p.write_bytes(b"AC1032\0\0\0"), {}, "not a DXF drawing\n    .* convert a DWG"),
        (lambda p: p.write_bytes(b""), {}, "is not a DXF drawing"),
        (lambda p: p.write_text("walls: hut\nspaces: {}\n"), {}, "is not a DXF drawing"),
        (lambda p: None, {}, "no such file"),
        (lambda p: os.mkfifo(p), {}, "is not a regular file"),
        (lambda p: draw(p, unit=0), {}, "no known unit\n    give its unit with --unit: mm, cm"),
        (lambda p: draw(p, unit=3), {}, "names no known unit"),
        (draw, {"unit": "km"}, 'unknown unit "km"'),
        (draw, {"unit": "m"}, "measure 1e\\+04 m by 6e\\+03 m: not a building"),
        (draw, {"layers": ("A-FLOR*",)}, r"choose one with --layer: A-WALL \(19\)"),
        (lambda p: lines_of(p, (0, 0, 9, 0), (0, 4, 9, 4)), {}, "the walls enclose no room"),
        (spoil(lambda d: d.modelspace().delete_all_entities()), {}, "shows no lines"),
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
    space.add_lwpolyline([(-3, 0, 1), (1, 0, 1)], format="xyb", close=True, dxfattribs=walls)
    inner = space.add_polyline2d([(-2.7, 0), (0.7, 0)], close=True, dxfattribs=walls)
    for vertex in inner.vertices:
        vertex.dxf.bulge = 1.0
    corners, wide = [(2, 0), (6, 0), (6, 3), (2, 3)], {"layer": "walls", "const_width": 0.4}
    space.add_lwpolyline(corners, close=True, dxfattribs=wide)
    space.add_text("walls", height=2.0, dxfattribs={"layer": "walls"})
    grid, _ = drawn(save(drawing, tmp_path / "tower.dxf"))
    assert areas(grid) == [(-2.7, -1.7, 0.7, 1.7), (2.2, 0.2, 5.8, 2.8)]
    floor = np.count_nonzero(grid.cells == FREE) * grid.resolution**2
    assert floor == pytest.approx(math.pi * 1.7**2 + 3.6 * 2.6, abs=0.4)


def test_blocks_are_looked_into_and_windows_are_chosen_by_their_layer(tmp_path):
    drawing = new_drawing()
    storey = drawing.blocks.new("STOREY")
    # On layer 0: on that of the block's insertion then.
    storey.add_lwpolyline([(1, 0), (0, 0), (0, 4), (5, 4), (5, 0), (3, 0)])
    storey.add_line((1, 0), (3, 0), dxfattribs={"layer": "WINDOWS"})
    drawing.modelspace().add_blockref("STOREY", (10, 10), dxfattribs={"layer": "walls"})
    path = save(drawing, tmp_path / "storey.dxf")
    assert areas(drawn(path, layers=("*wall*", "*window*"))[0]) == [(10.05, 10.05, 14.95, 13.95)]
    assert areas(drawn(path)[0]) == [(10.05, 10, 14.95, 13.95)]


INSIDE = (0.05, 0.05, 5.95, 3.95)


def hall_of(*rectangles):
    """Return a drawing in metres of a hall 6 m by 4 m, and of rectangles on other layers."""
    drawing = new_drawing()
    for layer, (x0, y0, x1, y1) in (("walls", (0, 0, 6, 4)), *rectangles):
        corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        drawing.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": layer})
    return drawing


def test_what_the_drawing_hides_or_does_not_hold_is_left_out_and_told(tmp_path):
    """Walls across the hall: on layers, invisible, of a block on a frozen layer, elsewhere."""
    across = (0, 2, 6, 2.2)
    drawing = hall_of(("walls off", across), ("old walls", across), ("walls 2", across),
                      ("walls", across))  # fmt: skip
    drawing.layers.add("walls off").off()
    drawing.layers.add("old walls").freeze()
    space, block = drawing.modelspace(), drawing.blocks.new("OLD")
    space[3].dxf.invisible = 1
    space.move_to_layout(space[4], block)
    space.add_blockref("OLD", (0, 0), dxfattribs={"layer": "old walls"})
    drawing.add_xref_def("neighbour.dxf", "NEIGHBOUR")
    for name in ("NEIGHBOUR", "GONE"):
        space.add_blockref(name, (0, 0), dxfattribs={"layer": "walls"})
    grid, warnings = drawn(save(drawing, tmp_path / "hall.dxf"))
    hidden = "hidden entities were ignored on layers: old walls (2), walls off (1), walls 2 (1)"
    assert hidden in warnings
    assert "blocks missing in the file were ignored: NEIGHBOUR (1), GONE (1)" in warnings
    assert areas(grid) == [INSIDE]


def test_drawings_of_either_form_are_read_whole_or_refused(tmp_path):
    path = tmp_path / "hall.dxf"
    for form in ("asc", "bin"):
        hall_of().saveas(path, fmt=form)
        whole = path.read_bytes()
        path.write_bytes(whole[:-100])
        with pytest.raises(InputError, match="is cut off"):
            drawn(path)
    path.write_bytes(whole)
    grid, warnings = drawn(path)
    assert areas(grid) == [INSIDE]
    assert warnings == "", "a closed room has no open floor"


def test_racks_and_columns_of_their_layer_stand_in_the_room(tmp_path):
    racks = (("racks", (1, 1, 4.5, 1.6)), ("columns", (1, 2.5, 1.4, 2.9)), ("racks", (9, 0, 10, 1)))
    path = save(hall_of(*racks), tmp_path / "hall.dxf")
    grid, warnings = drawn(path, standing=("Rack*", "columns"))
    assert areas(grid, OCCUPIED)[1:] == [(1, 1, 4.5, 1.6), (1, 2.5, 1.4, 2.9)]
    assert areas(grid) == [INSIDE]
    assert "racks" not in warnings


def test_the_largest_area_is_named_where_it_is_open(tmp_path):
    walls = [(0, 0, 9, 0), (0, 0, 0, 6), (0, 6, 9, 6), (0, 3, 3, 3), (3, 3, 3, 2), (3, 1, 3, 0)]
    grid, warnings = drawn(lines_of(tmp_path / "hall.dxf", *walls))
    assert "the largest area, 44 m² around [5.2, 3.3], is open to the outside" in warnings
    # Floor beside the doorway of the office is no room.
    assert areas(grid) == [(0.05, 0.05, 3, 2.95)]


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
