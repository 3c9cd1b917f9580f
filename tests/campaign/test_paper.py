"""The scenarios of Ortega et al. 2024, recomposed from layers that none of them alters."""

import pytest

from daemon.campaign import load_campaign
from grammars.model.mission_files import load_mission


@pytest.fixture(scope="module")
def paper(campaigns):
    return load_campaign(campaigns / "ortega2024" / "paper.yaml")


def cell(paper, name):
    return next(c for c in paper.cells if c.name == name)


def test_all_eight_scenarios_share_one_building_with_its_doors(paper):
    assert [c.name for c in paper.cells] == [
        "S1", "S2", "S3.1", "S3.2", "S3.3", "S3.4", "S3.5", "S3.6"
    ]  # fmt: skip
    assert len({c.scene.digest for c in paper.cells}) == 1


def test_an_adversarial_scenario_is_its_static_sibling_and_one_layer_more(paper):
    for static, adversarial in (("S3.5", "S3.2"), ("S3.6", "S3.4")):
        below, above = cell(paper, static), cell(paper, adversarial)
        assert above.layers[:-1] == below.layers
        assert above.layers[-1].name == "close_on_approach"
        assert above.mission == below.mission


def test_only_the_two_malicious_doors_behave_otherwise(paper):
    static = {b.joint: b for b in cell(paper, "S3.6").behaviours[0] if b.kind != "walk"}
    adversarial = {b.joint: b for b in cell(paper, "S3.4").behaviours[0] if b.kind != "walk"}
    changed = {joint for joint, b in adversarial.items() if static[joint] != b}
    assert changed == {"door_12.hinge", "door_17.hinge"}
    assert all(adversarial[joint].kind == "trigger" for joint in changed)


def test_the_doors_of_s2_move_the_same_way_in_all_five_runs(paper):
    assert len(set(cell(paper, "S2").behaviours)) == 1


def test_waypoints_are_those_of_the_published_tasks(paper, campaigns, reference_data):
    names = {"left_long_corridor_task": "corridor"} | {
        f"task_{k}": f"task_{k}" for k in (1, 2, 3, 4)
    }
    for published, ours in names.items():
        theirs = load_mission(reference_data / "missions" / f"{published}.yaml")[0].waypoints
        mine = load_mission(campaigns / "ortega2024" / f"{ours}.mission.yaml")[0].waypoints
        expected = [(w.x, w.y, w.yaw) for w in theirs]
        for waypoint, pose in zip(mine, expected, strict=True):
            assert (waypoint.x, waypoint.y, waypoint.yaw) == pytest.approx(pose, abs=5e-5)
