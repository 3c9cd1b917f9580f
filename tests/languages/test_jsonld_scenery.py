"""Scenery as JSON-LD: objects of other tools, and our own layers back from a composed graph."""

import json
import math
import re
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grammars.floorplan import load_floorplan
from grammars.jsonld import (
    check_jsonld,
    load_floorplan_jsonld,
    load_scenery_jsonld,
    scene_document,
    scenery_document,
)
from grammars.jsonld._expand import expand_text
from grammars.jsonld._layer_reader import read_layers
from grammars.jsonld.rdf import graph_of
from grammars.scenery import configure
from grammars.scenery.composition import compile_scene, resolve_behaviours
from grammars.text.diagnostics import Severity
from tests.languages.plans import HERE, layer, model_text, two_rooms
from tests.languages.test_scenery import outline

MODELS_OF_OTHERS = {
    "door": HERE / "errors" / "door_graph" / "door.jsonld",
    "lift": HERE / "models" / "lift.jsonld",
    "table": HERE / "models" / "table.jsonld",
}
PARTS = ("name", "instances", "groups", "parameters", "settings", "sentences")


def model_of_others(name):
    return json.loads(MODELS_OF_OTHERS[name].read_text())


def saved(folder, document, name="door.json"):
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(json.dumps(document, indent=1))
    return folder / name


def errors(path):
    return [finding for finding in check_jsonld(path) if finding.severity is Severity.ERROR]


@pytest.fixture(scope="module")
def building(campaigns):
    return load_floorplan(campaigns / "ortega2024" / "building_c.fpm")


def test_models_of_others_are_read(golden, building):
    """``models/others.txt``: each model, and where the door stands that its file places."""
    lines = []
    for path in MODELS_OF_OTHERS.values():
        read = load_scenery_jsonld(path)
        lines += ["", path.name, *(outline(one) for one in (*read.models, *read.instances))]
        placed = compile_scene(building, [read]).objects if read.instances else ()
        lines += [f"at {numbers(astuple(one.pose))}, {numbers(one.initial)}" for one in placed]
    golden("models/others.txt", "\n    ".join(lines).replace("\n    \n    ", "\n\n").strip() + "\n")


def numbers(values):
    return " ".join(f"{value:.12g}" for value in values)


def test_faults_of_the_published_door_are_said_and_it_is_read(tmp_path, golden):
    document = model_of_others("door")
    for node in document["@graph"]:
        if node["@id"] == "door:leaf":
            node["@id"] = "leaf"
        if node["@id"] == "door:hinge":
            node["origin-offset"] = "door:offset"
        if node["@id"] == "door:hinge-on-post-z":
            node["start"] = "door:nowhere"
        if "value" in node:
            node["@type"].remove("Quantity")
        if node["@id"] == "door:ajar-angle":
            node["@type"].append("JointLowerLimit")
    document["@graph"].append(
        {
            "@id": "door:offset",
            "@type": "Position",
            "of": "door:hinge-on-leaf-origin",
            "with-respect-to": "door:hinge-on-post-origin",
        }
    )
    file = saved(tmp_path, document)
    file.write_text(file.read_text().replace("/secorolab.github.io", "/hbrs-sesame.github.io"))
    warnings = []
    (model,) = load_scenery_jsonld(file, warnings).models
    (sound,) = load_scenery_jsonld(MODELS_OF_OTHERS["door"]).models
    assert (model.links, model.joints) == (sound.links, sound.joints)
    text = "".join(f"{warning}\n" for warning in warnings)
    golden("models/faulty_door.txt", text.replace(f"{tmp_path}/", ""))


def test_poses_are_read_against_their_direction(building, tmp_path):
    document = model_of_others("door")
    # The wall seen from the door, the inverse of (20.5, 0.1, -90 deg).
    inverse = {"unit": ["M", "RAD"], "alpha": math.pi / 2, "x": 0.1, "y": -20.5}
    for node in document["@graph"]:
        if node["@id"] == "door:here-placed":
            node["of"], node["with-respect-to"] = node["with-respect-to"], node["of"]
        if node["@id"] == "door:here-placed-numbers":
            node |= inverse | {"as-seen-by": "door:here"}
    (door,) = compile_scene(building, [load_scenery_jsonld(saved(tmp_path, document))]).objects
    assert door.pose.x == pytest.approx(-6.456217554968386, abs=1e-9)
    assert door.pose.yaw == pytest.approx(2.530727415391777, abs=1e-9)


def test_an_object_is_read_with_its_states_and_instances_from_other_files(tmp_path):
    document = model_of_others("door")
    files = {"model": [], "states": [], "instance": []}
    for node in document["@graph"]:
        is_placed = "door:here" in node["@id"] or "instance" in node["@id"]
        name = "states" if "ajar" in node["@id"] else "instance" if is_placed else "model"
        files[name].append(node)
    for name, nodes in files.items():
        saved(tmp_path / "door", document | {"@graph": nodes}, f"{name}.json")
    table = json.dumps(model_of_others("table")).replace("/objects/door/", "/objects/table/")
    saved(tmp_path / "door", json.loads(table), "table.json")
    together = load_scenery_jsonld(tmp_path / "door")
    assert {model.name for model in together.models} == {"door", "table"}
    (door,) = (model for model in together.models if model.name == "door")
    assert [state.name for state in door.states] == ["ajar"]
    assert (together.name, len(together.instances)) == ("door", 1)
    assert not errors(tmp_path / "door")


