"""A robot's lasers and who listens to them: what is said of each, with the robot at hand."""

from dataclasses import replace

import pytest

from daemon.stacks.ros1.configuration import read_ros
from daemon.stacks.ros1.wiring import advise_for_robot
from grammars.model.geometry import Pose2
from grammars.model.robot import Drive, Laser, OdometryNoise, Robot

LASER = Laser(Pose2(), 0.2, -1.5, 1.5, 181, 0.05, 10.0, 10.0, 0.0, 0.0)
ROBOT = Robot(
    name="cart",
    footprint=((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)),
    height=0.4,
    mass=20.0,
    drive=Drive("differential", 1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 100.0, 100.0, 0.0),
    laser=LASER,
    odometry=OdometryNoise(20.0, 0.0, 0.0, 0.0),
)
SCAN = {"data_type": "LaserScan", "topic": "scan", "marking": True, "clearing": True}


def two_lasers(rear=0.2):
    front, back = replace(LASER, name="front"), replace(LASER, name="rear", z=rear)
    return replace(ROBOT, laser=front, other_lasers=(back,))


def tree(topics=None, **source):
    costmap = {"observation_sources": "scan", "scan": SCAN | source}
    return {
        "move_base": {
            "global_costmap": costmap | {"global_frame": "map", "static_map": True},
            "local_costmap": costmap | {"global_frame": "odom", "rolling_window": True},
        },
        "topics": topics or {},
    }


def said(given, robot=ROBOT):
    read = read_ros(given)
    costmaps = read.global_costmap, read.local_costmap
    return [str(finding) for finding in advise_for_robot(read.topics, costmaps, robot)]


def test_a_laser_everybody_hears_is_not_worth_a_word():
    assert said(tree()) == []
    both = {"scan": {"front": ["/scan_front", "/scan"], "rear": ["/scan"]}}
    assert said(tree(both), two_lasers()) == []


def test_a_laser_nobody_hears_is_named():
    found = said(tree({"scan": {"front": "/scan", "rear": "/scan_rear"}}), two_lasers())
    assert found == [
        "topics/scan: nobody listens to the laser rear of robot cart: it is published on "
        "/scan_rear; topics/scan says where lasers are published"
    ]


def test_a_part_that_hears_no_laser_is_named_with_what_it_misses():
    deaf = said(tree({"amcl": "/other", "scan": "/scan"}))
    assert deaf == [
        "topics/scan: amcl listens to /other, the lasers of robot cart are on /scan; amcl never "
        "corrects odometry: set topics/amcl or topics/remap"
    ]
    blind = said(tree({"amcl": "/x", "scan": "/x"}))
    assert blind == [
        f'move_base/{name}_costmap/obstacle_layer/scan/topic: the source "scan" of the {name} '
        f"costmap listens to /scan, where robot cart publishes no laser; the {name} costmap shows "
        "no obstacle that the map does not show"
        for name in ("global", "local")
    ]


def test_of_several_sources_the_one_that_hears_nothing_is_named():
    given = tree()
    two = {"observation_sources": "scan rear", "rear": SCAN | {"topic": "r"}}
    given["move_base"]["local_costmap"] |= two
    assert said(given) == [
        'move_base/local_costmap/obstacle_layer/rear/topic: the source "rear" of the local costmap '
        "listens to /r, where robot cart publishes no laser; topics/scan says where lasers are "
        "published"
    ]


def test_lasers_are_published_by_their_names_when_nothing_is_said():
    found = said(tree(), two_lasers())
    assert len([line for line in found if "nobody listens to the laser" in line]) == 2
    assert any("amcl listens to /scan, the lasers of robot cart are on /scan_front" in f
               for f in found)  # fmt: skip
    assert any('the source "scan" of the local costmap listens to /scan, where' in f for f in found)


def test_a_laser_the_robot_does_not_have_is_named():
    found = said(tree({"scan": {"front": "/scan", "top": "/top"}}), two_lasers())
    assert "topics/scan/top: the robot has no laser top; its lasers are front, rear" in found
    assert "its only laser has no name" in said(tree({"scan": {"front": "/scan"}}))[0]


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


def test_of_several_lasers_the_one_at_the_wrong_height_is_named():
    topics = {"scan": {"front": "/scan", "rear": "/scan"}}
    found = said(tree(topics, max_obstacle_height=0.5), two_lasers(rear=0.6))
    assert len(found) == 2
    assert all("ignores the laser rear at 0.6 m, above 0.5 m" in line for line in found)


def test_a_laser_above_a_layer_or_its_voxels_marks_nothing():
    given = tree()
    given["move_base"]["local_costmap"] |= {"max_obstacle_height": 0.1}
    given["move_base"]["global_costmap"] |= {
        "map_type": "voxel", "z_voxels": 2, "z_resolution": 0.05,
    }  # fmt: skip
    found = said(given)
    assert len(found) == 2
    above = "marks nothing in the layer obstacle_layer of the"
    assert f"{above} global costmap, whose voxels end at 0.1 m" in found[0]
    assert f"{above} local costmap, whose limit is 0.1 m" in found[1]
