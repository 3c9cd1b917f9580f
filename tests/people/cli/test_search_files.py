"""What is left of a search: a campaign file that runs by itself, and its world for Gazebo."""

import re
import shutil
from xml.etree import ElementTree

import pytest

from daemon.campaign import expand, load_campaign
from scenario_tui.cli import invoke
from scenario_tui.cli.search import copy_campaign
from scenario_tui.text.search_text import GAZEBO_KINDS

FOUND = """\
# Found by the search doors-in-time: kitchen_opens 8.54 s.
campaign: demo
seed: 7
repeats: 1
limit: 3 min
robot: courier
oracles: navigation
matrix: {sut: [pilot]}
scenarios:
  doors-in-time.4:
    floorplan: flat
    objects: doors
    behaviours: doors_moving
    mission: courier
    oracles: [keeps-clear]
"""


@pytest.fixture
def folder(tmp_path, campaigns):
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    return tmp_path / "demo"


def test_the_found_scenario_is_a_campaign_and_a_world_in_gazebo(folder):
    file = folder / "doors-in-time.found.yaml"
    file.write_text(FOUND)
    (run,) = expand(load_campaign(file)).specs
    assert run.label == "doors-in-time.4/pilot/0"
    gazebo = folder / "gazebo"
    assert invoke(["export", str(file), *GAZEBO_KINDS, "-o", str(gazebo)]) == 0
    worlds = [path for path in gazebo.rglob("*") if path.suffix in (".sdf", ".world")]
    assert worlds
    assert all(ElementTree.parse(path).getroot().tag == "sdf" for path in worlds)
    # The map server of a launch file dies without its file.
    launch = next(path for path in gazebo.rglob("*.launch*")).read_text(encoding="utf-8")
    (named,) = re.findall(r'default="[^"/]*\)/(maps/[^"]*)"', launch)
    assert list(gazebo.rglob(named))


def test_a_copied_campaign_means_the_same_runs_without_any_file_around_it(folder, tmp_path):
    above = tmp_path / "shared.mission.yaml"
    above.write_bytes((folder / "courier.mission.yaml").read_bytes())
    file = folder / "own.yaml"
    file.write_text(FOUND.replace("mission: courier", "mission: ../shared.mission.yaml"))
    (run,) = expand(load_campaign(file)).specs
    copied = copy_campaign(file, tmp_path / "handed on")
    for name in ("demo", "robots", "suts"):
        shutil.rmtree(tmp_path / name)
    above.unlink()
    (again,) = expand(load_campaign(copied / "own.yaml")).specs
    assert again.digest == run.digest
