"""The scenarios of Ortega et al. 2024 and what was published of them, figure by figure."""

import json
import math
from pathlib import Path

import pytest

from campaigns.studies.published_worlds import fits
from daemon.campaign import load_campaign
from grammars.floorplan import load_floorplan
from grammars.model.behaviour import Hold, Jump, KeyFrame, KeyFrames, Spring, Trigger
from grammars.model.grid import OCCUPIED
from grammars.model.mission_files import load_mission
from grammars.scenery.composition import compile_scene
from templates.occupancy import occupancy_grid
from tests.reference.figures import occupied_of, plan_of, published_figures

FIGURES = json.loads(Path(__file__).with_name("figures.json").read_text("utf-8"))
WORLDS = {
    "S1": "brsu_building_c_static",
    "S2": "brsu_building_c_dynamic",
    **{f"S3.{k}": "brsu_building_c_adversarial_events" for k in (1, 2, 3, 4)},
    **{f"S3.{k}": "brsu_building_c_no_events" for k in (5, 6)},
}
SPRING = Spring(0.5, 0.0)
"""The controller of the trigger plug-in."""
SAME = (
    "stairway_room_",
    "left_",
    "right_short_connector",
    "study_nook_c069",
    "classroom_c069",
)
"""Spaces that neither a variable of building_c.fpm moves, nor the step from plan to worlds."""


@pytest.fixture(scope="module")
def folder(campaigns):
    return campaigns / "ortega2024"


@pytest.fixture(scope="module")
def campaign(folder):
    return load_campaign(folder / "campaign.yaml")


@pytest.fixture(scope="module")
def recomposed(folder):
    """The same scenarios, made of layers that none of them alters."""
    return load_campaign(folder / "paper.yaml")


def cell(campaign, name):
    return next(c for c in campaign.cells if c.name == name)


def doors_of(campaign, name):
    """The behaviours of a scenario's doors by name; they are the same in every repeat."""
    (behaviours,) = set(cell(campaign, name).behaviours)
    return {b.joint.removesuffix(".hinge"): b for b in behaviours if b.kind != "walk"}


def test_the_figures_are_those_of_the_published_files(reference_data, golden):
    figures = published_figures(reference_data)
    golden("figures.json", json.dumps(figures, separators=(",", ":")).replace("},", "},\n") + "\n")


@pytest.mark.parametrize("name", FIGURES["missions"])
def test_a_mission_has_the_published_waypoints(folder, name):
    ours = {"left_long_corridor_task": "corridor"}.get(name, name)
    waypoints = load_mission(folder / f"{ours}.mission.yaml")[0].waypoints
    for waypoint, published in zip(waypoints, FIGURES["missions"][name], strict=True):
        assert (waypoint.x, waypoint.y, waypoint.yaw) == pytest.approx(published, abs=5e-5)


@pytest.mark.parametrize("name", WORLDS)
def test_a_scenario_has_the_doors_of_its_published_world(campaign, name):
    doors = FIGURES["doors"][WORLDS[name]]
    objects = {thing.name: thing for thing in cell(campaign, name).scene.objects if thing.joints}
    assert objects.keys() == doors.keys()
    behaviours = doors_of(campaign, name)
    for door, published in doors.items():
        x, y, yaw = published["pose"]
        pose = objects[door].pose
        assert (pose.x, pose.y) == pytest.approx((x, y), abs=1e-6)
        assert math.remainder(pose.yaw - yaw, math.tau) == pytest.approx(0.0, abs=1e-6)
        shut = objects[door].frozen or behaviours.get(door) == Hold(f"{door}.hinge", 0.0)
        assert shut == published["fixed"]
        if "plugin" in published:
            assert behaviours[door] == played(published, f"{door}.hinge")
        elif not shut:
            assert door not in behaviours


def played(door, joint):
    """The behaviour that a plug-in of a world gives to a door, in our words."""
    match door["plugin"]:
        case "libinitial_plugin.so":
            return Hold(joint, door["position"])
        case "libadversarial_joint_plugin.so" if "x" in door:
            return Trigger(joint, door["x"], door["y"], door["near"], SPRING, of="foot")
        case "libadversarial_joint_plugin.so":
            # Without settings it has zeros for them.
            return KeyFrames(joint, (KeyFrame(0.0, 0.0),), SPRING)
        case "libdynamic_joint_plugin.so":
            frames = FIGURES["key frames"][door["key frames"]]
            return KeyFrames(joint, tuple(KeyFrame(*frame) for frame in frames), Jump())


