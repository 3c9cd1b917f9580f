"""Floor plans as JSON-LD: the published files, and the same plan back from them."""

import json
import re

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from grammars.floorplan import load_floorplan, parse_floorplan
from grammars.jsonld import (
    check_jsonld,
    load_floorplan_jsonld,
    plan_documents,
    scene_document,
)
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import InputError, Severity
from templates.jsonld import write_jsonld
from tests.languages.plans import world_of

CELL = """
Floor plan: demo
    Defaults:
        walls:
            thickness: 0.2 m
            height: 2.4 m
    Space cell:
        shape: Rectangle width=2.0 m, length=2.0 m
        location:
            wrt: world
            of: this
            translation: x: 3.0 m, y: 1.0 m
"""
DOOR = """
    Entryway door:
        shape: Rectangle width=0.9 m, height=2.0 m
        location: in: cell.walls[0] translation: x: 0.3 m, z: 1.0 m
"""
ODD = """
Floor plan: hall
Space hall:
    shape: Polygon points: [(0 m, 0 m), (1 m, 6 m), (5 m, 4 m), (4 m, 0 m)]
    location: wrt: annex.walls[1] of: this.walls[2] translation: x: 0.3 m, y: 1 m rotation: z: 7 deg
    walls: thickness: 0.15 m height: 3 m
    features:
        Column pillar: shape: Circle radius=0.2 m height: 3 m location: wrt: this.walls[0]
        Divider screen: shape: Rectangle width=1 m, length=0.1 m height: 2 m
            location: wrt: annex.walls[0] translation: y: -1 m
Space annex:
    shape: Rectangle width=4.1 m, length=3.3 m
    location: wrt: world of: this rotation: z: 200 deg
    walls: thickness: 0.3 m height: 2.5 m
    features:
        Column pillar: shape: Rectangle width=0.3 m, length=0.3 m height: 2 m location: wrt: this
Column hall: shape: Rectangle width=0.3 m, length=0.3 m height: 2 m location: wrt: hall
Entryway pillar:
    shape: Rectangle width=1 m, height=2 m
    location: in: annex.walls[1] and hall.walls[2] translation: x: 0.2 m, z: 1 m rotation: y: 3 deg
Window skylight:
    shape: Polygon points: [(0 m, 0 m, 0 m), (1 m, 0 m, 0 m), (0.5 m, 0 m, 0.8 m)]
    location: in: annex.walls[3] translation: z: 1.2 m
"""


def node(document, id):
    found = [n for n in document["@graph"] if n["@id"] == id]
    assert len(found) == 1
    return found[0]


def test_a_cell_has_the_published_number_of_nodes():
    counts = {n: len(d["@graph"]) for n, d in plan_documents(parse_floorplan(CELL)).items()}
    assert counts == {
        "skeleton": 48,
        "shape": 5,
        "polyhedron": 4,
        "spatial_relations": 41,
        "coordinate": 41,
        "floorplan": 6,
    }


