"""The cells a polygon takes by the rule of published maps, beside Pillow's polygons."""

import math

import numpy as np
import pytest
import shapely
from PIL import Image, ImageDraw

from templates.polygon_cells import outline_filled, outline_of_convex, painted

SIDE = 100
CENTRE = SIDE / 2


def by_pillow(ring):
    """Draw the polygon through the cells of the corners, as the published tool does."""
    image = Image.new("L", (SIDE, SIDE), 0)
    ImageDraw.Draw(image).polygon([(int(x), int(y)) for x, y in ring], fill=1)
    return np.asarray(image) > 0


def hull(random):
    points = shapely.MultiPoint(random.uniform(2, SIDE - 2, (int(random.integers(3, 8)), 2)))
    return np.array(shapely.convex_hull(points).exterior.coords)[:-1]


def rectangle(random):
    """A wall: some cells thick, any way round."""
    angle, length, thickness = random.uniform((0, 5, 1), (2 * math.pi, 80, 8))
    along = np.array([math.cos(angle), math.sin(angle)]) * length / 2
    across = np.array([-math.sin(angle), math.cos(angle)]) * thickness / 2
    corners = [along + across, across - along, -along - across, along - across]
    return np.array(corners) + random.uniform(CENTRE - 5, CENTRE + 5, 2)


def star(random):
    count = int(random.integers(6, 20))
    angle = np.sort(random.uniform(0, 2 * math.pi, count))
    radius = random.uniform(12, 45, count)
    return CENTRE + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize(
    ("make", "cells_of"),
    [
        (hull, outline_of_convex),
        (hull, outline_filled),
        (rectangle, outline_of_convex),
        (star, outline_filled),
    ],
)
def test_polygons_are_filled_as_pillow_fills_them(make, cells_of):
    random = np.random.default_rng(13)
    differing = filled = 0
    for _ in range(300):
        ring = make(random)
        theirs = by_pillow(ring)
        filled += np.count_nonzero(theirs)
        differing += np.count_nonzero(painted([cells_of(ring)], (SIDE, SIDE)) ^ theirs)
    # The rest are slivers, of which Pillow leaves out pieces, and single cells in sharp corners.
    assert differing < 1e-3 * filled


def test_a_convex_polygon_is_in_one_piece_however_thin():
    random = np.random.default_rng(5)
    for _ in range(200):
        ends = random.uniform(5, SIDE - 5, (2, 2))
        ring = np.concatenate([ends, ends[::-1] + random.uniform(0, 0.6, (2, 2))])
        ring = np.array(shapely.MultiPoint(ring).convex_hull.exterior.coords)[:-1]
        rows = {int(row): (int(first), int(last)) for row, first, last in outline_of_convex(ring)}
        corners = np.floor(ring[:, 1])
        assert list(rows) == list(range(int(corners.min()), int(corners.max()) + 1))
        for row in list(rows)[1:]:
            (first, last), (first_below, last_below) = rows[row], rows[row - 1]
            assert first <= last_below + 1
            assert first_below <= last + 1


@pytest.mark.parametrize("cells_of", [outline_filled, outline_of_convex])
@pytest.mark.parametrize(
    ("ring", "expected"),
    [
        # A wall three cells thick takes four: the corner on the upper border is in the next cell.
        ([(2.0, 2.0), (2.0, 5.0), (8.0, 5.0), (8.0, 2.0)], dict.fromkeys(range(2, 6), (2, 8))),
        # Corners that rounding has moved below their border by less than a nanometre.
        ([(2 - 1e-9, 2.0), (2.0, 3 - 1e-9), (4.0, 3.0)], {2: (2, 4), 3: (2, 4)}),
        # Within one cell, within one row, within one column.
        ([(2.1, 2.1), (2.9, 2.2), (2.5, 2.8)], {2: (2, 2)}),
        ([(2.1, 2.1), (9.9, 2.2), (9.5, 2.8)], {2: (2, 9)}),
        ([(2.1, 2.1), (2.2, 4.9), (2.5, 2.8)], {2: (2, 2), 3: (2, 2), 4: (2, 2)}),
    ],
)
def test_small_polygons(ring, expected, cells_of):
    cells = painted([cells_of(np.array(ring))], (12, 12))
    found = {
        int(row): (int(np.argmax(cells[row])), int(11 - np.argmax(cells[row, ::-1])))
        for row in np.flatnonzero(cells.any(axis=1))
    }
    # A triangle's row at its tip may be narrower; its first and last cell are those of the corners.
    assert found.keys() == expected.keys()
    if len(ring) == 4 or len(expected) != 2:
        assert found == expected


def test_what_lies_outside_is_cut_off():
    ring = np.array([(-5.0, -5.0), (-5.0, 50.0), (50.0, 50.0), (50.0, -5.0)])
    assert painted([outline_filled(ring)], (4, 6)).all()
    assert painted([outline_of_convex(ring)], (4, 6)).all()
