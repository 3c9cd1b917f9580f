"""Which lasers a topic may carry, and what is said of lasers that a costmap does not use."""

from dataclasses import replace

import pytest

from daemon.stacks.ros1.configuration import read_ros
from daemon.stacks.ros1.wiring import TopicParameters, advise_for_robot
from grammars.model.robot import Laser, Mount
from tests.stacks.ros1.scenes import ROBOT


def test_a_topic_may_carry_any_laser_it_could_be_of():
    one = TopicParameters(scan="/scan").resolved_scans()
    assert [one.may_carry_scan(t) for t in ("/scan", "/scan_rear", "/scanner")] == [
        True, True, False,
    ]  # fmt: skip
    several = TopicParameters(scan={"front": ("/a", "/b"), "rear": "/b"}).resolved_scans()
    assert several.lasers_on("/b", ("front", "rear")) == ("front", "rear")
    assert [several.may_carry_scan(t) for t in ("/a", "/b", "/c")] == [True, True, False]


LASER = Laser(Mount(0.0), 0.2, -1.5, 1.5, 181, 0.05, 10.0, 10.0, 0.0, 0.0)
CART = replace(ROBOT, laser=LASER)
SCAN = {"data_type": "LaserScan", "topic": "scan", "marking": True, "clearing": True}


def two_lasers(rear=0.2):
    front, back = replace(LASER, name="front"), replace(LASER, name="rear", z=rear)
    return replace(CART, laser=front, other_lasers=(back,))


def tree(topics=None, **source):
    costmap = {"observation_sources": "scan", "scan": SCAN | source}
    return {
        "move_base": {
            "global_costmap": costmap | {"global_frame": "map", "static_map": True},
            "local_costmap": costmap | {"global_frame": "odom", "rolling_window": True},
        },
        "topics": topics or {},
    }


def said(given, robot=CART):
    read = read_ros(given)
    costmaps = read.global_costmap, read.local_costmap
    return [str(finding) for finding in advise_for_robot(read.topics, costmaps, robot)]


def test_a_laser_everybody_hears_is_not_worth_a_word():
    assert said(tree()) == []
    both = {"scan": {"front": ["/scan_front", "/scan"], "rear": ["/scan"]}}
    assert said(tree(both), two_lasers()) == []


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        # turtlebot_navigation listens between 0.25 and 0.35 m.
        ({"min_obstacle_height": 0.25}, "the local costmap ignores the laser at 0.2 m, below 0.25"),
        ({"max_obstacle_height": 0.1}, "the global costmap ignores the laser at 0.2 m, above 0.1"),
        ({"expected_update_rate": 0.05}, "a scan of the laser comes every 0.1 s"),
    ],
)
def test_what_a_source_makes_of_each_laser_is_said(source, expected):
    found = said(tree(**source))
    assert any(expected in line for line in found), found
    fits = {"min_obstacle_height": 0.1, "max_obstacle_height": 0.3, "expected_update_rate": 0.1}
    assert said(tree(**{name: fits[name] for name in source})) == []
