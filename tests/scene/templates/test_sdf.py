import os
import shutil
import subprocess
from xml.etree import ElementTree

import pytest

from grammars.model.behaviour import Hold, Jump, KeyFrame, KeyFrames, Servo, Trigger
from templates.sdf import models_of, write_keyframes, write_sdf
from templates.world import BehaviourDraw
from tests.scene.templates.worlds import BEHAVIOURS, OTHERS, job, scene

Element = ElementTree.Element


def exported(folder, *draws):
    """Write a world and return every XML file in it, by its path."""
    paths = write_sdf(job(folder, "errand", *draws))
    return {
        path.relative_to(folder / "gazebo").as_posix(): ElementTree.parse(path).getroot()
        for path in paths
        if path.suffix != ".stl"
    }


def include(world, name):
    return next(i for i in world.iter("include") if i.findtext("name") == name)


def tags(plugin):
    return {child.tag: child.text for child in plugin}


def test_equal_objects_share_a_model_and_others_do_not():
    names = {thing: model for thing, (model, _) in models_of(scene(), set()).items()}
    assert names["entrance"] == names["other"] == "door"
    assert names["stuck"] == "door_static"
    assert len(set(names.values())) == 4
    taken = models_of(scene(), {"door"})
    assert taken["entrance"][0] == "door_2"


def test_models_say_what_the_scene_says(tmp_path):
    files = exported(tmp_path)
    model = files["models/door/model.sdf"].find("model")
    assert model is not None
    leaf = next(link for link in model.iter("link") if link.get("name") == "leaf")
    assert leaf.findtext("collision/geometry/box/size") == "0.04 0.92 1.97"
    assert leaf.findtext("inertial/mass") == "15"
    hinge = next(joint for joint in model.iter("joint") if joint.get("name") == "hinge")
    assert hinge.get("type") == "revolute"
    assert hinge.findtext("axis/xyz") == "0 0 1"
    assert hinge.findtext("axis/limit/upper") == "1.9"
    assert hinge.findtext("axis/dynamics/friction") == "1"
    assert hinge.findtext("axis/dynamics/spring_stiffness") == "2"
    cabinet = files["models/cabinet/model.sdf"]
    assert len(list(cabinet.iter("point"))) == 2 * 5
    assert cabinet.findtext("model/static") == "true"
    uri = files["models/rooms/model.sdf"].findtext(".//collision//uri")
    assert uri == "model://rooms/meshes/rooms.stl"
    assert (tmp_path / "gazebo/models/rooms/meshes/rooms.stl").is_file()


def test_objects_stand_where_the_scene_has_them(tmp_path):
    for file in ("worlds/errand.sdf", "worlds/errand.world"):
        world = exported(tmp_path)[file]
        pose = [float(v) for v in (include(world, "entrance").findtext("pose") or "").split()]
        assert pose == pytest.approx([2.1, 0.5, 0, 0, 0, 0.5235987756], abs=1e-9)
        assert include(world, "stuck").findtext("static") == "true"


def test_classic_worlds_use_the_plugins_of_2024(tmp_path):
    world = exported(tmp_path)["worlds/errand.world"]
    start, trigger = include(world, "entrance").iter("plugin")
    assert tags(start) == {"joint": "hinge", "uri": "keyframes/era/entrance.json"}
    assert trigger.get("filename") == "libadversarial_joint_plugin.so"
    assert tags(trigger) == {"joint": "hinge", "x": "1.4", "near": "1.3", "y": "0"}
    (timed,) = include(world, "slider").iter("plugin")
    assert timed.get("filename") == "libdynamic_joint_plugin.so"
    assert tags(timed) == {"joint": "rail", "uri": "keyframes/era/slider.json"}
    held = exported(tmp_path, BehaviourDraw("", OTHERS))["worlds/errand.world"]
    (initial,) = include(held, "entrance").iter("plugin")
    assert initial.get("filename") == "libinitial_plugin.so"
    assert tags(initial) == {"joint": "hinge", "position": "1.7"}


