"""The scenarios of Ortega et al. 2024: as they were published, and recomposed from layers."""

import json
import math
from xml.etree import ElementTree

import pytest
from shapely.geometry import Polygon

from campaigns.studies.published_worlds import fits
from daemon.campaign import load_campaign
from grammars.model.behaviour import Hold, Jump, KeyFrame, KeyFrames, Spring, Trigger
from grammars.model.kinematics import link_poses
from grammars.model.mission_files import load_mission

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


@pytest.fixture(scope="module")
def paper(campaigns):
    return load_campaign(campaigns / "ortega2024" / "paper.yaml")


def cell(campaign, name):
    return next(c for c in campaign.cells if c.name == name)


def behaviours_of(campaign, name):
    """Return the behaviours of the doors of a scenario by name, the same ones in all repeats."""
    (behaviours,) = set(cell(campaign, name).behaviours)
    return {b.joint.removesuffix(".hinge"): b for b in behaviours if b.kind != "walk"}


def included(world):
    """Return the doors of a world file by the name they have here."""
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
    """Return the behaviour that a plugin of a world gives a door."""
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
    behaviours = behaviours_of(published, name)
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


def test_only_two_doors_tell_an_adversarial_scenario_from_its_static_sibling(published, paper):
    for campaign in (published, paper):
        for adversarial, static in (("S3.2", "S3.5"), ("S3.4", "S3.6")):
            above, below = (behaviours_of(campaign, name) for name in (adversarial, static))
            changed = {door for door in above if above[door] != below[door]}
            assert changed == {"door_12", "door_17"}
            assert {above[door].kind for door in changed} == {"trigger"}


def test_key_frames_are_those_of_the_publication_in_their_order(published):
    doors = behaviours_of(published, "S2")
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
    assert behaviours_of(variant, "resting") == behaviours_of(published, "S3.4")
    for door, behaviour in behaviours_of(variant, "swinging").items():
        if door in ("door_12", "door_17"):
            expected = Trigger(f"{door}.hinge", 1.4, 0.0, 1.3, SPRING, of="foot", begin=0.0)
            assert behaviour == expected
        else:
            assert behaviour == behaviours_of(published, "S3.4")[door]


def leaf(door, angle):
    shape = next(link for link in door.links if link.name == "leaf")
    return Polygon(link_poses(door, [angle])["leaf"].apply_ring(shape.polygons[0]))


def test_shut_doors_of_scenario_1_stand_in_the_place_of_those_of_the_others(published):
    first, others = (cell(published, name).scene.objects for name in ("S1", "S3.1"))
    doors = [(a, b) for a, b in zip(first, others, strict=False) if a.joints]
    assert [a.name for a, _ in doors] == [b.name for _, b in doors]
    for one, other in doors:
        # They differ by the width of the post.
        assert leaf(one, 0.0).symmetric_difference(leaf(other, 0.0)).area < 0.01


def test_doors_fill_their_doorways_and_open_into_their_rooms(paper):
    scene = cell(paper, "S1").scene
    rooms = dict.fromkeys(range(1, 12), "left_long_corridor")
    rooms |= {12: "classroom_c069", 13: "classroom_c069"}
    rooms |= {
        14: "classroom_c022",
        15: "classroom_c022",
        16: "classroom_c025",
        17: "classroom_c025",
    }
    outlines = {region.name: Polygon(region.outline) for region in scene.regions}
    doorways = {doorway.name: Polygon(doorway.footprint) for doorway in scene.doorways}
    assert [door.name for door in scene.objects] == [f"door_{number}" for number in rooms]
    for door, room in zip(scene.objects, rooms.values(), strict=True):
        assert outlines[room].covers(leaf(door, 1.4).centroid)
        covered = doorways[door.doorway].intersection(leaf(door, 0.0))
        assert covered.area == pytest.approx(0.93 * 0.05, rel=1e-6)


def test_all_eight_scenarios_share_one_building_with_its_doors(paper):
    assert [c.name for c in paper.cells] == [
        "S1", "S2", "S3.1", "S3.2", "S3.3", "S3.4", "S3.5", "S3.6"
    ]  # fmt: skip
    assert len({c.scene.digest for c in paper.cells}) == 1
    for static, adversarial in (("S3.5", "S3.2"), ("S3.6", "S3.4")):
        below, above = cell(paper, static), cell(paper, adversarial)
        assert above.layers[:-1] == below.layers
        assert above.layers[-1].name == "close_on_approach"
        assert above.mission == below.mission


def test_doors_of_the_recomposed_scenarios_are_shut_random_or_open_but_two(paper):
    shut = {f"door_{n}": Hold(f"door_{n}.hinge", 0.0) for n in range(1, 18)}
    assert behaviours_of(paper, "S1") == shut
    # The doors of S2 move the same way in all five runs.
    random = behaviours_of(paper, "S2")
    moving = [b for b in random.values() if isinstance(b, KeyFrames)]
    assert [b.joint for b in moving] == [f"door_{n}.hinge" for n in range(1, 12)]
    assert len({b.frames for b in moving}) == 11
    for behaviour in moving:
        assert {f.position for f in behaviour.frames} == {0.0, 1.7}
        assert all(90.0 <= f.time <= 729.0 for f in behaviour.frames[1:])
    assert sum(isinstance(b, Hold) for b in random.values()) == 6
    expected = shut | {f"door_{n}": Hold(f"door_{n}.hinge", 1.4) for n in (13, 14, 16)}
    expected |= {f"door_{n}": Trigger(f"door_{n}.hinge", 1.4, 0.0, 1.3, SPRING) for n in (12, 17)}
    assert behaviours_of(paper, "S3.1") == expected


def test_waypoints_are_those_of_the_published_tasks(campaigns, reference_data):
    names = {"left_long_corridor_task": "corridor"} | {
        f"task_{k}": f"task_{k}" for k in (1, 2, 3, 4)
    }
    for published, ours in names.items():
        theirs = load_mission(reference_data / "missions" / f"{published}.yaml")[0].waypoints
        mine = load_mission(campaigns / "ortega2024" / f"{ours}.mission.yaml")[0].waypoints
        expected = [(w.x, w.y, w.yaw) for w in theirs]
        for waypoint, pose in zip(mine, expected, strict=True):
            assert (waypoint.x, waypoint.y, waypoint.yaw) == pytest.approx(pose, abs=5e-5)


def test_building_c_is_the_published_one_in_both_worlds(campaigns, reference_data):
    if not (reference_data / "worlds").is_dir():
        pytest.skip("the published meshes are not here")
    shares = {name: min(fit.shares) for name, fit in fits(reference_data, campaigns).items()}
    assert shares.keys() == {"S1", "S3.4"}
    assert min(shares.values()) >= 0.97
