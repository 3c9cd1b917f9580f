"""Floor plans as GeoJSON."""

import json

import pytest
import shapely

from grammars.floorplan import parse_floorplan
from templates.maps import feature_collection, write_geojson

PLAN = parse_floorplan("""
Floor plan: café
Defaults: walls: thickness: 0.2 m height: 2.4 m
Space cell:
    shape: Rectangle width=2.0 m, length=2.0 m
    location: wrt: world of: this translation: x: 3.0 m, y: 1.0 m
    features:
        Column post: shape: Circle radius=0.2 m height: 1 m location: wrt: this
Entryway door: shape: Rectangle width=0.9 m, height=2.0 m
    location: in: cell.walls[0] translation: x: 0.3 m, z: 1.0 m
Window hatch: shape: Rectangle width=0.5 m, height=0.4 m
    location: in: cell.walls[2] translation: z: 1.5 m
""")


def by_id():
    return {feature["id"]: feature for feature in feature_collection(PLAN)["features"]}


def test_every_element_is_one_feature():
    kinds = [f["properties"]["kind"] for f in feature_collection(PLAN)["features"]]
    assert kinds == ["space", *["wall"] * 4, "column", "entryway", "window"]


def test_rings_are_closed_counter_clockwise_and_simple():
    for feature in by_id().values():
        (ring,) = feature["geometry"]["coordinates"]
        assert ring[0] == ring[-1]
        assert shapely.LinearRing(ring).is_ccw
        assert shapely.Polygon(ring).is_valid


def test_properties_tell_sizes_and_heights():
    features = by_id()
    wall = features["cell-wall-1"]["properties"]
    assert wall == {
        "kind": "wall",
        "name": "cell-wall-1",
        "space": "cell",
        "index": 1,
        "height": 2.4,
        "thickness": 0.2,
        "z_min": 0.0,
        "z_max": 2.4,
    }
    hatch = features["hatch"]["properties"]
    assert (hatch["z_min"], hatch["z_max"], hatch["height"]) == pytest.approx((1.3, 1.7, 0.4))
    assert (hatch["thickness"], hatch["space"]) == (0.2, None)
    assert features["post"]["properties"]["space"] == "cell"
    assert features["cell"]["properties"]["thickness"] is None


def test_shapes_are_those_of_the_plan():
    features = by_id()
    assert shapely.geometry.shape(features["cell"]["geometry"]).bounds == pytest.approx(
        (2, 0, 4, 2)
    )
    door = shapely.geometry.shape(features["door"]["geometry"])
    assert door.bounds == pytest.approx((2.85, 2.0, 3.75, 2.2))


def test_the_file_holds_the_collection(tmp_path):
    path = write_geojson(PLAN, tmp_path / "plan.geojson")
    assert json.loads(path.read_text(encoding="utf-8")) == feature_collection(PLAN)
    assert "café" in path.read_text(encoding="utf-8")