def written_and_read(folder, plan, layers):
    """Return plan and layers as they come back from a folder in which nothing is wrong."""
    scene = saved(folder, scene_document(plan, layers), "scene.json")
    assert errors(folder) == []
    documents = [scenery_document(each, plan, layers) for each in layers]
    files = [
        saved(folder, document, f"{each.name}.jsonld")
        for each, document in zip(layers, documents, strict=True)
    ]
    return load_floorplan_jsonld(scene), [load_scenery_jsonld(file) for file in files]


def behaviours(scene, layers):
    seed = np.random.SeedSequence(3)
    return resolve_behaviours(scene, layers, seed=seed, limit=600.0).behaviours


def assert_the_same_comes_of(plan, layers, back_plan, back):
    there, here = compile_scene(back_plan, back), compile_scene(plan, layers)
    assert there.digest == here.digest
    assert behaviours(there, back) == behaviours(here, layers)


LIVELY = model_text("lively.scenery")


def test_everything_scenery_can_say_comes_back(tmp_path):
    plan, lively = two_rooms(), layer(LIVELY)
    back_plan, (back,) = written_and_read(tmp_path, plan, [lively])
    for part in PARTS:
        assert getattr(back, part) == getattr(lively, part), part
    assert [model.joints for model in back.models] == [model.joints for model in lively.models]
    assert_the_same_comes_of(plan, [lively], back_plan, [back])


MODELS, _, SAID = LIVELY.partition("\nanna")
SENTENCES = re.split(r"\n(?! )", f"anna{SAID}".strip())
SPACES = st.sampled_from([" ", "\n", "  \n\t", " // 2 m (\n "])


@settings(max_examples=settings().max_examples // 5)
@given(st.lists(st.sampled_from(SENTENCES), unique=True), SPACES, st.sampled_from(["2 m", "90 cm"]))
def test_a_layer_comes_back_however_its_sentences_are_written(sentences, space, near):
    sentences = ["door is a hinged_door at hall", "parameter near = 1 m", *sentences]
    unique = {re.split(" is a | = ", sentence)[0]: sentence for sentence in sentences}
    text = "\n".join(unique.values()).replace(", ", f",{space}")
    lively = configure(layer(f"{MODELS}\n{text}"), {"near": near})
    document = json.dumps(scenery_document(lively, two_rooms()))
    (back,) = read_layers(expand_text(document, "layer.jsonld"), "objects")
    for part in PARTS:
        assert getattr(back, part) == getattr(lively, part), part


def test_a_layer_alone_refers_to_a_plan_that_is_elsewhere(tmp_path):
    """What it describes itself it describes completely."""
    doors = layer("way is a hinged_door at hall.walls[1], x 1 m, turned 90 deg, starts open\n")
    file = saved(tmp_path, scenery_document(doors, two_rooms()))
    assert check_jsonld(file) == ()
    frame = '"link-frame": "item:hinged_door.link.leaf.frame'
    file.write_text(file.read_text().replace(f'{frame}"', f'{frame}s"'))
    (finding,) = check_jsonld(file)
    assert "hinged_door.link.leaf.frames, which does not exist" in finding.message


DOORWAY = "way is a hinged_door in kitchen_doorway, "


def composed(*layers):
    """Return the two rooms and layers as one rdflib graph."""
    text = json.dumps(scene_document(two_rooms(), layers))
    return graph_of(expand_text(text, "scene.jsonld"))


def test_a_door_that_hangs_the_other_way_is_published_as_its_mirror_image():
    doors = layer(f"{DOORWAY}hinge left, opening inwards\n")
    rows = composed(doors).query(
        "SELECT ?x ?yaw ?image WHERE { item:way obj:frame ?f ; obj:of-object ?image . "
        "?p geom-rel:of ?f . ?c geom-coord:of-pose ?p ; geom-coord:x ?x ; geom-coord:alpha ?yaw }"
    )
    ((x, yaw, image),) = [tuple(map(str, row)) for row in rows]
    (placed,) = compile_scene(two_rooms(), [doors]).objects
    assert (float(x), float(yaw)) == pytest.approx((placed.pose.x, placed.pose.yaw), abs=1e-9)
    assert image.endswith(".mirrored") == placed.mirrored


def test_a_graph_tells_the_sentences_of_each_layer_about_a_door():
    mood = layer("every hinged_door stays open\n", "mood", models=False)
    rows = composed(layer(f"{DOORWAY}hinge left, opening inwards\n"), mood).query(
        "SELECT ?text WHERE { ?s scn:about item:way ; scn:in-layer item:layer.mood ;"
        " scn:text ?text }"
    )
    assert [str(text) for (text,) in rows] == ["every hinged_door stays open"]


@pytest.mark.parametrize(
    ("manner", "room"),
    [
        ("hinge left, opening inwards", "hall"),
        ("hinge left, opening outwards", "kitchen"),
        ("hinge right, opening into kitchen", "kitchen"),
    ],
)
def test_a_graph_tells_which_room_a_door_opens_into(manner, room):
    graph = composed(layer(f"{DOORWAY}{manner}\n"))
    ((value,),) = graph.query("SELECT ?room WHERE { item:way scn:opens-into ?room }")
    assert value.endswith(f"/{room}")
