"""What is said of a robot's sensors once it is known which system they meet."""

import pytest

from daemon.campaign import examine

CAMPAIGN = """\
campaign: flat
seed: 7
repeats: 1
limit: 30 s
robot: courier
matrix: {sut: [mine]}
oracles: navigation
scenarios:
  A: {floorplan: flat, mission: courier, oracles: [reached]}
  B: {floorplan: flat, mission: courier, oracles: [reached]}
"""
ROS = """\
sut: mine
kind: ros
parameters:
  costmap_common:
    observation_sources: scan
    scan: {data_type: LaserScan, topic: scan, marking: true, max_obstacle_height: 0.01}
  move_base:
    base_local_planner: dwa_local_planner/DWAPlannerROS
    global_costmap: {static_map: true}
    local_costmap: {global_frame: odom, rolling_window: true}
"""


@pytest.fixture
def folder(tmp_path, campaigns):
    for path in (campaigns / "demo").iterdir():
        if path.suffix in (".fpm", ".yaml") and path.name != "campaign.yaml":
            (tmp_path / path.name).write_text(path.read_text())
    (tmp_path / "courier.yaml").write_text((campaigns / "robots" / "courier.yaml").read_text())
    (tmp_path / "campaign.yaml").write_text(CAMPAIGN)
    return tmp_path


def said(folder):
    found = examine(folder / "campaign.yaml")[1]
    return [str(one).partition(": warning: ")[2] for one in found if "mine:" in str(one)]


def test_a_laser_the_costmaps_ignore_is_said_once_per_system_and_robot(folder):
    (folder / "mine.yaml").write_text(ROS)
    found = said(folder)
    assert len(found) == 2
    assert all("scan/max_obstacle_height the " in one and "above 0.01 m" in one for one in found)
    (folder / "mine.yaml").write_text(ROS.replace("0.01", "2.0"))
    assert said(folder) == []


def test_a_ros2_stack_is_held_against_the_rates_of_sensors(folder):
    (folder / "mine.yaml").write_text(
        "sut: mine\nkind: ros2\nlaunch: nav {map}\nready: [amcl]\nperiod: 0.07 s\n"
    )
    found = said(folder)
    assert found
    assert all("which is no whole number of cycles of 0.07 s" in one for one in found)
