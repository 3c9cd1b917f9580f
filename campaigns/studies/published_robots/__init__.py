"""The navigation packages of published robots, loaded from their launch files and driven.

The project only has descriptions of the robots and their SUT files; the packages are below the
folder ``SCENARIO_REFERENCE_DATA``. A campaign folder is written for each robot.
"""

import shutil
from pathlib import Path

HERE = Path(__file__).parent
SUTS = HERE / "suts"
DEMO = HERE.parents[1] / "demo"
_ROBOTS = {
    "husky-trajectory": "husky",
    "ridgeback-dwa": "ridgeback",
    "robile-a2s": "robile-amr",
    "robile-hbrs": "robile-amr",
    "mir100-dwa": "mir100",
    "mir100-base": "mir100",
    "pr2-unchanged": "pr2",
    "tiago-dwa": "tiago",
    "tiago-trajectory": "tiago",
}
"""Descriptions of robots with another name than the system under test."""


def robot_of(name):
    """Return the name of the robot's description."""
    return _ROBOTS.get(name, name)


def write_campaign(folder, name, packages):
    """Write a campaign of one robot into ``folder`` and return its file.

    The packages of the robot are below ``packages``. The scenarios are the flat of the demo with
    its doors open, and a corridor.
    """
    for path in (*DEMO.glob("flat.fpm"), *DEMO.glob("courier.mission.yaml")):
        shutil.copy(path, folder)
    for path in (DEMO / "doors.scenery", DEMO / "doors_open.scenery"):
        shutil.copy(path, folder)
    for path in HERE.glob("corridor*"):
        shutil.copy(path, folder)
    shutil.copy(HERE / "navigation.oracles.yaml", folder / "navigation.oracles.yaml")
    robot = robot_of(name)
    (folder / "robots").mkdir(exist_ok=True)
    shutil.copy(HERE / "robots" / f"{robot}.yaml", folder / "robots")
    (folder / "suts").mkdir(exist_ok=True)
    sut = (SUTS / f"{name}.yaml").read_text("utf-8").replace("ROBOTS/", f"{packages}/")
    (folder / "suts" / f"{name}.yaml").write_text(sut, "utf-8")
    campaign = folder / f"{name}.campaign.yaml"
    campaign.write_text(_CAMPAIGN.format(name=name, robot=robot), "utf-8")
    return campaign


_CAMPAIGN = """\
campaign: {name}
about: A published robot in the flat of the demonstration and in a corridor of its size.
seed: 1
repeats: 1
limit: 10 min
robot: {robot}
oracles: navigation
matrix: {{sut: [{name}]}}
scenarios:
  flat:
    floorplan: flat
    objects: doors
    behaviours: doors_open
    mission: courier
    oracles: [reached, no-contact, localised]
  corridor: {{floorplan: corridor, mission: corridor, oracles: [reached, no-contact, localised]}}
"""
