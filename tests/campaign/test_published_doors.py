"""Every scenario of the published experiment has the doors of its own published world."""

import json
import math
from xml.etree import ElementTree

import pytest

from daemon.campaign import load_campaign
from grammars.model.behaviour import (
    Hold,
    Jump,
    KeyFrame,
    KeyFrames,
    Spring,
    Trigger,
)

WORLDS = {
    "S1": "brsu_building_c_static",
    "S2": "brsu_building_c_dynamic",
    **{f"S3.{k}": "brsu_building_c_adversarial_events" for k in (1, 2, 3, 4)},
    **{f"S3.{k}": "brsu_building_c_no_events" for k in (5, 6)},
}

SPRING = Spring(0.5, 0.0)
"""What the controller of the trigger plugin amounts to."""


@pytest.fixture(scope="module")
def published(campaigns):
    return load_campaign(campaigns / "ortega2024" / "campaign.yaml")


def cell(campaign, name):
    return next(c for c in campaign.cells if c.name == name)


def told(campaign, name):
    """What the doors of a scenario do, by name; the same in every repeat."""
    (behaviours,) = set(cell(campaign, name).behaviours)
    return {b.joint.removesuffix(".hinge"): b for b in behaviours if b.kind != "walk"}


def included(world):
    """The doors of a world file by the name they have here."""
    parts = ElementTree.parse(world).getroot().iter("include")
    names = {part.findtext("name") or "": part for part in parts}
    prefix = "door-instance-"
    return {
        f"door_{name.removeprefix(prefix)}": part
        for name, part in names.items()
        if name.startswith(prefix)
    }


def number(plugin, tag):
    return float(plugin.findtext(tag) or "nan")


def played(plugin, name, keyframes):
    """What a plugin of a world makes of a door, in our words."""
    joint, library = f"{name}.hinge", plugin.get("filename")
    assert plugin.findtext("joint") == "door:joint-door-hinge"
    if library == "libinitial_plugin.so":
        return Hold(joint, number(plugin, "position"))
    if library == "libadversarial_joint_plugin.so" and plugin.find("x") is not None:
        start, end, near = (number(plugin, tag) for tag in ("x", "y", "near"))
        return Trigger(joint, start, end, near, SPRING, of="foot")
    if library == "libadversarial_joint_plugin.so":
        # Without settings it has zeros for them.
        return KeyFrames(joint, (KeyFrame(0.0, 0.0),), SPRING)
    assert library == "libdynamic_joint_plugin.so"
    file = keyframes / (plugin.findtext("uri") or "").rpartition("/")[2]
    frames = json.loads(file.read_text())["keyframes"]
    return KeyFrames(joint, tuple(KeyFrame(f["time"], f["pose"]) for f in frames), Jump())


@pytest.mark.parametrize("name", WORLDS)
def test_a_scenario_has_the_doors_of_its_published_world(published, reference_data, name):
    doors = included(reference_data / "worlds" / f"{WORLDS[name]}.world")
    things = cell(published, name).scene.objects
    objects = {thing.name: thing for thing in things if thing.joints}
    assert objects.keys() == doors.keys()
    behaviours = told(published, name)
    for door, part in doors.items():
        x, y, _, _, _, yaw = (float(v) for v in (part.findtext("pose") or "").split())
        pose = objects[door].pose
        assert (pose.x, pose.y) == pytest.approx((x, y), abs=1e-6)
        assert math.remainder(pose.yaw - yaw, math.tau) == pytest.approx(0.0, abs=1e-6)
        plugins = part.findall("plugin")
        shut = objects[door].frozen or behaviours.get(door) == Hold(f"{door}.hinge", 0.0)
        assert shut == (part.findtext("static") == "true")
        if plugins:
            (plugin,) = plugins
            assert behaviours[door] == played(plugin, door, reference_data / "keyframes")
        elif not shut:
            assert door not in behaviours


def test_only_two_doors_tell_an_adversarial_scenario_from_its_static_sibling(published):
    for adversarial, static in (("S3.2", "S3.5"), ("S3.4", "S3.6")):
        with_, without = told(published, adversarial), told(published, static)
        assert {door for door in with_ if with_[door] != without[door]} == {"door_12", "door_17"}


def test_key_frames_are_those_of_the_publication_in_their_order(published):
    doors = told(published, "S2")
    frames = {name: b.frames for name, b in doors.items() if isinstance(b, KeyFrames)}
    assert [name for name in frames if len(frames[name]) > 1] == [f"door_{n}" for n in range(1, 11)]
    assert {f[0] for name, f in frames.items() if name != "door_11"} == {KeyFrame(10.0, 0.0)}
    assert frames["door_2"][:3] == (KeyFrame(10.0, 0.0), KeyFrame(7.0, 1.0), KeyFrame(98.0, 1.7))
    assert [len(frames[f"door_{n}"]) for n in range(1, 12)] == [
        14, 13, 16, 9, 8, 15, 19, 14, 16, 14, 1
    ]  # fmt: skip


def test_the_swinging_variant_is_s3_4_with_other_leaves(published, campaigns):
    variant = load_campaign(campaigns / "ortega2024" / "swinging_doors.yaml")
    resting, swinging = cell(variant, "resting"), cell(variant, "swinging")
    original = cell(published, "S3.4")
    assert resting.scene.digest == swinging.scene.digest == original.scene.digest
    assert resting.mission == swinging.mission == original.mission
    assert told(variant, "resting") == told(published, "S3.4")
    for door, behaviour in told(variant, "swinging").items():
        if door in ("door_12", "door_17"):
            expected = Trigger(f"{door}.hinge", 1.4, 0.0, 1.3, SPRING, of="foot", begin=0.0)
            assert behaviour == expected
        else:
            assert behaviour == told(published, "S3.4")[door]