def test_worlds_for_gz_sim_use_the_present_plugins(tmp_path):
    world = exported(tmp_path)["worlds/errand.sdf"]
    plugins = {p.get("name"): p for p in include(world, "entrance").iter("plugin")}
    assert tags(plugins["gz::DistanceTriggeredJointStateChangePlugin"]) == {
        "joint": "hinge",
        "start_joint_angle": "1.4",
        "trigger_dist": "1.3",
        "end_joint_angle": "0",
        "target": "cart",
    }
    assert tags(plugins["gz::TimedJointStateChangePlugin"]) == {
        "joint": "hinge",
        "uri": "file://keyframes/entrance.json",
    }
    controller = tags(plugins["gz::sim::systems::JointPositionController"])
    assert controller["joint_name"] == "hinge"
    assert controller["initial_position"] == "1.4"
    assert controller["p_gain"] == "0.5"
    assert float(controller["cmd_min"] or 0) < 0 < float(controller["cmd_max"] or 0)
    timed = {p.get("name"): p for p in include(world, "slider").iter("plugin")}
    uri = tags(timed["gz::TimedJointStateChangePlugin"])["uri"]
    assert uri == "file://keyframes/slider.json"
    held = exported(tmp_path, BehaviourDraw("", OTHERS))["worlds/errand.sdf"]
    names = {p.get("name"): p for p in include(held, "entrance").iter("plugin")}
    assert tags(names["gz::InitialJointStatePlugin"]) == {"joint": "hinge", "position": "1.7"}
    assert "gz::TimedJointStateChangePlugin" in names


def test_a_free_door_starts_where_the_scene_has_it(tmp_path):
    world = exported(tmp_path)["worlds/errand.sdf"]
    names = [p.get("name") for p in include(world, "other").iter("plugin")]
    assert "gz::TimedJointStateChangePlugin" in names
    write_keyframes(job(tmp_path))
    assert '{"position": 0.3, "time": 0.0}' in (tmp_path / "keyframes/other.json").read_text()


def test_every_draw_of_behaviours_has_its_world_and_files(tmp_path):
    draws = (BehaviourDraw("repeat-0", BEHAVIOURS), BehaviourDraw("repeat-3", OTHERS))
    files = exported(tmp_path, *draws)
    assert {f for f in files if f.startswith("worlds/")} == {
        "worlds/errand-repeat-0.sdf", "worlds/errand-repeat-0.world",
        "worlds/errand-repeat-3.sdf", "worlds/errand-repeat-3.world",
    }  # fmt: skip
    write_keyframes(job(tmp_path, "errand", *draws))
    for file, root in files.items():
        for uri in root.iter("uri"):
            text = (uri.text or "").removeprefix("file://")
            if text.startswith("keyframes/"):
                assert (tmp_path / text).is_file(), (file, text)


def test_what_the_plugins_cannot_do_is_said(tmp_path):
    acts = (
        Trigger("entrance.hinge", 1.0, 0.0, 1.0, Servo(), of="leaf", to="footprint", rearm=2.0),
        KeyFrames("slider.rail", (KeyFrame(1.0, 1.0),), Servo()),
    )
    work = job(tmp_path, "errand", BehaviourDraw("", acts))
    write_sdf(work)
    said = "\n".join(work.notes)
    for words in ("not from the leaf to its footprint", "does not rearm", "knows no servo"):
        assert words in said
    faithful = job(tmp_path, "errand", BehaviourDraw("", BEHAVIOURS))
    write_sdf(faithful)
    assert faithful.notes == []


def test_names_of_the_simulator_are_left_alone(tmp_path):
    import dataclasses

    things = tuple(
        dataclasses.replace(thing, name=name)
        for thing, name in zip(
            scene().objects, ("ground_plane", "rooms", "a", "b", "c"), strict=True
        )
    )
    crowded = dataclasses.replace(scene(), objects=things)
    acts = (Hold("ground_plane.hinge", 0.0), KeyFrames("b.rail", (), Jump()))
    paths = write_sdf(job(tmp_path, "w", BehaviourDraw("", acts), scene=crowded))
    world = ElementTree.parse(next(p for p in paths if p.suffix == ".world")).getroot()
    names = [i.findtext("name") for i in world.iter("include")]
    names += [m.get("name") for m in world.iter("model")]
    assert len(names) == len(set(names))


CHECKER = shutil.which("gz") or shutil.which("ign")


@pytest.mark.skipif(CHECKER is None, reason="no gz or ign to check SDF with (libsdformat)")
@pytest.mark.parametrize("ending", ["sdf", "world"])
def test_libsdformat_has_no_complaint(tmp_path, ending):
    draw = BehaviourDraw("", (*BEHAVIOURS, Hold("other.hinge", 0.3)))
    write_sdf(job(tmp_path, "errand", draw))
    world = tmp_path / "gazebo" / "worlds" / f"errand.{ending}"
    done = subprocess.run(
        [str(CHECKER), "sdf", "--check", str(world)],
        env=os.environ | {"SDF_PATH": str(tmp_path / "gazebo" / "models"), "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    said = done.stdout + done.stderr
    assert "Valid." in said, said
    assert "Warning" not in said, said
    assert "Error" not in said, said
    # Elements it does not know are only noted in its log.
    for log in tmp_path.rglob("sdformat.log"):
        assert "not defined in SDF" not in log.read_text()
