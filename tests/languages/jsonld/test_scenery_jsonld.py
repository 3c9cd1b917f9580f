"""Scenery as JSON-LD: objects others wrote, and our own layers back from a composed graph."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
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
from grammars.scenery import configure, load_scenery
from grammars.scenery.composition import compile_scene, resolve_behaviours
from grammars.text.diagnostics import InputError, Severity
from tests.languages.jsonld.samples import document, hinged_door, table, two_leaves
from tests.languages.plans import layer, two_rooms


@pytest.fixture(scope="module")
def building(campaigns):
    return load_floorplan(campaigns / "ortega2024" / "building_c.fpm")


def saved(folder, nodes):
    file = folder / "door.jsonld"
    file.write_text(json.dumps(document(nodes), indent=1))
    return file


def written_and_read(folder, plan, layers):
    """Return plan and layers as they come back from a folder in which nothing is wrong."""
    scene = folder / "scene.json"
    scene.write_text(json.dumps(scene_document(plan, layers)))
    assert [d for d in check_jsonld(folder) if d.severity is Severity.ERROR] == []
    back = []
    for each in layers:
        file = folder / f"{each.name}.jsonld"
        file.write_text(json.dumps(scenery_document(each, plan, layers)))
        back.append(load_scenery_jsonld(file))
    return load_floorplan_jsonld(scene), back


def composed(plan, layers):
    """Return a plan and its layers as one rdflib graph."""
    text = json.dumps(scene_document(plan, layers))
    return graph_of(expand_text(text, "scene.jsonld"))


def test_a_published_door_stands_where_the_reference_puts_it(building, tmp_path):
    door = load_scenery_jsonld(saved(tmp_path, hinged_door()))
    scene = compile_scene(building, [door])
    (placed,) = scene.objects
    assert (placed.pose.x, placed.pose.y, placed.pose.yaw) == pytest.approx(
        (-6.456217554968386, 18.71830066760646, 2.530727415391777), abs=1e-9
    )
    assert placed.initial == (0.6,)
    assert [link.mass for link in placed.links] == [100.0, 20.0]
    assert placed.links[1].polygons[0][2] == (0.02, 0.93)
    assert (placed.links[1].z_min, placed.links[1].z_max) == (0.01, 2.01)
    assert placed.joints[0].anchor == (0.0, 0.03)
    assert (placed.joints[0].lower, placed.joints[0].upper) == (0.0, 1.9)


def test_two_leaves_slide_apart(tmp_path):
    (lift,) = load_scenery_jsonld(saved(tmp_path, two_leaves())).models
    left, right = lift.joints
    assert (left.parent, left.child, left.axis) == ("rail", "left", (1.0, 0.0))
    assert (left.lower, left.upper, right.lower, right.upper) == (-1.0, 0.0, 0.0, 1.0)
    panel = next(link for link in lift.links if link.name == "right")
    assert panel.polygons[0] == ((0.0, -0.025), (1.0, -0.025), (1.0, 0.025), (0.0, 0.025))
    assert (panel.z_min, panel.z_max) == pytest.approx((0.035, 1.975))


def test_a_table_has_no_moving_joint(tmp_path):
    (model,) = load_scenery_jsonld(saved(tmp_path, table())).models
    assert model.joints == ()
    assert [link.name for link in model.links] == ["top", "leg"]
    assert model.links[1].polygons[0][0] == (0.34, 0.74)


def without(nodes, id):
    assert any(node["@id"] == id for node in nodes)
    return [node for node in nodes if node["@id"] != id]


def changed(nodes, id, **other):
    assert any(node["@id"] == id for node in nodes)
    return [node | other if node["@id"] == id else node for node in nodes]


LEAF_TYPES = ["JointReference", "JointPosition", "Quantity", "JointLowerLimit"]


def test_values_without_the_type_quantity_are_read_with_a_warning(tmp_path):
    nodes = hinged_door()
    for node in nodes:
        if "value" in node:
            node["@type"].remove("Quantity")
    file = saved(tmp_path, nodes)
    warnings = []
    (joint,) = load_scenery_jsonld(file, warnings).models[0].joints
    assert (joint.lower, joint.upper) == (0.0, 1.9)
    for found in (warnings, check_jsonld(file)):
        warned = [d for d in found if '"Quantity"' in d.message]
        assert [d.severity for d in warned] == [Severity.WARNING]


def test_states_typed_as_limits_are_not_limits(tmp_path):
    nodes = changed(hinged_door(), "door:ajar-angle", **{"@type": LEAF_TYPES})
    file = saved(tmp_path, nodes)
    (joint,) = load_scenery_jsonld(file).models[0].joints
    assert joint.lower == 0.0
    assert any("typed JointLowerLimit" in d.message for d in check_jsonld(file))


def test_poses_are_read_against_their_direction(building, tmp_path):
    nodes = without(without(hinged_door(), "door:here-placed"), "door:here-placed-numbers")
    wall = "fpm:left_long_corridor-wall-1-frame"
    # The wall seen from the door, the inverse of (20.5, 0.1, -90 deg).
    nodes += [
        {"@id": "door:back", "@type": "Pose", "of": wall, "with-respect-to": "door:here"},
        {
            "@id": "door:back-numbers",
            "@type": ["PoseReference", "PoseCoordinate", "VectorXYZ"],
            "of-pose": "door:back",
            "as-seen-by": "door:here",
            "unit": ["M", "RAD"],
            "alpha": math.pi / 2,
            "x": 0.1,
            "y": -20.5,
            "z": 0,
        },
    ]
    scene = compile_scene(building, [load_scenery_jsonld(saved(tmp_path, nodes))])
    assert scene.objects[0].pose.x == pytest.approx(-6.456217554968386, abs=1e-9)
    assert scene.objects[0].pose.yaw == pytest.approx(2.530727415391777, abs=1e-9)


CAMPAIGNS = {
    "demo": ("flat", "doors", "doors_open", "doors_moving", "doors_in_your_face"),
    "ortega2024": ("building_c", "doors", "doors_random", "doors_open", "close_on_approach"),
}


@pytest.mark.parametrize("folder", CAMPAIGNS)
def test_campaigns_come_back(campaigns, tmp_path, folder):
    name, *names = CAMPAIGNS[folder]
    plan = load_floorplan(campaigns / folder / f"{name}.fpm")
    layers = [load_scenery(campaigns / folder / f"{n}.scenery") for n in names]
    back_plan, back = written_and_read(tmp_path, plan, layers)
    assert [one.name for one in back] == names
    there, here = compile_scene(back_plan, back), compile_scene(plan, layers)
    assert there.digest == here.digest
    assert behaviours(there, back) == behaviours(here, layers)


def behaviours(scene, layers):
    seed = np.random.SeedSequence(3)
    return resolve_behaviours(scene, layers, seed=seed, limit=600.0).behaviours


def test_a_layer_comes_back_from_a_file(campaigns, tmp_path):
    plan = load_floorplan(campaigns / "demo" / "flat.fpm")
    doors = load_scenery(campaigns / "demo" / "doors.scenery")
    mood = load_scenery(campaigns / "demo" / "doors_in_your_face.scenery")
    back = []
    for each in (doors, mood):
        file = tmp_path / f"{each.name}.jsonld"
        file.write_text(json.dumps(scenery_document(each, plan, (doors, mood))))
        back.append(load_scenery_jsonld(file))
    assert dataclasses.replace(back[1], file=mood.file) == mood
    assert back[0].instances == doors.instances
    assert compile_scene(plan, back).digest == compile_scene(plan, [doors, mood]).digest


LIVELY = """
mover person
    link body circle radius 20 cm from 0 m to 1.7 m, mass 70 kg
    link bag box 0.2 m x 0.1 m at (0.3 m, 0 m) from 0.2 m to 0.6 m, mass 3 kg
    joint hold fixed from body to bag
