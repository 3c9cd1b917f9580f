"""Buildings from DXF drawings, which ezdxf writes here as architects' programs do."""

import math
import os
from importlib.util import find_spec

import pytest

from grammars.maps import DrawingSettings, load_walls, read_drawing, walls_text
from grammars.text.diagnostics import InputError
from grammars.text.extras import MissingExtraError

# Imported in the tests, for every process of a round reads this file.
pytestmark = pytest.mark.skipif(find_spec("ezdxf") is None, reason="needs the extra import")

Line = tuple[float, float, float, float]
OUTER = [
    *[(0, 0, 1, 0), (2, 0, 10, 0), (10, 0, 10, 6), (10, 6, 0, 6), (0, 6, 0, 0)],
    *[(0.3, 0.3, 1, 0.3), (2, 0.3, 9.7, 0.3), (9.7, 0.3, 9.7, 5.7)],
    *[(9.7, 5.7, 6.15, 5.7), (6, 5.7, 0.3, 5.7), (0.3, 5.7, 0.3, 0.3)],
]
"""Two lines 30 cm apart, open between x 1 m and 2 m, where nobody drew the jambs."""
INNER = [
    *[(6, 5.7, 6, 2.9), (6, 2.9, 6.15, 2.9), (6.15, 2.9, 6.15, 5.7)],
    *[(6, 0.3, 6, 2.0), (6, 2.0, 6.15, 2.0), (6.15, 2.0, 6.15, 0.3)],
]
"""A wall 15 cm thick between x 6 m and 6.15 m, with a gap of 90 cm."""
SINGLE = [(6.15, 3.5, 9.7, 3.5)]
"""One line, and a door that is drawn across it."""
DOORS = [(6.0, 2.0, 90.0, 1.0), (7.5, 3.5, 0.0, 1.0), (1.0, 0.3, 0.0, 1 / 0.9)]
"""Hinge, turn and scale of blocks 90 cm wide."""


def draw(path, *, unit=4, scale=1000.0, at=0.0):
    """Return a drawing of a house with three rooms, three doors and a column; saved by ``path``."""
    import ezdxf

    drawing = ezdxf.new("R2010")
    drawing.header["$INSUNITS"] = unit
    space = drawing.modelspace()
    wall = {"layer": "A-WALL"}
    for x0, y0, x1, y1 in (*OUTER, *INNER, *SINGLE):
        ends = [((x + at) * scale, (y + at) * scale) for x, y in ((x0, y0), (x1, y1))]
        space.add_line(*ends, dxfattribs=wall)
    corners = [(3.0, 3.0), (3.4, 3.0), (3.4, 3.4), (3.0, 3.4)]
    column = [((x + at) * scale, (y + at) * scale) for x, y in corners]
    space.add_lwpolyline(column, close=True, dxfattribs=wall)
    block = drawing.blocks.new("Door_90")
    block.add_line((0, 0), (0, 0.9 * scale))
    block.add_arc((0, 0), 0.9 * scale, 0, 90)
    for x, y, turned, factor in DOORS:
        drawn = {"rotation": turned, "xscale": factor, "yscale": factor, "layer": "A-DOOR"}
        hinge = ((x + at) * scale, (y + at) * scale)
        space.add_blockref("Door_90", hinge, dxfattribs=drawn)
    space.add_text("Kitchen", dxfattribs={"layer": "A-ANNO"})
    space.add_circle((5 * scale, 5 * scale), 0.1 * scale, dxfattribs=wall)
    drawing.saveas(path)
    return drawing


def gaps(building):
    """Return start and end of every entryway in centimetres, and the depth of its wall [m]."""
    return [
        (tuple(round(100 * v) for v in (*door.start, *door.end)), round(door.depth, 3))
        for door in building.entryways
    ]


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    path = tmp_path_factory.mktemp("house") / "My house.dxf"
    draw(path)
    return read_drawing(path)


