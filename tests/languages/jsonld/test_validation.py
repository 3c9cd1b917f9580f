"""Checks of models in JSON-LD: shapes, and what no shape can say."""

import json

import pytest
from rdflib import Graph, URIRef

from grammars.floorplan import load_floorplan, parse_floorplan
from grammars.jsonld import check_jsonld, load_floorplan_jsonld, scene_document, scenery_document
from grammars.jsonld._expand import expand_text
from grammars.jsonld.rdf import graph_of
from grammars.jsonld.vocabulary import SCN
from grammars.scenery import load_scenery
from grammars.text.diagnostics import InputError, Severity
from tests.languages.plans import layer, two_rooms

DOORS = "way is a hinged_door at hall.walls[1], x 1 m, turned 90 deg, starts open\n"
SCREENS = """
Floor plan: offices
Defaults: walls: thickness: 0.2 m height: 2.5 m
Space east:
    shape: Rectangle width=4 m, length=4 m
    location: wrt: world of: this
    features:
        Divider screen: shape: Rectangle width=1 m, length=0.1 m height: 2 m location: wrt: this
Space west:
    shape: Rectangle width=4 m, length=4 m
    location: wrt: east.walls[3] of: this.walls[1] spaced
    features:
        Divider screen: shape: Rectangle width=1 m, length=0.1 m height: 2 m location: wrt: this
"""


def scene():
    """Return the nodes of a plan with a door in it, by identifier, and their context."""
    document = scene_document(two_rooms(), [layer(DOORS)])
    return {node["@id"]: node for node in document["@graph"]}, document["@context"]


def messages(folder, nodes, context):
    file = folder / "scene.jsonld"
    file.write_text(json.dumps({"@context": context, "@graph": list(nodes.values())}, indent=0))
    found = check_jsonld(file)
    assert all(d.where.file == str(file) and d.where.line > 1 for d in found)
    return [f"{d.message} ({d.hint})" for d in found]


@pytest.mark.parametrize(
    ("folder", "names"),
    [
        ("demo", ("flat", "doors", "doors_moving", "people")),
        ("ortega2024", ("building_c", "doors", "doors_random")),
    ],
)
def test_campaigns_fit_the_shapes(campaigns, tmp_path, folder, names):
    plan = load_floorplan(campaigns / folder / f"{names[0]}.fpm")
    layers = [load_scenery(campaigns / folder / f"{name}.scenery") for name in names[1:]]
    file = tmp_path / "scene.jsonld"
    file.write_text(json.dumps(scene_document(plan, layers)))
    assert [d.message for d in check_jsonld(file)] == [d.message for d in plan.warnings]


def test_one_divider_in_several_rooms_is_found(tmp_path):
    """Five dividers with the same names in four spaces send the published tools 50 m astray."""
    document = scene_document(parse_floorplan(SCREENS))
    assert "east-screen" in json.dumps(document)
    text = json.dumps(document).replace("east-screen", "screen").replace("west-screen", "screen")
    file = tmp_path / "offices.json"
    file.write_text(text)
    found = [str(d) for d in check_jsonld(file) if d.severity is Severity.ERROR]
    assert any("divider-screen-frame is placed 2 times" in text for text in found)
    assert any("screen: this belongs to several spaces" in text for text in found)
    assert any("<space>-<name>" in text for text in found)


@pytest.mark.parametrize(
    ("id", "key", "value", "message"),
    [
        ("hall", "shape", None, "hall: the shape, a polygon, is missing"),
        ("hall-wall-0", "height", None, "hall-wall-0: there is no height greater than 0"),
        ("hall-wall-0", "height", [3.5, 2.5], "hall-wall-0 has 2 values of height: 2.5, 3.5"),
        ("hall-wall-0", "unit", "feet", "the unit is none of M, CentiM and MilliM, found feet"),
        ("hall-wall-0", "height", 0.0, "there is no height greater than 0, found 0.0"),
        ("hall-wall-0", "thickness", -0.2, "wall has no thickness greater than 0, found -0.2"),
        ("coord-pose-hall-frame-wrt-world-frame", "x", True, "x of coord-pose-hall-frame-wrt-wor"),
        ("kitchen_doorway", "voids", None, "kitchen_doorway: this opening voids no wall"),
        ("hall", "walls", ["hall-wall-0"], "hall: this space has less than three walls"),
        ("hall", "@type", ["Space", "Wall"], "hall: this wall has no thickness greater"),
        ("hall-polygon", "points", None, "hall-polygon: this shape has no list of points"),
        ("hall-wall-2-frame", "@type", "Point", '-frame is hall-wall-2-frame, a Point (expected'),
        ("pose-hall-frame-wrt-world-frame", "with-respect-to", None, "is with respect to"),
        ("coord-pose-hall-frame-wrt-world-frame", "of-pose", None, "this pose has no coordinates"),
        ("coord-pose-hall-frame-wrt-world-frame", "as-seen-by", "hall-frame", "is seen by hall"),
        ("coord-pose-hall-frame-wrt-world-frame", "unit", None, "units are missing: lengths in"),
        ("item:way", "of-object", None, "way: this instance is of no object"),
        ("item:way", "world", ["fpm:two_rooms", "fpm:hall"], "way has 2 values of world: hall"),
        ("item:way", "start-state", "item:way", "is way, an ObjectInstance (expected a State)"),
        ("item:hinged_door.joint.hinge.lower", "value", None, "the value of this joint position"),
        ("item:hinged_door.joint.hinge.upper", "value", -1.0, "is above the upper (-1)"),
    ],
)  # fmt: skip
def test_faults_are_found(tmp_path, id, key, value, message):
    nodes, context = scene()
    assert key in nodes[id] or value is not None
    nodes[id] = {**nodes[id], key: value}
    found = messages(tmp_path, nodes, context)
    assert any(message in text for text in found), found