def test_a_cell_has_the_published_nodes():
    files = plan_documents(parse_floorplan(CELL))
    assert files["skeleton"]["@context"][0] == {
        "@base": "https://secorolab.github.io/models/floorplan/demo/",
        "fpm": "https://secorolab.github.io/models/floorplan/demo/",
    }
    ids = [n["@id"] for n in files["skeleton"]["@graph"]]
    assert ids[:5] == [
        "world-origin",
        "world-frame",
        "cell-origin",
        "cell-frame",
        "cell-corner-0",
    ]
    assert node(files["skeleton"], "cell-wall-0-frame") == {
        "@id": "cell-wall-0-frame",
        "@type": "Frame",
        "origin": "cell-wall-0-origin",
    }
    position = "position-cell-wall-0-corner-4-wrt-cell-wall-0-frame"
    assert node(files["spatial_relations"], position) == {
        "@id": position,
        "@type": "Position",
        "of": "cell-wall-0-corner-4",
        "with-respect-to": "cell-wall-0-origin",
    }
    numbers = node(files["coordinate"], f"coord-{position}")
    assert (numbers["x"], numbers["y"], numbers["z"]) == (-1.2, 0.2, 2.4)
    assert numbers["@type"] == ["PositionReference", "PositionCoordinate", "VectorXYZ"]
    pose = "pose-cell-frame-wrt-world-frame"
    assert node(files["coordinate"], f"coord-{pose}") == {
        "@id": f"coord-{pose}",
        "@type": ["PoseReference", "PoseCoordinate", "VectorXYZ", "EulerAngles"],
        "of-pose": pose,
        "as-seen-by": "world-frame",
        "unit": ["M", "RAD"],
        "alpha": 0.0,
        "beta": 0.0,
        "x": 3.0,
        "y": 1.0,
        "z": 0.0,
    }
    faces = node(files["polyhedron"], "cell-wall-0-polyhedron")["faces"]
    assert [[int(p[-1]) for p in face] for face in faces] == [
        [0, 1, 2, 3],
        [4, 5, 6, 7],
        [0, 1, 5, 4],
        [1, 2, 6, 5],
        [2, 3, 7, 6],
        [3, 0, 4, 7],
    ]
    assert node(files["floorplan"], "cell") == {
        "@id": "cell",
        "@type": "Space",
        "walls": [f"cell-wall-{k}" for k in range(4)],
        "features": [],
        "shape": "cell-polygon",
    }
    assert node(files["floorplan"], "demo") == {
        "@id": "demo",
        "@type": "FloorPlan",
        "spaces": ["cell"],
    }


def test_an_opening_says_its_walls_depth_and_unit():
    files = plan_documents(parse_floorplan(CELL + DOOR))
    opening = node(files["floorplan"], "door")
    assert (opening["voids"], opening["thickness"], opening["unit"]) == (["cell-wall-0"], 0.2, "M")
    near = [node(files["coordinate"], c)["y"] for c in corners("door", range(4))]
    far = [node(files["coordinate"], c)["y"] for c in corners("door", range(4, 8))]
    assert near == [0.0] * 4
    assert far == [0.2] * 4
    assert node(files["spatial_relations"], "pose-entryway-door-frame-wrt-cell-wall-0-frame")


def corners(element, numbers):
    frame = f"entryway-{element}-frame"
    return [f"coord-position-{element}-corner-{k}-wrt-{frame}" for k in numbers]


def test_things_with_one_name_get_identifiers_of_their_own():
    plan = parse_floorplan(ODD)
    document = plan_documents(plan)["floorplan"]
    ids = [n["@id"] for n in document["@graph"]]
    assert len(set(ids)) == len(ids)
    assert {"hall", "column-hall", "plan-hall", "hall-pillar", "annex-pillar", "pillar"} <= set(ids)


def written(plan, folder):
    return write_jsonld(world_of(plan), folder)[-1]


@pytest.mark.parametrize("text", [CELL, CELL + DOOR, ODD], ids=["cell", "door", "odd"])
def test_a_plan_comes_back_bit_by_bit(text, tmp_path):
    plan = parse_floorplan(text, "plan.fpm")
    for source in (written(plan, tmp_path), tmp_path):
        back = load_floorplan_jsonld(source)
        assert back == plan
        assert scene_document(back) == scene_document(plan)
        assert compile_scene(back).digest == compile_scene(plan).digest


@pytest.mark.parametrize("name", ["demo/flat", "ortega2024/building_c"])
def test_a_campaigns_plan_comes_back(campaigns, tmp_path, name):
    plan = load_floorplan(campaigns / f"{name}.fpm")
    back = load_floorplan_jsonld(written(plan, tmp_path))
    assert back == plan
    assert [p.placement for p in back.spaces] == [p.placement for p in plan.spaces]


def test_published_plans_come_back(reference_data, tmp_path):
    files = sorted(reference_data.rglob("*.fpm"))
    for file in [*files[:4], *files[4::20]]:
        plan = load_floorplan(file)
        assert load_floorplan_jsonld(written(plan, tmp_path / file.name)) == plan, file.name


def test_same_plan_same_bytes(tmp_path):
    first = written(parse_floorplan(ODD, "a.fpm"), tmp_path / "one").read_bytes()
    assert first == written(parse_floorplan(ODD, "b.fpm"), tmp_path / "two").read_bytes()