def test_building_c_has_the_published_walls_and_doorways(folder):
    ours, published = plan_of(folder / "building_c.fpm"), FIGURES["plan"]
    assert ours["walls"].keys() == published["walls"].keys()
    compared = [name for name in ours["walls"] if name.startswith(SAME)]
    assert len(compared) > 20
    for name in compared:
        x, y, yaw, *sizes = ours["walls"][name]
        theirs = published["walls"][name]
        assert (x, y, *sizes) == pytest.approx((*theirs[:2], *theirs[3:]), abs=2e-6)
        assert math.remainder(yaw - theirs[2], math.tau) == pytest.approx(0.0, abs=2e-6)
    for name, centre in ours["doorways"].items():
        if name.startswith(("left_corridor_doorway", "classroom_c069")):
            assert centre == pytest.approx(published["doorways"][name], abs=2e-6)


def test_the_map_of_building_c_is_the_published_one(folder):
    scene = compile_scene(load_floorplan(folder / "building_c.fpm"))
    grid = occupancy_grid(scene, laser_height=0.3)
    assert (grid.x, grid.y) == pytest.approx((-24.8019555, -19.0063712), abs=1e-6)
    assert list(grid.cells.shape) == FIGURES["map"]["shape"]
    ours, published = occupied_of(grid.cells == OCCUPIED), FIGURES["map"]["occupied"]
    both = [
        (a, b)
        for mine, theirs in zip(ours, published, strict=True)
        for a, b in zip(mine, theirs, strict=True)
    ]
    assert sum(abs(a - b) for a, b in both) <= 0.02 * sum(b for _, b in both)


def test_all_eight_scenarios_share_one_building_with_its_doors(recomposed):
    assert [c.name for c in recomposed.cells] == ["S1", "S2", *(f"S3.{k}" for k in range(1, 7))]
    assert len({c.scene.digest for c in recomposed.cells}) == 1


@pytest.mark.parametrize(("adversarial", "static"), [("S3.2", "S3.5"), ("S3.4", "S3.6")])
def test_an_adversarial_scenario_is_its_static_sibling_and_one_layer_more(
    campaign, recomposed, adversarial, static
):
    above, below = cell(recomposed, adversarial), cell(recomposed, static)
    assert above.layers[:-1] == below.layers
    assert above.layers[-1].name == "close_on_approach"
    assert above.mission == below.mission
    for each in (campaign, recomposed):
        doors, without = doors_of(each, adversarial), doors_of(each, static)
        changed = {door: doors[door].kind for door in doors if doors[door] != without[door]}
        assert changed == {"door_12": "trigger", "door_17": "trigger"}


def test_the_swinging_variant_is_s3_4_with_other_leaves(campaign, folder):
    variant = load_campaign(folder / "swinging_doors.yaml")
    resting, swinging = cell(variant, "resting"), cell(variant, "swinging")
    original, doors = cell(campaign, "S3.4"), doors_of(campaign, "S3.4")
    assert resting.scene.digest == swinging.scene.digest == original.scene.digest
    assert resting.mission == swinging.mission == original.mission
    assert doors_of(variant, "resting") == doors
    leaves = {
        door: Trigger(f"{door}.hinge", 1.4, 0.0, 1.3, SPRING, of="foot", begin=0.0)
        for door in ("door_12", "door_17")
    }
    assert doors_of(variant, "swinging") == doors | leaves


def test_doors_of_the_recomposed_scenarios_are_shut_random_or_open_but_two(recomposed):
    shut = {f"door_{n}": Hold(f"door_{n}.hinge", 0.0) for n in range(1, 18)}
    assert doors_of(recomposed, "S1") == shut
    # The doors of S2 move the same way in all five runs.
    random = doors_of(recomposed, "S2")
    moving = [b for b in random.values() if isinstance(b, KeyFrames)]
    assert [b.joint for b in moving] == [f"door_{n}.hinge" for n in range(1, 12)]
    assert len({b.frames for b in moving}) == 11
    for behaviour in moving:
        assert {f.position for f in behaviour.frames} == {0.0, 1.7}
        assert all(90.0 <= f.time <= 729.0 for f in behaviour.frames[1:])
    assert sum(isinstance(b, Hold) for b in random.values()) == 6
    expected = shut | {f"door_{n}": Hold(f"door_{n}.hinge", 1.4) for n in (13, 14, 16)}
    expected |= {f"door_{n}": Trigger(f"door_{n}.hinge", 1.4, 0.0, 1.3, SPRING) for n in (12, 17)}
    assert doors_of(recomposed, "S3.1") == expected


def test_building_c_is_the_published_one_in_both_worlds(campaigns, reference_data):
    shares = {name: min(fit.shares) for name, fit in fits(reference_data, campaigns).items()}
    assert shares.keys() == {"S1", "S3.4"}
    assert min(shares.values()) >= 0.97
