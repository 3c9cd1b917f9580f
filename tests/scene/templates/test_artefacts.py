"""Exports of a world: every kind, launch files, layouts, provenance, pictures, names."""

import hashlib
import json
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import pytest
import yaml
from PIL import Image
from rdflib import Graph, Namespace
from rdflib.namespace import DCTERMS, PROV, RDF

from daemon.trace import TOPICS
from grammars.floorplan import load_floorplan
from grammars.model.behaviour import Jump, LegBegins, Reaction, Walk
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import InputError
from grammars.text.plugins import install_command
from templates.artefacts import KINDS, export
from templates.mesh import wall_mesh
from templates.naming import file_name
from templates.picture import PNG_SCALE
from templates.rendering import BUILT_IN, number
from templates.world import BehaviourDraw, ExportSettings, named_states
from tests.languages.plans import layer, two_rooms
from tests.scene.templates.worlds import mission, robot, scene, walker, world

SCHEMA = Namespace("https://schema.org/")
PANELS = Path(__file__).with_name("foxglove_panels.schema.json")
HOSTILE = '<b onload="x">&\u0007 ../../etc/..'


def digests(folder):
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_all_is_every_single_one(tmp_path, campaigns):
    plan = load_floorplan(campaigns / "demo" / "flat.fpm")
    whole = world(plan=plan)
    done = export(whole, ["all"], tmp_path / "all")
    assert list(done.files) == list(KINDS)
    assert {path for path in (tmp_path / "all").rglob("*") if path.is_file()} == set(done.paths)
    for kind in KINDS:
        export(whole, [kind], tmp_path / "single")
    single, together = digests(tmp_path / "single"), digests(tmp_path / "all")
    # Provenance lists the files of one export.
    assert single.pop("errand.prov.ttl") != together.pop("errand.prov.ttl")
    assert single == together


def test_kinds_are_refused_or_left_out_where_they_do_not_fit(tmp_path):
    with pytest.raises(InputError, match="jsonld cannot be made of errand"):
        export(world(), ["map", "jsonld"], tmp_path)
    with pytest.raises(InputError, match="keyframes cannot be made"):
        export(world(mission=None), ["keyframes"], tmp_path)
    with pytest.raises(InputError, match='did you mean "picture"'):
        export(world(), ["pictures"], tmp_path)
    assert "jsonld" not in export(world(), ["all"], tmp_path).files


def test_maps_show_the_doors_in_every_state(tmp_path):
    states = (("open", (("entrance.hinge", 1.9),)), ("shut", (("entrance.hinge", 0.0),)))
    export(world(states=states), ["map"], tmp_path)
    images = {p.stem: p.read_bytes() for p in (tmp_path / "maps").glob("*.pgm")}
    assert set(images) == {"rooms", "rooms-start", "rooms-open", "rooms-shut"}
    assert len(set(images.values())) == 4
    for path in (tmp_path / "maps").glob("*.yaml"):
        assert yaml.safe_load(path.read_text())["image"] == f"{path.stem}.pgm"


def test_launch_files_point_at_files_that_are_there(tmp_path):
    export(world(), ["all"], tmp_path)
    for name, marker in (("errand.launch", "$(arg root)/"), ("errand.launch.xml", "$(var root)/")):
        root = ElementTree.parse(tmp_path / "launch" / name).getroot()
        arguments = {arg.get("name"): arg.get("default") for arg in root.findall("arg")}
        named = [arguments["world"], arguments["map"]]
        named += [e.get("file") for e in root.findall("rosparam") if e.get("file")]
        for path in named:
            assert path.startswith(marker)
            assert (tmp_path / path.removeprefix(marker)).is_file()


def panels_of(folder, name="errand.foxglove.json"):
    return json.loads((folder / name).read_text())


def valid(value, schema, definitions=None):
    """Check a value without checking the schema itself each time, which takes seconds."""
    return jsonschema.Draft202012Validator(schema | {"$defs": definitions or {}}).is_valid(value)


