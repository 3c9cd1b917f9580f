"""Worlds of Gazebo, key frames, tasks and launch files, and what the plugins cannot do."""

import json
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from grammars.model.behaviour import Hold, Jump, KeyFrame, KeyFrames, Servo, Spring, Trigger
from grammars.model.scene import Joint, Link
from templates.artefacts import export
from templates.sdf import behaviour_by_joint, models_of, write_keyframes, write_sdf
from templates.world import BehaviourDraw
from tests.scene.templates.worlds import BEHAVIOURS, OTHERS, box, hinged, job, scene, walker, world

TEXTS = (".sdf", ".world", ".config", ".launch", ".xml", ".json", ".yaml")
DRAWS = (BehaviourDraw("repeat-0", BEHAVIOURS), BehaviourDraw("repeat-3", OTHERS))


@pytest.mark.parametrize("kind", ["sdf", "keyframes", "tasks", "launch"])
def test_files_of_an_export(tmp_path, golden, kind):
    """Two draws of behaviours in two rooms with a door, an ajar one, a frozen one and a slider."""
    paths = export(world("errand", *DRAWS), [kind], tmp_path).paths
    texts = (path for path in sorted(paths) if path.suffix in TEXTS)
    shown = (f"=== {path.relative_to(tmp_path)}\n{path.read_text()}" for path in texts)
    golden(f"exports/{kind}.txt", "\n".join(shown))


def test_movers_and_fixed_joints_in_models(tmp_path, golden):
    """Somebody who walks stands without carriers, with a bag that swings; a handle is held."""
    door = hinged("handled", 2.1, 0.5)
    handle = Link("handle", (box(0.02, 0.8, 0.06, 0.9),), 0.5, 1.0, 1.1)
    grip = Joint("grip", "revolute", "leaf", "handle", (0.0, 0.8), (1.0, 0.0), 0.0, 0.0)
    parts = {"links": (*door.links, handle), "joints": (*door.joints, grip), "initial": (0.0, 0.0)}
    crowd = replace(scene(), objects=(replace(door, **parts), walker()))
    export(world("errand", BehaviourDraw("", ()), scene=crowd), ["sdf"], tmp_path)
    models = [tmp_path / "gazebo" / "models" / name / "model.sdf" for name in ("door", "walker")]
    golden("exports/crowd.txt", "\n".join(model.read_text() for model in models))


def test_equal_objects_share_a_model_and_others_do_not():
    names = [model for model, _ in models_of(scene(), {"door"}).values()]
    assert names == ["door_2", "door_2", "door_static", "sliding", "cabinet"]


def test_what_the_plugins_cannot_do_is_noted(tmp_path):
    acts = (
        Trigger("entrance.hinge", 1.0, 0.0, 1.0, Servo(), of="leaf", to="footprint", rearm=2.0),
        KeyFrames("slider.rail", (KeyFrame(1.0, 1.0),), Servo()),
    )
    work = job(tmp_path, "errand", BehaviourDraw("", acts))
    write_sdf(work)
    notes = "\n".join(work.notes)
    for words in ("not from the leaf to its footprint", "does not rearm", "has no servo"):
        assert words in notes
    faithful = job(tmp_path, "errand", BehaviourDraw("", BEHAVIOURS))
    write_sdf(faithful)
    assert faithful.notes == []


def test_names_of_the_simulator_are_left_alone(tmp_path):
    names = ("ground_plane", "rooms", "a", "b", "c")
    things = (replace(t, name=name) for t, name in zip(scene().objects, names, strict=True))
    acts = (Hold("ground_plane.hinge", 0.0), KeyFrames("b.rail", (), Jump()))
    crowded = replace(scene(), objects=tuple(things))
    paths = write_sdf(job(tmp_path, "w", BehaviourDraw("", acts), scene=crowded))
    root = ElementTree.parse(next(p for p in paths if p.suffix == ".world")).getroot()
    found = [i.findtext("name") for i in root.iter("include")]
    found += [m.get("name") for m in root.iter("model")]
    assert len(found) == len(set(found))


def frames(path):
    return json.loads(path.read_text())["keyframes"]


def test_frames_stay_as_they_are_listed():
    # The plugin takes them off the head of the list, whatever their times.
    act = KeyFrames("slider.rail", (KeyFrame(4.0, 1.0), KeyFrame(0.0, 0.5)), Jump())
    found = behaviour_by_joint(scene(), (act,))["slider.rail"]
    listed = [(f.time, f.position) for f in found.frames]
    assert listed == [(0.0, 0.25), (4.0, 1.0), (0.0, 0.5)]
    # A first frame at the start is kept.
    act = KeyFrames("slider.rail", (KeyFrame(0.0, 0.5), KeyFrame(4.0, 1.0)), Jump())
    assert behaviour_by_joint(scene(), (act,))["slider.rail"] == act


def test_a_trigger_begins_where_it_starts(tmp_path):
    acts = (Trigger("entrance.hinge", 1.4, 0.0, 1.3, Spring(0.5, 0.0), begin=0.7),)
    write_keyframes(job(tmp_path, "errand", BehaviourDraw("", acts)))
    assert frames(tmp_path / "keyframes/entrance.json") == [{"position": 0.7, "time": 0.0}]
    assert frames(tmp_path / "keyframes/era/entrance.json") == [{"pose": 0.7, "time": 0.0}]


def test_only_joints_that_can_move_do_something():
    found = behaviour_by_joint(scene(), (Hold("entrance.hinge", 1.0),))
    assert list(found) == ["entrance.hinge", "other.hinge", "slider.rail"]