def test_walls_rooms_and_doorways_are_found(house, tmp_path):
    assert house.name == "My_house"
    assert gaps(house) == [
        # Leaves swing to the right of the way: west, north and north.
        ((608, 290, 608, 200), 0.15),
        ((840, 350, 750, 350), 0.1),
        ((200, 15, 100, 15), 0.3),
    ]
    path = tmp_path / "house.walls.yaml"
    path.write_text(walls_text(house), encoding="utf-8")
    plan = load_walls(path)
    assert plan.warnings == ()
    assert [tuple(map(round_cm, bounds(s.outline))) for s in plan.spaces] == [
        (30, 30, 600, 570),
        (615, 30, 970, 345),
        (615, 355, 970, 570),
    ]
    assert [len(space.holes) for space in plan.spaces] == [1, 0, 0]
    assert sorted(tuple(map(round_cm, bounds(f.footprint))) for f in plan.features) == [
        (0, 0, 1000, 600),
        (300, 300, 340, 340),
    ]
    said = [warning.message for warning in house.warnings]
    assert said == [
        "ignored on layers of walls: CIRCLE on A-WALL (1)",
        "ignored on layers without walls: A-ANNO (1)",
    ]


def bounds(ring):
    xs, ys = zip(*ring, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def round_cm(value):
    return round(100 * value)


@pytest.mark.parametrize(
    ("unit", "scale", "given"), [(6, 1.0, ""), (1, 1 / 0.0254, ""), (0, 100.0, "cm"), (4, 1.0, "m")]
)
def test_units_are_those_of_the_file_or_given(unit, scale, given, house, tmp_path):
    draw(tmp_path / "house.dxf", unit=unit, scale=scale)
    assert gaps(read_drawing(tmp_path / "house.dxf", DrawingSettings(unit=given))) == gaps(house)


def test_coordinates_of_a_country_are_moved(house, tmp_path):
    draw(tmp_path / "house.dxf", unit=6, scale=1.0, at=5_600_000.0)
    moved = read_drawing(tmp_path / "house.dxf")
    assert gaps(moved) == gaps(house)
    assert "was moved by (-5.6e+06 m, -5.6e+06 m)" in moved.warnings[0].message


def spoil(change):
    def made(path):
        drawing = draw(path)
        change(drawing)
        drawing.saveas(path)

    return made


def leave_open(drawing):
    """Leave a hut of one line with two gaps."""
    space = drawing.modelspace()
    space.delete_all_entities()
    for y in (0, 5000):
        space.add_line((0, y), (7000, y), dxfattribs={"layer": "wall"})
    space.add_line((0, 0), (0, 5000), dxfattribs={"layer": "wall"})
    space.add_line((8000, 0), (8000, 5000), dxfattribs={"layer": "wall"})


@pytest.mark.parametrize(
    ("make", "settings", "message"),
    [
        (lambda p: p.write_bytes(b"AC1032\0\0\0"), {}, "is a DWG file"),
        (lambda p: p.write_bytes(b""), {}, "is empty"),
        (lambda p: p.write_text("walls: hut\nspaces: {}\n"), {}, "cannot be read as a DXF"),
        (lambda p: None, {}, "cannot be read: No such file"),
        (lambda p: os.mkfifo(p), {}, "is no ordinary file"),
        (lambda p: draw(p, unit=0), {}, "does not say its unit\n    say it with --unit: mm, cm"),
        (lambda p: draw(p, unit=3), {}, r"units of kind 3 \(\$INSUNITS\)"),
        (draw, {"unit": "km"}, '"km" is no unit'),
        (draw, {"unit": "m"}, "measure 1e\\+04 m by 6e\\+03 m, which is no building"),
        (draw, {"layers": ("A-FLOR*",)}, r"choose one with --layer: A-WALL \(19\)"),
        (draw, {"layers": ("A-ANNO",)}, r"no lines on layers named like A-ANNO, but TEXT on"),
        (spoil(lambda d: leave_open(d)), {}, r"no room: 4 lines end .* as at \[7\.00, 0\.00\]"),
        (spoil(lambda d: d.modelspace().delete_all_entities()), {}, "it holds no lines"),
    ],
)  # fmt: skip
def test_what_is_no_building_is_refused_with_a_remedy(make, settings, message, tmp_path):
    make(tmp_path / "house.dxf")
    with pytest.raises(InputError, match=message):
        read_drawing(tmp_path / "house.dxf", DrawingSettings(**settings))


def test_arcs_of_walls_are_flattened_within_a_tolerance(tmp_path):
    import ezdxf

    drawing = ezdxf.new("R2010", units=6)
    # A tower: bulges of 1 are half circles; inside, a polyline of the old kind.
    space = drawing.modelspace()
    walls = {"layer": "Mur exterieur"}
    space.add_lwpolyline([(-4, 0, 1), (4, 0, 1)], format="xyb", close=True, dxfattribs=walls)
    inner = space.add_polyline2d([(-3.7, 0), (3.7, 0)], close=True, dxfattribs=walls)
    for vertex in inner.vertices:
        vertex.dxf.bulge = 1.0
    drawing.saveas(tmp_path / "tower.dxf")
    tower = read_drawing(tmp_path / "tower.dxf", DrawingSettings(tolerance=0.02))
    (room,) = tower.spaces
    assert all(math.hypot(x, y) == pytest.approx(3.7, abs=1e-3) for x, y in room.area.outline)
    sides = zip(room.area.outline, room.area.outline[1:], strict=False)
    assert max(3.7 - math.hypot((a + c) / 2, (b + d) / 2) for (a, b), (c, d) in sides) < 0.021
    assert len(room.area.outline) < 100


def test_blocks_are_looked_into_and_windows_close_walls(tmp_path):
    import ezdxf

    drawing = ezdxf.new("R2010", units=6)
    storey = drawing.blocks.new("STOREY")
    window = drawing.blocks.new("Window_1200")
    window.add_line((0, 0), (1.2, 0))
    window.add_line((0, 0.2), (1.2, 0.2))
    rows = [(0, 0, 1, 0), (2.2, 0, 5, 0), (0.2, 0.2, 1, 0.2), (2.2, 0.2, 4.8, 0.2)]
    for x0, y0, x1, y1 in rows:
        storey.add_line((x0, y0), (x1, y1), dxfattribs={"layer": "WALLS"})
    rest = [(5, 0), (5, 4), (0, 4), (0, 0)], [(4.8, 0.2), (4.8, 3.8), (0.2, 3.8), (0.2, 0.2)]
    for corners in rest:
        # On layer 0: on that of the block's insertion then.
        storey.add_lwpolyline(corners)
    storey.add_blockref("Window_1200", (1, 0))
    # A door without lines of its own says its width; an arc by itself is one by its layer.
    drawing.modelspace().add_blockref("STOREY", (10, 10), dxfattribs={"layer": "walls"})
    swing = {"layer": "DOORS"}
    drawing.modelspace().add_arc((15.0, 12.0), 0.8, 0, 90, dxfattribs=swing)
    drawing.saveas(tmp_path / "storey.dxf")
    found = read_drawing(tmp_path / "storey.dxf")
    assert len(found.spaces) == 1
    assert bounds(found.spaces[0].area.outline) == pytest.approx((10.2, 10.2, 14.8, 13.8))
    assert [corners for corners, _ in gaps(found)] == [(1490, 1200, 1490, 1280)]


def test_doors_beside_walls_are_told(tmp_path):
    drawing = draw(tmp_path / "house.dxf")
    drawing.modelspace().add_blockref("Door_90", (4000, 1500))
    drawing.saveas(tmp_path / "house.dxf")
    said = " ".join(w.message for w in read_drawing(tmp_path / "house.dxf").warnings)
    assert 'the block "Door_90" at [4.00, 1.50] lies in no wall' in said


def test_without_the_extra_it_is_said_what_installs_it(tmp_path, monkeypatch):
    draw(tmp_path / "house.dxf")
    monkeypatch.setitem(__import__("sys").modules, "ezdxf", None)
    with pytest.raises(MissingExtraError, match=r"scenario-tui\[import\]"):
        read_drawing(tmp_path / "house.dxf")