def test_the_layout_says_what_the_viewer_knows_of(tmp_path):
    """Against the panels its makers publish: a name they do not know is dropped without a word."""
    published = json.loads(PANELS.read_text())
    kinds = {topic.name: topic.kind for topic in TOPICS}
    front, rear = (replace(robot().laser, name=name) for name in ("front", "rear"))
    both = replace(robot(), laser=front, other_lasers=(rear,))
    for shown, driven, joints, scans in (
        (scene(), robot(), 4, ["/scan"]),
        (replace(scene(), objects=()), both, 0, ["/scan_front", "/scan_rear"]),
    ):
        export(world(scene=shown, robot=driven), ["foxglove"], tmp_path)
        layout = panels_of(tmp_path)
        assert layout.keys() == {
            "configById", "globalVariables", "userNodes", "playbackConfig", "layout",
        }  # fmt: skip
        panels = layout["configById"]
        assert [name for name in panels["3D!top"]["topics"] if "scan" in name] == scans
        plotted = [path["value"] for panel in panels.values() for path in panel.get("paths", ())]
        assert {value.split(".")[0] for value in plotted} <= kinds.keys()
        assert sum(value.startswith("/joint_states") for value in plotted) == joints
        assert panels["RosOut!events"]["topicToRender"] in kinds
        for name, config in panels.items():
            # The title is every panel's, and not of its configuration.
            config.pop("foxglovePanelTitle", None)
            kind = published["panels"][name.partition("!")[0]]
            assert valid(config, kind, published["$defs"]), name
            for topic, settings in config.get("topics", {}).items():
                drawn = published["topics"][kinds.get(topic, kinds["/scan"])]
                assert valid(settings, drawn, published["$defs"]), topic
        assert sorted(leaves(layout["layout"])) == sorted(panels)


def leaves(node):
    """Return the panels of a split; a split is along a row or a column."""
    if isinstance(node, str):
        return [node]
    assert node.keys() <= {"direction", "splitPercentage", "first", "second"}
    assert node["direction"] in ("row", "column")
    assert 1 <= node.get("splitPercentage", 50) <= 99
    return leaves(node["first"]) + leaves(node["second"])


def test_provenance_is_prov_o_with_the_hash_of_every_file(tmp_path):
    # Sources of the same name are told apart.
    sources = [tmp_path / folder / "cart.yaml" for folder in ("robots", "suts")]
    for file in sources:
        file.parent.mkdir()
        file.write_text(file.parent.name)
    out = tmp_path / "out"
    settings = ExportSettings(timestamp="2026-01-31T12:00:00")
    done = export(world(sources=tuple(sources)), ["all"], out, settings=settings)
    graph = Graph().parse(out / "errand.prov.ttl")
    made = [path for kind, paths in done.files.items() if kind != "prov" for path in paths]
    hashes = {str(h) for h in graph.objects(None, SCHEMA.sha256)}
    for path in (*made, *sources):
        assert hashlib.sha256(path.read_bytes()).hexdigest() in hashes, path
    outputs = set(graph.subjects(PROV.wasGeneratedBy))
    assert len(outputs) == len(made)
    derived = {str(source) for source in graph.objects(None, PROV.wasDerivedFrom)}
    assert sum(source.endswith("cart.yaml") for source in derived) == 2
    for output in outputs:
        activity = graph.value(output, PROV.wasGeneratedBy)
        assert (activity, RDF.type, PROV.Activity) in graph
        assert graph.value(output, PROV.generatedAtTime)
        for agent in graph.objects(activity, PROV.wasAssociatedWith):
            assert (agent, RDF.type, PROV.SoftwareAgent) in graph
    parameters = {
        str(graph.value(node, DCTERMS.title)): value.toPython()
        for node, value in graph.subject_objects(PROV.value)
    }
    assert parameters["distance"] == 0.7
    assert parameters["laser_height"] == 0.25
    assert parameters["closed"] is False
    assert str(tmp_path) not in (out / "errand.prov.ttl").read_text()


def test_a_picture_is_painted_in_its_size_and_colours(tmp_path):
    export(world(), ["picture"], tmp_path)
    root = ElementTree.parse(tmp_path / "errand.svg").getroot()
    with Image.open(tmp_path / "errand.png") as image:
        box = [float(v) for v in root.get("viewBox").split()]
        assert image.size == pytest.approx((PNG_SCALE * box[2], PNG_SCALE * box[3]), abs=1)
        shown = {colour for _, colour in image.convert("RGB").getcolors(1 << 24)}
    wall, door, route, cart = (59, 64, 72), (200, 85, 61), (34, 99, 143), (47, 158, 110)
    assert {wall, door, route, cart} <= shown


