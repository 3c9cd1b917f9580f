"""Validation after composition: SHACL, and what SHACL cannot say."""

import json

import pytest
from rdflib import RDF, Literal, URIRef

from grammars.floorplan import load_floorplan, parse_floorplan
from grammars.jsonld import (
    check_composition,
    check_jsonld,
    compose,
    decompose,
    scene_document,
    validate,
)
from grammars.jsonld.vocabulary import COORD, FP, OBJ, POLY, QUDT, REL
from grammars.scenery import load_scenery
from grammars.text.diagnostics import Severity
from tests.grammars.plans import layer, two_rooms

PLAN = "https://secorolab.github.io/models/floorplan/two_rooms/"
ITEM = "urn:scenario-tui:item:"
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


@pytest.mark.parametrize(
    ("folder", "names"),
    [
        ("demo", ("flat", "doors", "doors_moving")),
        ("ortega2024", ("building_c", "doors", "doors_random")),
    ],
)
def test_campaigns_are_valid(campaigns, folder, names):
    plan = load_floorplan(campaigns / folder / f"{names[0]}.fpm")
    layers = [load_scenery(campaigns / folder / f"{name}.scenery") for name in names[1:]]
    assert check_composition(plan, layers) == ()
    assert validate(compose(plan, layers)) == ()


def test_one_divider_in_several_rooms_is_found(tmp_path):
    """Five dividers with the same names in four spaces send the published tools 50 m astray."""
    document = scene_document(parse_floorplan(SCREENS))
    assert "east-screen" in json.dumps(document)
    text = json.dumps(document).replace("east-screen", "screen").replace("west-screen", "screen")
    file = tmp_path / "offices.json"
    file.write_text(text)
    found = [str(d) for d in check_jsonld(file) if d.severity is Severity.ERROR]
    assert any("divider-screen-frame is placed 2 times" in text for text in found)
    assert any("screen belongs to east and to west" in text for text in found)
    assert any("<space>-<name>" in text for text in found)


def graph_with_door():
    return compose(two_rooms(), [layer(DOORS)])


@pytest.mark.parametrize(
    ("subject", "predicate", "value", "message"),
    [
        (f"{PLAN}hall", FP["shape"], None, "a space has one shape"),
        (f"{PLAN}hall-wall-0", FP["height"], None, "walls and features have one height"),
        (f"{PLAN}kitchen_doorway", FP["voids"], None, "an opening has one list of walls"),
        (f"{PLAN}hall-wall-0", FP["height"], Literal(3.5), "has 2 values of height"),
        (f"{PLAN}hall", RDF.type, URIRef(FP["Wall"]), "is a Space and a Wall"),
        (f"{PLAN}hall-polygon", POLY["points"], None, "a polygon has one list of points"),
        (f"{ITEM}way", OBJ["of-object"], None, "an instance is of one object"),
        (f"{ITEM}way", OBJ["world"], URIRef(f"{PLAN}hall"), "2 values of world"),
        (f"{ITEM}hinged_door.joint.hinge.lower", QUDT["value"], None, "a limit of joint hinge"),
        (
            f"{PLAN}coord-pose-hall-frame-wrt-world-frame",
            COORD["of-pose"],
            None,
            "pose pose-hall-frame-wrt-world-frame has no coordinates",
        ),
        (
            f"{PLAN}pose-hall-frame-wrt-world-frame",
            REL["with-respect-to"],
            None,
            "a pose is with respect to one frame",
        ),
        (f"{PLAN}hall-wall-2-frame", RDF.type, None, "which does not exist"),
    ],
)
def test_faults_of_a_composed_graph_are_found(subject, predicate, value, message):
    graph = graph_with_door()
    place = (URIRef(subject), URIRef(predicate))
    if value is None:
        assert (*place, None) in graph
        graph.remove((*place, None))
    else:
        graph.add((*place, value))
    found = [str(d) for d in validate(graph)]
    assert any(message in text for text in found), found


def test_frames_of_nowhere_are_found():
    graph = graph_with_door()
    pose = URIRef(f"{ITEM}way.frame.pose")
    graph.remove((pose, None, None))
    graph.remove((None, URIRef(COORD["of-pose"]), pose))
    found = [d.message for d in validate(graph)]
    assert "instance way is not connected to the world" in found


def test_a_loop_of_poses_is_found():
    graph = graph_with_door()
    extra = URIRef(f"{PLAN}again")
    graph.add((extra, RDF.type, URIRef(REL["Pose"])))
    graph.add((extra, URIRef(REL["of"]), URIRef(f"{PLAN}kitchen-wall-1-frame")))
    graph.add((extra, URIRef(REL["with-respect-to"]), URIRef(f"{PLAN}hall-frame")))
    found = [d.message for d in validate(graph)]
    assert any("kitchen-wall-1-frame is placed 2 times" in message for message in found)


def test_a_broken_list_is_found_and_not_followed():
    graph = graph_with_door()
    head = graph.value(URIRef(f"{PLAN}hall"), URIRef(FP["walls"]))
    graph.set((head, RDF.rest, head))
    assert any("list of the graph is broken" in d.message for d in validate(graph))


def test_a_graph_that_went_through_n_triples_is_the_same_scene():
    from rdflib import Graph

    plan, doors = two_rooms(), layer(DOORS)
    text = compose(plan, [doors]).serialize(format="nt")
    back_plan, back = decompose(Graph().parse(data=text, format="nt"))
    assert back_plan == plan
    assert [i.name for i in back[0].instances] == ["way"]


def test_the_structural_rules_are_those_of_the_shapes():
    """After a change of the shapes: ``python -m grammars.jsonld.rdf``."""
    from grammars.jsonld._references import REFERENCES_FILE
    from grammars.jsonld.rdf import references_text

    assert REFERENCES_FILE.read_text(encoding="utf-8") == references_text()