def old_fashioned(text):
    """Write a plan as the first tools did."""
    text = text.replace("secorolab.github.io/metamodels/floorplan/floorplan.json",
                        "hbrs-sesame.github.io/metamodels/floor-plan/floor-plan.json")  # fmt: skip
    text = text.replace('"alpha"', '"theta"').replace('"features"', '"feature"')
    return re.sub(r'"theta": ([-\d.e]+)', lambda m: f'"theta": {float(m[1]) * 57.29577951308232}',
                  text).replace('"RAD"', '"degrees"')  # fmt: skip


def test_old_ways_of_writing_are_read_with_one_warning_each(tmp_path):
    plan = parse_floorplan(ODD.replace("Column hall:", "Column post:"))
    written(plan, tmp_path)
    for file in tmp_path.glob("*.json"):
        file.write_text(old_fashioned(file.read_text()))
    back = load_floorplan_jsonld(tmp_path)
    said = [d.message for d in back.warnings]
    for word in ("outdated address", '"theta"', '"degrees"', '"feature"'):
        assert sum(word in message for message in said) == 1, word
    for one, other in zip(back.walls, plan.walls, strict=True):
        assert one.frame.x == pytest.approx(other.frame.x, abs=1e-9)
        assert one.footprint[0] == pytest.approx(other.footprint[0], abs=1e-9)
    assert [f.space for f in back.features] == [f.space for f in plan.features]


def test_the_files_of_the_published_tool_are_read(tmp_path):
    """It writes keys its contexts lack, openings without a unit, corners of columns without z."""
    plan = parse_floorplan(ODD.replace("Column hall:", "Column post:"))
    for name, document in plan_documents(plan).items():
        for each in document["@graph"]:
            if "features" in each and each["@type"] == "Space":
                each["feature"] = each.pop("features")
            if each["@type"] in ("Pose", "Position"):
                each["quantity-kind"] = ["Angle", "Length"]
            if each["@type"] in ("Entryway", "Window"):
                del each["unit"]
            if each["@id"].startswith("coord-position-post-corner"):
                del each["z"]
        (tmp_path / f"{name}.json").write_text(json.dumps(document))
    back = load_floorplan_jsonld(tmp_path)
    assert back == plan
    assert [d.message for d in back.warnings if "quantity-kind" in d.message]
    assert [d for d in check_jsonld(tmp_path) if d.severity is Severity.ERROR] == []


NODES = scene_document(parse_floorplan(CELL + DOOR))
VALUES = st.sampled_from(
    [None, True, 0, -1, 1e308, "", "x", "world-frame", [], {}, [[]], {"@id": "cell"}, ["cell", 3],
     {"@value": "a"}, {"@list": [1]}, {"@id": 5}, "Frame", "_:b", "https://e.org/ x"]
)  # fmt: skip
KEYS = st.sampled_from(["@id", "@type", "of", "x", "points", "@graph", "voids", "@reverse", "a:b"])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.data())
def test_mutated_plans_give_diagnostics_and_nothing_else(tmp_path, data):
    document = json.loads(json.dumps(NODES))
    nodes = document["@graph"]
    for _ in range(data.draw(st.integers(1, 4))):
        victim = nodes[data.draw(st.integers(0, len(nodes) - 1))]
        match data.draw(st.sampled_from(["set", "drop", "add", "remove", "context"])):
            case "set":
                victim[data.draw(st.sampled_from(sorted(victim) or ["x"]))] = data.draw(VALUES)
            case "drop":
                victim.pop(data.draw(st.sampled_from(sorted(victim) or ["x"])), None)
            case "add":
                victim[data.draw(KEYS)] = data.draw(VALUES)
            case "remove":
                nodes.remove(victim)
            case _:
                victim["@context"] = data.draw(VALUES)
    text = json.dumps(document)
    cut = data.draw(st.integers(0, len(text)))
    for candidate in (text, text[:cut]):
        (tmp_path / "plan.json").write_text(candidate)
        try:
            load_floorplan_jsonld(tmp_path / "plan.json")
        except InputError as error:
            assert error.findings