object table
    link top box 1.2 m x 80 cm turned 20 deg from 70 cm to 74 cm, mass 20 kg
    link foot circle radius 20 cm and polygon (0 m, 0 m), (1 m, 0 m), (0 m, 1 m)
        from 0 m to 70 cm, mass 10 kg
    joint glue fixed from top to foot
anna is a person in hall, x 1 m, y 1 m
bert is a person in hall, x -1 m
table_1 is a table in kitchen, x 0.2 m
table_2 is a table at kitchen.pillar, y 1 m, frozen
door is a hinged_door at hall.walls[1], x 0.2 m, starts at 10 deg
way is a hinged_door in kitchen_doorway, hinge left, opening inwards, recessed 2 cm
trap is a hinged_door at hall.walls[2], x -0.5 m
hatch is a slider at hall, x 3 m
group doors: every hinged_door except door, trap
parameter near = 1.5 m
door goes from closed to open when leg 2 begins, after 2 s
trap goes from open to closed when the robot is within near of its foot,
    starting at closed, by spring of 2 N m/rad
all doors toggle between closed and open after uniform 10 s to 40 s, from 1 min
hatch moves to closed at 9 s, to open at 8 s, as listed, by jump
anna walks along (1 m, 0 m), (3 m, 0 m) of hall, at 0.8 m/s, back and forth, pausing 2 s
bert walks along (0 m, 0 m) of hall, (0.5 m, 1 m) of kitchen, when anna starts to move, after 3 s
"""


def test_everything_scenery_can_say_comes_back(tmp_path):
    plan, lively = two_rooms(), layer(LIVELY)
    back_plan, (back,) = written_and_read(tmp_path, plan, [lively])
    for said in ("name", "instances", "groups", "parameters", "settings", "sentences"):
        assert getattr(back, said) == getattr(lively, said), said
    assert [model.joints for model in back.models] == [model.joints for model in lively.models]
    there, here = compile_scene(back_plan, [back]), compile_scene(plan, [lively])
    assert there.digest == here.digest
    assert behaviours(there, [back]) == behaviours(here, [lively])


MODELS, _, SAID = LIVELY.partition("\nanna")
SENTENCES = re.split(r"\n(?! )", f"anna{SAID}".strip())
SPACES = st.sampled_from([" ", "\n", "  \n\t", " // 2 m (\n "])


@given(st.lists(st.sampled_from(SENTENCES), unique=True), SPACES, st.sampled_from(["2 m", "90 cm"]))
def test_a_layer_comes_back_however_its_sentences_are_written(sentences, space, near):
    said = ["door is a hinged_door at hall", "parameter near = 1 m", *sentences]
    unique = {re.split(" is a | = ", sentence)[0]: sentence for sentence in said}
    text = "\n".join(unique.values()).replace(", ", f",{space}")
    lively = configure(layer(f"{MODELS}\n{text}"), {"near": near})
    back = read_back(lively)
    for part in ("name", "instances", "groups", "parameters", "settings", "sentences"):
        assert getattr(back, part) == getattr(lively, part), part


def read_back(one):
    """Return a layer that was written as JSON-LD and read from it."""
    text = json.dumps(scenery_document(one, two_rooms()))
    return read_layers(expand_text(text, "layer.jsonld"), "objects")[0]


def test_what_is_wrong_with_a_sentence_is_said_at_its_line(tmp_path):
    data = scenery_document(layer("way is a hinged_door at hall\nway stays open\n"), two_rooms())
    text = json.dumps(data, indent=0)
    file = tmp_path / "door.jsonld"
    file.write_text(text.replace("way stays open", "way stands open"))
    (found,) = check_jsonld(file)
    assert 'found "stands"' in found.message
    lines = file.read_text().splitlines()
    assert "item:layer.objects.4" in "".join(lines[found.where.line - 1 :][:2])


def test_a_door_that_hangs_the_other_way_is_published_as_its_mirror_image():
    plan = two_rooms()
    doors = layer("way is a hinged_door in kitchen_doorway, hinge left, opening inwards\n")
    graph = composed(plan, [doors])
    rows = graph.query(
        "SELECT ?x ?yaw ?image WHERE { item:way obj:frame ?f ; obj:of-object ?image . "
        "?p geom-rel:of ?f . ?c geom-coord:of-pose ?p ; geom-coord:x ?x ; geom-coord:alpha ?yaw }"
    )
    ((x, yaw, image),) = [tuple(map(str, row)) for row in rows]
    (placed,) = compile_scene(plan, [doors]).objects
    assert (float(x), float(yaw)) == pytest.approx((placed.pose.x, placed.pose.yaw), abs=1e-9)
    assert image.endswith(".mirrored") == placed.mirrored


def test_a_graph_tells_what_a_layer_says_about_a_door():
    text = "way is a hinged_door in kitchen_doorway, hinge left, opening inwards\n"
    mood = layer("every hinged_door stays open\n", "mood", models=False)
    graph = composed(two_rooms(), [layer(text), mood])
    rows = graph.query(
        "SELECT ?text WHERE { ?s scn:about item:way ; scn:in-layer item:layer.mood ;"
        " scn:text ?text }"
    )
    assert [str(text) for (text,) in rows] == ["every hinged_door stays open"]


@pytest.mark.parametrize(
    ("how", "room"),
    [
        ("hinge left, opening inwards", "hall"),
        ("hinge left, opening outwards", "kitchen"),
        ("hinge right, opening into kitchen", "kitchen"),
    ],
)
def test_a_graph_tells_which_room_a_door_opens_into(how, room):
    graph = composed(two_rooms(), [layer(f"way is a hinged_door in kitchen_doorway, {how}\n")])
    ((found,),) = graph.query("SELECT ?room WHERE { item:way scn:opens-into ?room }")
    assert found.endswith(f"/{room}")


SCENERY = document(hinged_door())
VALUES = st.sampled_from(
    [None, False, 0, -3.5, 1e300, "", "door:leaf", [], {}, [[1]], {"@id": "door:leaf"}, "M", ["x"],
     {"@value": []}, {"@list": ["door:leaf"]}, "_:b", {"@type": 3}]
)  # fmt: skip


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.data())
def test_mutated_scenery_gives_diagnostics_and_nothing_else(tmp_path, data):
    mutated = json.loads(json.dumps(SCENERY))
    nodes = mutated["@graph"]
    for _ in range(data.draw(st.integers(1, 3))):
        victim = nodes[data.draw(st.integers(0, len(nodes) - 1))]
        key = data.draw(st.sampled_from(sorted(victim) or ["x"]))
        if data.draw(st.booleans()):
            victim[key] = data.draw(VALUES)
        else:
            victim.pop(key, None)
    (tmp_path / "door.json").write_text(json.dumps(mutated))
    try:
        load_scenery_jsonld(tmp_path / "door.json")
    except InputError as error:
        assert error.findings
