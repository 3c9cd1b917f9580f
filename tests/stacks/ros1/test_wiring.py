"""Who hears the scan, as roscpp resolves and remaps names."""

from dataclasses import replace

import pytest

from daemon.stacks.ros1.configuration import read_ros
from daemon.stacks.ros1.wiring import (
    NodeNames,
    TopicParameters,
    Topics,
    Wiring,
    advise_for_robot,
    resolve_name,
)
from grammars.model.robot import Laser, Mount
from tests.stacks.ros1.scenes import ROBOT

ONE_LASER = ("",)

LAUNCH = {"/robile_john/scan_front": "/scan_front"}
GAZEBO, DRIVER = "/robile_john/scan_front", "/scan_front"
A2S, FRO = "robile_john/scan_front", "scan_front"


def resolved(given, wide, near):
    """Return who listens where, with the names of the sources of both costmaps."""
    scans = given.resolved_scans()
    sources = (tuple(given.resolve("move_base", name) for name in names) for names in (wide, near))
    return Topics(scans.published, scans.by_laser, given.resolved_amcl(), *sources)


@pytest.mark.parametrize(
    ("published", "remap", "source", "amcl", "costmaps"),
    [
        (GAZEBO, LAUNCH, A2S, True, True),  # the published launch file
        (GAZEBO, LAUNCH, FRO, True, True),
        (GAZEBO, {}, A2S, False, True),  # plain Gazebo: amcl is deaf
        (GAZEBO, {}, FRO, False, False),
        (DRIVER, {}, A2S, True, False),  # the real robot: the costmaps are blind
        (DRIVER, {}, FRO, True, True),
        (DRIVER, LAUNCH, A2S, True, True),
    ],
)
def test_the_wrong_scan_topic_is_wrong_only_without_the_launch_wide_remap(
    published, remap, source, amcl, costmaps
):
    given = TopicParameters(scan=published, amcl="/scan_front", remap=remap)
    topics = resolved(given, [source], [source])
    assert topics.heard(ONE_LASER) == Wiring(
        *(ONE_LASER if hears else () for hears in (amcl, costmaps, costmaps))
    )


def test_each_costmap_listens_for_itself_and_to_any_of_its_sources():
    topics = resolved(TopicParameters(scan="/scan"), ["sonar", "scan"], ["sonar"])
    assert topics.heard(ONE_LASER) == Wiring(
        amcl=ONE_LASER, global_costmap=ONE_LASER, local_costmap=()
    )
    assert topics.local_costmap == ("/sonar",)


def test_names_are_resolved_beside_their_nodes_with_remaps_of_their_own():
    # As a launch file in <group ns="robot1"> makes them.
    nodes = {
        "amcl": NodeNames("/robot1/amcl", {"scan": "front/scan"}),
        "move_base": NodeNames("/robot1/move_base_node", {"scan": "/far"}),
    }
    given = TopicParameters(remap={"scan": "near"}, nodes=nodes)
    assert given.resolve("amcl", "scan") == "/robot1/front/scan"
    assert given.resolve("move_base", "scan") == "/far"
    assert given.resolve("move_base", "~scan") == "/robot1/move_base_node/scan"
    topics = resolved(given, ["scan"], ["front/scan"])
    assert topics.published == "/robot1/front/scan"
    assert topics.heard(ONE_LASER) == Wiring(ONE_LASER, (), ONE_LASER)
    assert given.resolved_maps() == ("/robot1/map",)
    assert TopicParameters(maps=("walls", "/map")).resolved_maps() == ("/walls", "/map")


def test_a_topic_may_carry_any_laser_it_could_be_of():
    one = TopicParameters(scan="/scan").resolved_scans()
    assert [one.may_carry_scan(t) for t in ("/scan", "/scan_rear", "/scanner")] == [
        True, True, False,
    ]  # fmt: skip
    several = TopicParameters(scan={"front": ("/a", "/b"), "rear": "/b"}).resolved_scans()
    assert several.lasers_on("/b", ("front", "rear")) == ("front", "rear")
    assert [several.may_carry_scan(t) for t in ("/a", "/b", "/c")] == [True, True, False]


@pytest.mark.parametrize(
    ("name", "remap", "resolved"),
    [
        ("scan", {}, "/scan"),
        ("/scan", {}, "/scan"),
        ("~scan", {}, "/move_base/scan"),
        ("a//scan/", {}, "/a/scan"),
        ("scan", {"scan": "other"}, "/other"),
        ("~scan", {"/move_base/scan": "/other"}, "/other"),
        ("scan", {"/scan": "/b", "/b": "/c"}, "/b"),
    ],
)
def test_names_are_resolved_in_their_namespace_and_remapped_once(name, remap, resolved):
    assert resolve_name(name, "/move_base", remap) == resolved


def test_what_the_launch_file_of_amcl_maps_to_is_not_mapped_again():
    given = TopicParameters(scan=GAZEBO, amcl=GAZEBO, remap=LAUNCH)
    assert not resolved(given, [], []).heard(ONE_LASER).amcl
    unmapped = TopicParameters(scan="/scan", remap={"/scan": "/other"})
    assert resolved(unmapped, [], []).heard(ONE_LASER).amcl


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
