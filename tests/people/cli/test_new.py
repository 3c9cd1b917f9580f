"""``scenario new``: a campaign that runs, and with ``--layers`` what campaigns can name."""

import json
import shutil

import pytest

from daemon.campaign import load_campaign
from grammars.text.sources import shipped_folder

PLAN = """Floor plan: barn
Defaults: walls: thickness: 0.1 m height: 2 m
Space hall: shape: Rectangle width=12 m, length=3 m location: wrt: world of: this
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_new_campaign_passes_its_check(scenario, here):
    said = scenario("new", "my-tests")
    assert said.code == 0
    assert "scenario check my-tests/campaign.yaml" in said.out
    assert "scenario run my-tests/campaign.yaml" in said.out
    files = sorted(map(str, (here / "my-tests").iterdir()))
    checked = scenario("check", *files)
    assert (checked.code, checked.err.count("no problems")) == (0, len(files))


def test_what_it_writes_can_be_typed_and_broken(scenario, here, transcript):
    (here / "slit.fpm").write_text(PLAN.replace("length=3 m", "length=0.5 m"))
    (here / "full").mkdir()
    (here / "full" / "notes.txt").write_text("mine")
    scenario("new", "broken")
    oracles = here / "broken" / "navigation.oracles.yaml"
    oracles.write_text(oracles.read_text().replace("robot, kitchen_door", "robot, kitchn_door"))
    transcript("new")
    assert [path.name for path in (here / "full").iterdir()] == ["notes.txt"]
    assert not (here / "none").exists()


def test_it_begins_with_a_building_that_is_there(scenario, here, campaigns):
    (here / "barn.fpm").write_text(PLAN)
    shutil.copy(campaigns / "demo" / "flat.fpm", here / "flat.fpm")
    for plan in ("barn", "flat"):
        said = scenario("new", f"tests/{plan}", "--floorplan", f"{plan}.fpm", "--json")
        assert json.loads(said.out)["campaign"] == f"tests/{plan}/campaign.yaml"
        assert scenario("check", f"tests/{plan}/campaign.yaml").err.endswith("no problems\n")
    (cell,) = load_campaign("tests/barn/campaign.yaml").cells
    assert [w.id for w in cell.mission.waypoints] == ["stop_1", "stop_2", "home"]
    (cell,) = load_campaign("tests/flat/campaign.yaml").cells
    assert [w.id for w in cell.mission.waypoints] == ["living_room", "bedroom", "kitchen", "home"]


def test_nav2_is_tested_with_parameters_of_the_robot(scenario, here):
    answer = scenario("new", "mine", "--nav2")
    assert "scenario sut check mine/suts/my-nav2.yaml --campaign mine/campaign.yaml" in answer.out
    assert scenario("check", "mine/campaign.yaml").err.endswith("12 runs, no problems\n")
    assert scenario("check", "mine/suts/my-nav2.yaml").err.endswith("no problems\n")
    campaign = load_campaign("mine/campaign.yaml")
    assert {sut.name for cell in campaign.cells for sut in cell.suts} == {"pilot", "my-nav2"}
    assert "max_vel_x: 0.8" in (here / "mine" / "suts" / "nav2.yaml").read_text()


def test_it_begins_with_a_robot_that_is_there_or_ships(scenario, here, campaigns):
    text = (campaigns / "robots" / "robile.yaml").read_text()
    (here / "wide.yaml").write_text(text.replace("robot: robile", "robot: wide"))
    for robot, name in (("wide.yaml", "wide"), ("courier", "courier")):
        answer = scenario("new", f"tests/{name}", "--robot", robot, "--nav2", "--json")
        assert "my_robot.yaml" not in answer.out
        (cell, *_) = load_campaign(f"tests/{name}/campaign.yaml").cells
        assert cell.robot.name == name
        assert f"for the robot {name}" in (here / "tests" / name / "suts" / "nav2.yaml").read_text()


def test_layers_lists_what_ships_and_what_is_here(scenario, here):
    scenario("new", "mine")
    body = json.loads(scenario("new", "mine", "--layers", "--json").out)
    found = {(layer["kind"], layer["name"]): layer for layer in body["layers"]}
    assert found["robot", "courier"]["ships"]
    assert found["robot", "my_robot"]["file"] == "mine/my_robot.yaml"
    assert found["system under test", "fro-omni"]["about"].startswith("ROS navigation")
    assert ("robot", "campaign") not in found
    names = {name for kind, name in found if kind == "scenery"}
    assert names == {"doors", "door_open", "door_opens_late"}
    table = scenario("new", "mine", "--layers").out
    assert "my_robot" in table
    assert "ships" in table


def test_where_a_robot_that_ships_is_installed_stays_unsaid(scenario, here):
    scenario("new", "mine")
    file = here / "mine" / "campaign.yaml"
    file.write_text(file.read_text().replace("robot: my_robot", "robot: courier"))
    assert scenario("export", str(file), "prov", "-o", "out").code == 0
    said = "".join(path.read_text() for path in (here / "out").rglob("*.ttl"))
    assert '"courier.yaml"' in said
    assert str(here) not in said
    assert str(shipped_folder()) not in said