def test_a_scene_without_faults_has_none(tmp_path):
    assert messages(tmp_path, *scene()) == []


def test_a_fault_of_a_node_without_a_name_is_in_its_file(tmp_path):
    nodes, context = scene()
    wall = {
        key: value for key, value in nodes["hall-wall-0"].items() if key not in ("@id", "height")
    }
    file = tmp_path / "scene.jsonld"
    file.write_text(json.dumps({"@context": context, "@graph": [*nodes.values(), wall]}))
    (found,) = check_jsonld(file)
    assert str(found).startswith(f"{file}:1:1: a node without @id: there is no height")


def test_an_empty_list_leads_to_nothing_of_another_model(tmp_path):
    document = scenery_document(layer(DOORS), two_rooms())
    pose = next(node for node in document["@graph"] if node["@type"] == "Pose")
    pose["of"] = {"@list": []}
    file = tmp_path / "doors.jsonld"
    file.write_text(json.dumps(document))
    assert any('"of" of' in found.message for found in check_jsonld(file))


def test_frames_of_nowhere_are_found(tmp_path):
    nodes, context = scene()
    del nodes["item:way.frame.pose"], nodes["item:way.frame.pose.coordinates"]
    found = messages(tmp_path, nodes, context)
    assert any("instance way is not connected to the world" in text for text in found)


def test_a_loop_of_poses_is_found(tmp_path):
    nodes, context = scene()
    pose = nodes["pose-kitchen-wall-1-frame-wrt-kitchen-frame"]
    nodes["again"] = {**pose, "@id": "again", "with-respect-to": "hall-frame"}
    found = messages(tmp_path, nodes, context)
    assert any("kitchen-wall-1-frame is placed 2 times" in text for text in found), found


def test_a_layer_alone_refers_to_a_plan_that_is_elsewhere(tmp_path):
    """What it describes itself it describes completely."""
    file = tmp_path / "doors.jsonld"
    text = json.dumps(scenery_document(layer(DOORS), two_rooms()), indent=0)
    file.write_text(text)
    assert check_jsonld(file) == ()
    frame = "item:hinged_door.link.leaf.frame"
    file.write_text(text.replace(f'"link-frame": "{frame}"', f'"link-frame": "{frame}s"'))
    (found,) = check_jsonld(file)
    assert "hinged_door.link.leaf.frames, which does not exist" in found.message


def test_a_graph_can_be_asked_which_behaviours_are_about_a_door():
    plan, doors = two_rooms(), layer(DOORS)
    mood = layer("every hinged_door stays open\n", "mood", models=False)
    text = json.dumps(scene_document(plan, [doors, mood]))
    graph = graph_of(expand_text(text, "scene.jsonld"))
    assert isinstance(graph, Graph)
    about = list(graph.subjects(URIRef(SCN["about"]), URIRef("urn:scenario-tui:item:way")))
    assert len(about) == 1


def test_everything_that_is_wrong_is_reported_at_once(tmp_path):
    nodes, context = scene()
    nodes["hall"] = {**nodes["hall"], "shape": None}
    del nodes["item:way.frame.pose"], nodes["item:way.frame.pose.coordinates"]
    file = tmp_path / "scene.json"
    file.write_text(json.dumps({"@context": context, "@graph": list(nodes.values())}))
    with pytest.raises(InputError) as caught:
        load_floorplan_jsonld(file)
    assert len({d.where.file for d in caught.value.findings}) == 1
    assert len(caught.value.findings) == 2
