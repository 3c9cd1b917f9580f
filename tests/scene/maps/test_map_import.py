"""Buildings made from maps: exact to a cell, the same each time, with doorways where doors are."""

import math
from dataclasses import asdict

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from grammars.maps import walls_text
from grammars.maps.map_import import EmptyMapError, ImportSettings, vectorise
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from tests.scene.maps.imported import (
    CELL,
    compared,
    hexagon_world,
    house,
    measured,
    painted,
)

RECTANGLE = st.tuples(
    st.integers(0, 26),
    st.integers(0, 26),
    st.integers(1, 14),
    st.integers(1, 14),
    st.sampled_from((FREE, FREE, OCCUPIED, UNKNOWN)),
)


HOUSE = house()


@pytest.mark.parametrize("grid", [hexagon_world(), HOUSE, measured(HOUSE)])
def test_the_building_of_a_drawn_map_has_that_map(tmp_path, grid):
    found = compared(grid, tmp_path, "touch")
    assert found.astray <= found.made.report.filled_cells
    assert found.differing == 0.0 or grid is not HOUSE
    assert found.made.report.largest_error <= 1.0


SHELF = painted(80, 80, (8, 8, 64, 64, OCCUPIED), (10, 10, 60, 60, FREE), (30, 28, 4, 12, OCCUPIED))
SPECKS = painted(
    60,
    60,
    (5, 5, 50, 50, OCCUPIED),
    (7, 7, 46, 46, FREE),
    (1, 1, 3, 3, FREE),
    (0, 58, 1, 2, OCCUPIED),
    (20, 20, 1, 2, UNKNOWN),
    (30, 30, 4, 4, UNKNOWN),
    (40, 40, 1, 1, OCCUPIED),
)
UNSEEN = painted(
    *(80, 60, (0, 0, 80, 60, OCCUPIED), (2, 2, 76, 56, FREE)),
    *((20, 58, 30, 2, UNKNOWN), (40, 20, 4, 4, UNKNOWN)),
)
TOUCHING = [
    painted(20, 20, (0, 0, 20, 20, OCCUPIED), (2, 2, 16, 16, FREE),
            *((row, column, 2, 2, OCCUPIED) for row, column in blocks))
    for blocks in (((5, 5), (7, 7)), ((5, 7), (7, 5)))
]  # fmt: skip
FINE = ImportSettings(least_room=0.0, specks=1, doorways=False)
IMPORTED = {
    "three rooms and a corridor, in reading order": (HOUSE, ImportSettings()),
    "the same without doorways": (HOUSE, ImportSettings(doorways=False)),
    "columns that stand near walls make no doorways": (hexagon_world(), ImportSettings()),
    "a passage between a wall and a shelf is no doorway": (SHELF, ImportSettings()),
    # An occupied cell is something the robot meets, what nobody saw is a hole.
    "small pockets and specks are left out and counted": (SPECKS, ImportSettings()),
    "blocks that touch in a corner are one": (TOUCHING[0], FINE),
    "blocks that touch in the other corner are one": (TOUCHING[1], FINE),
    "floor that ends without a wall, outside and inside": (UNSEEN, ImportSettings()),
}


def test_buildings_of_maps(golden):
    """``buildings.txt``: the layer of each map and the report on it; equal maps, equal texts."""
    text = ""
    for name, (grid, settings) in IMPORTED.items():
        made = vectorise(grid, settings)
        assert walls_text(vectorise(grid, settings).building) == walls_text(made.building)
        report = "".join(
            f"{key}: {round(value, 6) if isinstance(value, float) else value}\n"
            for key, value in asdict(made.report).items()
            if key not in ("directions", "width", "depth")
        )
        # Of the columns the report says enough.
        layer = walls_text(made.building) if made.report.corners < 50 else ""
        text += f"=== {name}\n{layer}---\n{report}\n"
    golden("buildings.txt", text)


@pytest.mark.parametrize(("degrees", "turned"), [(0, 0.0), (33, 0.0), (-20, 0.5)])
def test_doorways_are_found_in_buildings_that_stand_aslant(degrees, turned):
    original = HOUSE
    # The house, turned about its middle on a larger map, as the nearest cells have it.
    row, column = np.mgrid[0:260, 0:260] - 130.0
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    x = np.floor(column * cos + row * sin + 100).astype(int)
    y = np.floor(row * cos - column * sin + 70).astype(int)
    inside = (x >= 0) & (x < 200) & (y >= 0) & (y < 140)
    cells = np.full(x.shape, UNKNOWN, dtype=np.int8)
    cells[inside] = original.cells[y[inside], x[inside]]
    made = vectorise(OccupancyGrid(CELL, 0.0, 0.0, cells), yaw=turned)
    assert [math.dist(d.start, d.end) for d in made.building.entryways.values()] == [
        pytest.approx(0.9, abs=0.1)
    ] * 3
    expected = math.remainder(math.radians(degrees), math.pi / 2)
    assert made.report.directions[0] == pytest.approx(expected, abs=0.005)
    assert len(made.building.spaces) == 4
    (door, *_) = made.building.entryways.values()
    heading = math.atan2(door.end[1] - door.start[1], door.end[0] - door.start[0])
    off = math.remainder(heading - math.radians(degrees) - turned, math.pi / 2)
    assert off == pytest.approx(0.0, abs=0.02)


def test_a_turned_map_is_turned_about_its_origin():
    straight, turned = vectorise(HOUSE), vectorise(HOUSE, yaw=math.pi / 2)
    (before, *_), (after, *_) = (made.building.standing for made in (straight, turned))
    moved = shapely.Polygon([(-1.0 - (y + 2.0), -2.0 + (x + 1.0)) for x, y in before.outline])
    assert shapely.Polygon(after.outline).symmetric_difference(moved).area < 1e-3


def test_a_map_without_floor_is_refused():
    with pytest.raises(EmptyMapError, match="no free floor"):
        vectorise(painted(4, 4, (0, 0, 4, 4, OCCUPIED)))


@given(st.lists(RECTANGLE, min_size=1, max_size=9))
def test_any_map_becomes_polygons_that_do_not_overlap(rectangles):
    grid = painted(42, 42, (1, 1, 12, 12, FREE), *rectangles)
    if not (grid.cells == FREE).any():
        return
    made = vectorise(grid, ImportSettings(least_room=0.0, specks=1, doorways=False))
    floors, walls = (
        [shapely.Polygon(part.outline, part.holes) for part in parts]
        for parts in (made.building.spaces.values(), made.building.standing)
    )
    assert all(polygon.is_valid for polygon in (*floors, *walls))
    assert made.report.largest_error <= 1.0
    together = shapely.union_all([*floors, *walls]).area
    assert sum(polygon.area for polygon in (*floors, *walls)) == pytest.approx(together, abs=1e-6)
    # No cell vanishes, and none appears, further than a cell from a border.
    for polygons, kind in ((floors, FREE), (walls, OCCUPIED)):
        area = shapely.union_all(polygons)
        cells = grid.cells == kind
        row, column = np.nonzero(cells)
        boxes = shapely.box(
            *((k * CELL + o) for k, o in ((column, -1.0), (row, -2.0))),
            *((k * CELL + o) for k, o in ((column + 1, -1.0), (row + 1, -2.0))),
        )
        original = shapely.union_all(boxes)
        assert area.difference(original.buffer(1.5 * CELL)).area < 1e-9
        assert original.difference(area.buffer(1.5 * CELL)).area < 1e-9