def test_what_takes_a_library_that_is_missing_is_left_out_of_all_and_said(tmp_path, monkeypatch):
    wall_mesh.cache_clear()
    monkeypatch.setitem(sys.modules, "manifold3d", None)
    found = export(world(), ["all"], tmp_path)
    assert "mesh" not in found.files
    assert any(install_command("cad") in note for note in found.notes)
    with pytest.raises(InputError, match="a mesh needs the library manifold3d"):
        export(world(), ["mesh"], tmp_path)


def test_what_gazebo_lacks_of_movers_and_events_is_said(tmp_path):
    crowd = replace(scene(), objects=(*scene().objects, walker()))
    acts = (
        Walk("walker", ((1.0, 0.3), (1.8, 0.3), (1.8, 1.7)), speed=1.0),
        Reaction("entrance.hinge", 0.9, 0.0, LegBegins(2), Jump()),
    )
    crowded = world("errand", BehaviourDraw("", acts), scene=crowd)
    done = export(crowded, ["sdf", "keyframes"], tmp_path)
    assert "walker: no plugin walks, it stays at its start" in done.notes
    assert "entrance.hinge: no plugin waits for events, it stays at its start" in done.notes
    frames = json.loads((tmp_path / "keyframes/entrance.json").read_text())["keyframes"]
    assert frames == [{"position": 0.9, "time": 0.0}]


def test_hostile_names_stay_text_and_inside_the_folder(tmp_path):
    named = replace(scene(), name=HOSTILE)
    evil = world(HOSTILE, scene=named, mission=mission(HOSTILE))
    done = export(evil, ["all"], tmp_path / "out")
    for path in done.paths:
        assert path.resolve().is_relative_to((tmp_path / "out").resolve())
        if path.suffix in (".sdf", ".world", ".svg", ".launch", ".xml", ".config"):
            ElementTree.parse(path)
    svg = next(path for path in done.paths if path.suffix == ".svg").read_text()
    assert "<b onload" not in svg
    task = next((tmp_path / "out/tasks/mission").iterdir())
    assert yaml.safe_load(task.read_text())["task"][0]["name"] == HOSTILE


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../x", "a/b", "a\\b", ".hidden", "x" * 300, "ß", "a b", "a\0b"]
)
def test_unsafe_names_become_safe_and_stay_different(name):
    safe = file_name(name)
    assert safe == Path(safe).name
    assert len(safe) <= 100
    assert not safe.startswith(".")
    assert safe != file_name(name + "-")
    assert file_name("hall_2.a-b") == "hall_2.a-b"


def test_the_manual_names_every_kind():
    manual = (BUILT_IN.parents[1] / "docs" / "artefacts.md").read_text()
    assert all(f"| `{kind}` |" in manual for kind in KINDS)


@pytest.mark.parametrize(
    ("value", "text"),
    [(-0.0, "0"), (-1e-12, "0"), (1e20, "1" + "0" * 20), (0.1 + 0.2, "0.3"), (100.0, "100")],
)
def test_numbers_are_plain(value, text):
    assert number(value) == text
    with pytest.raises(ValueError, match="cannot contain the number"):
        number(float("nan"))


def test_heights_and_resolutions_come_from_the_robot_and_the_campaign(tmp_path):
    for settings, resolution, height in (
        (ExportSettings(), 0.1, f"{robot().laser.z:g}"),
        (ExportSettings(laser_height=1.0, resolution=0.2), 0.2, "1"),
    ):
        export(world(resolution=0.1), ["map"], tmp_path, settings=settings)
        text = (tmp_path / "maps/rooms.yaml").read_text()
        assert f"resolution: {resolution}\n" in text
        assert f"laser at {height} m" in text


THINGS = """
a is a hinged_door at kitchen_doorway, x -0.475 m, y 0.2 m, turned -90 deg
b is a hinged_door in way_out, hinge left, opening inwards
c is a slider at hall
"""


def test_a_state_holds_for_all_that_have_it_and_mirrored_doors_turn_the_other_way():
    things = layer(THINGS)
    made = compile_scene(two_rooms(), [things])
    assert [thing.mirrored for thing in made.objects] == [False, True, False]
    states = {name: dict(positions) for name, positions in named_states(made, [things])}
    assert states["open"] == {"a.hinge": 1.7, "b.hinge": -1.7, "c.rail": 1.0}
    assert states["closed"] == {"a.hinge": 0.0, "b.hinge": 0.0, "c.rail": 0.0}


def test_things_without_a_model_have_no_states():
    assert named_states(scene(), []) == ()
    assert named_states(scene(), [layer(THINGS)]) == ()
