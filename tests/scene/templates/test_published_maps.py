"""The rule of maps beside maps that were published, where they are at hand."""

import gzip
import io

import numpy as np
import pytest
from PIL import Image

from grammars.floorplan import load_floorplan, parse_floorplan
from grammars.model.grid import OCCUPIED
from grammars.scenery.composition import compile_scene
from templates.occupancy import occupancy_grid


def published(data, name):
    file = data / "maps" / f"{name}.pgm"
    packed = file.with_suffix(".pgm.gz")
    image = gzip.decompress(packed.read_bytes()) if packed.exists() else file.read_bytes()
    return np.flipud(np.asarray(Image.open(io.BytesIO(image))))


def kitchen(data):
    return load_floorplan(data / "floorplans" / "kitchen.fpm")


def hbrs(data):
    """The plan as it was when its map was drawn: all walls 0.2 m, rooms that far apart."""
    text = (data / "floorplans" / "hbrs.fpm").read_text(encoding="utf-8")
    for now, then in {
        "spaced": "",
        "x: 0.5 m, y: 0.0 m": "x: 0.5 m, y: 0.4 m",
        "thickness: 0.5 m": "thickness: 0.2 m",
        "thickness: my_thickness": "thickness: 0.2 m",
    }.items():
        assert now in text
        text = text.replace(now, then)
    return parse_floorplan(text)


# What is left under outline is rounding in the tool that drew the maps: in both plans corners lie
# on borders of cells, and there its walls lean by a cell from one end to the other.
@pytest.mark.parametrize(
    ("name", "rule", "least", "most"),
    [
        ("kitchen", "outline", 0.0, 0.05),
        ("kitchen", "touch", 0.15, 1.0),
        ("kitchen", "centre", 0.15, 1.0),
        ("hbrs", "outline", 0.0, 0.05),
        ("hbrs", "touch", 0.15, 1.0),
        ("hbrs", "centre", 0.15, 1.0),
    ],
)
def test_the_default_draws_published_plans_as_they_were_drawn(
    reference_data, name, rule, least, most
):
    plan = {"kitchen": kitchen, "hbrs": hbrs}[name](reference_data)
    theirs = published(reference_data, name)
    grid = occupancy_grid(compile_scene(plan, []), laser_height=0.7, rule=rule)
    assert grid.cells.shape == theirs.shape
    differing = np.count_nonzero((grid.cells == OCCUPIED) ^ (theirs == 0))
    assert least <= differing / np.count_nonzero(theirs == 0) <= most


@pytest.mark.parametrize(("name", "x", "y"), [("kitchen", -8.25, -9.35), ("hbrs", -8.4, -6.25)])
def test_the_origin_is_that_of_the_published_map(reference_data, name, x, y):
    plan = {"kitchen": kitchen, "hbrs": hbrs}[name](reference_data)
    grid = occupancy_grid(compile_scene(plan, []), laser_height=0.7)
    assert (grid.x, grid.y) == pytest.approx((x, y), abs=1e-9)


def test_building_c_lies_where_its_published_map_lies(reference_data):
    plan = load_floorplan(reference_data / "floorplans" / "brsu_building_c_with_doorways.fpm")
    grid = occupancy_grid(compile_scene(plan, []), laser_height=0.7)
    assert (grid.x, grid.y) == pytest.approx((-24.8019555, -19.0063712), abs=1e-6)
    assert grid.cells.shape == (1734, 1699)


def test_the_map_of_our_building_c_is_the_published_one(reference_data, campaigns):
    plan = load_floorplan(campaigns / "ortega2024" / "building_c.fpm")
    grid = occupancy_grid(compile_scene(plan, []), laser_height=0.3)
    theirs = published(reference_data, "brsu_building_c_dynamic")
    assert (grid.x, grid.y) == pytest.approx((-24.8019555, -19.0063712), abs=1e-6)
    assert grid.cells.shape == theirs.shape
    differing = np.count_nonzero((grid.cells == OCCUPIED) ^ (theirs == 0))
    assert differing <= 0.02 * np.count_nonzero(theirs == 0)
