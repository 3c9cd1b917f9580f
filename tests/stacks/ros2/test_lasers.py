"""Several lasers of a robot as a ROS 2 stack hears them: topics, frames, what is missing."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.model import ros_messages as ros
from daemon.model.sut import Briefing, LaserScan, Odometry
from daemon.stacks.findings import ParameterError
from daemon.stacks.ros2 import sensors
from daemon.stacks.ros2.checkup import examine
from daemon.stacks.ros2.endpoints import fixed_messages, link_setup, measured_messages
from daemon.stacks.ros2.inspection import Inspection
from daemon.stacks.ros2.link import Graph, GraphEndpoint, Readiness, StackIdentity
from daemon.stacks.ros2.settings import advise_for_robot, read_settings, settings_not_written
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot

FRONT = Laser(Mount(0.2), 0.3, -1.0, 1.0, 5, 0.05, 5.0, 10.0, 0.0, 0.0, name="front")
REAR = replace(FRONT, name="rear", mount=Mount(-0.2, 0.0, np.pi), z=0.4, rays=3, rate=8.0)
LASERS = (FRONT, REAR)
DRIVE = Drive("differential", 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 100.0, 100.0, 0.0)
RING = ((-0.3, -0.2), (0.3, -0.2), (0.3, 0.2), (-0.3, 0.2))
ROBOT = Robot("shuttle", RING, 0.3, 40.0, DRIVE, FRONT, OdometryNoise(20.0, 0.0, 0.0, 0.0), (REAR,))
SCANS = (
    LaserScan(0.0, np.ones(5, np.float32), "front"),
    LaserScan(0.0, np.full(3, 2.0, np.float32), "rear"),
)


def settings(**keys):
    return read_settings({"launch": "nav {map}", "repeatable": False, **keys})


def scans_of(found):
    sample = Odometry(0.0, Pose2(), Twist2())
    messages = measured_messages(found, LASERS, (sample,), SCANS, lambda _: 5)
    scans = list(messages)[-len(SCANS) :]
    return {topic: sensors.read_message(data, sensors.SCAN) for topic, data in scans}


def frames_of(found):
    grid = OccupancyGrid(0.1, 0.0, 0.0, np.zeros((2, 2), np.int8))
    mission = Mission("m", Pose2(), ())
    briefing = Briefing(ROBOT, grid, mission, Pose2(), np.random.SeedSequence(0))
    ((_, data),) = fixed_messages(found, briefing, 5)
    transforms = ros.deserialize(data, sensors.TRANSFORMS).transforms
    assert {t.header.frame_id for t in transforms} == {found.frames.base}
    assert [t.transform.translation.z for t in transforms] == [0.3, 0.4]
    return [t.child_frame_id for t in transforms]


@pytest.mark.parametrize(
    ("keys", "topics", "frames"),
    [
        ({}, ("/scan_front", "/scan_rear"), ("laser_front", "laser_rear")),
        (
            {"namespace": "r1", "topics": {"scan": "lidar"}, "frames": {"laser": "lidar"}},
            ("/r1/lidar_front", "/r1/lidar_rear"),
            ("lidar_front", "lidar_rear"),
        ),
        (
            {
                "topics": {"scan": {"front": "/f/scan", "rear": "b/scan"}},
                "frames": {"laser": {"rear": "b"}},
            },
            ("/f/scan", "/b/scan"),
            ("laser_front", "b"),
        ),
    ],
)
def test_each_laser_has_a_topic_and_a_frame(keys, topics, frames):
    found = settings(**keys)
    published = [t.name for t in link_setup(found, LASERS).publish if t.kind == sensors.SCAN]
    assert published == list(topics)
    scans = scans_of(found)
    assert list(scans) == list(topics)
    front, rear = scans.values()
    assert (front.header.frame_id, rear.header.frame_id) == frames
    assert (len(front.ranges), rear.ranges[0]) == (5, 2.0)
    assert frames_of(found) == list(frames)


def test_lasers_may_share_a_topic():
    found = settings(topics={"scan": {"front": "/scan", "rear": "/scan"}})
    published = [t.name for t in link_setup(found, LASERS).publish if t.kind == sensors.SCAN]
    assert published == ["/scan"]


def test_one_laser_without_a_name_is_where_it_always_was():
    laser = replace(FRONT, name="")
    found = settings(namespace="r1", topics={"scan": "lidar"}, frames={"laser": "base_scan"})
    assert (found.scan_topic(laser), found.frames.of_laser(laser)) == ("/r1/lidar", "base_scan")


@pytest.mark.parametrize(
    ("scan", "message"),
    [
        ({"Front": "/a"}, 'scan: "Front" is no name of a laser: write a-z, 0-9 and _'),
        ({"front": "a b"}, 'scan: "a b" is not a ROS name: '),
        ({"front": 3}, "scan: 3 is neither a name nor names by laser"),
        (["/a"], "scan: ['/a'] is neither a name nor names by laser"),
        ({}, "scan: names no laser: write a name, or one for each laser"),
    ],
)
def test_names_that_are_none_are_refused(scan, message):
    with pytest.raises(ParameterError) as caught:
        settings(topics={"scan": scan})
    (problem,) = caught.value.problems
    assert problem.path == ("topics", "scan")
    assert problem.message.startswith(message)


def test_the_robot_is_held_against_what_is_written():
    found = settings(topics={"scan": {"left": "/a"}}, frames={"laser": {"rear": "b"}})
    told = [finding.message for finding in advise_for_robot(found, ROBOT)]
    assert told == [
        'robot shuttle has no laser "left": it has lasers front, rear',
        "the laser rear of robot shuttle has 8 Hz, which is no whole number of cycles of 0.05 s: "
        "some cycles have a sample more than others",
    ]
    alone = replace(ROBOT, laser=replace(FRONT, name=""), other_lasers=())
    (found_topic, *_) = findings = list(advise_for_robot(found, alone))
    told = [finding.message for finding in findings]
    assert found_topic.hint == ""
    assert told[0] == 'robot shuttle has no laser "left": it has one laser, which has no name'


def ear(topic):
    return GraphEndpoint(topic, sensors.SCAN, "/amcl", "subscription", False, False)


def about_scans(found, *ears):
    graph = Graph(ears, ("/amcl",), ())
    seen = Inspection(StackIdentity("jazzy", "rmw_x"), graph, Readiness({}, True, {}))
    return [line for line in examine(found, seen, LASERS) if line.kind == sensors.SCAN]


def test_a_laser_nobody_hears_is_a_warning_and_none_a_defect():
    found = settings()
    both = about_scans(found, ear("/scan_front"), ear("/scan_rear"))
    assert [(line.subject, line.state) for line in both] == [
        ("/scan_front", "ok"),
        ("/scan_rear", "ok"),
    ]
    front, rear = about_scans(found, ear("/scan_front"), ear("/back"))
    assert (front.state, rear.state) == ("ok", "warning")
    assert rear.text == "nobody listens: the stack does not see what this laser sees"
    assert rear.hint == "write topics: {scan: {rear: /back}}"
    assert [line.state for line in about_scans(found)] == ["missing", "missing"]


def test_defaults_are_shown_as_they_are_written():
    shown = settings_not_written(read_settings({"launch": "nav {map}"}))
    assert (shown["topics"]["scan"], shown["frames"]["laser"]) == ("/scan", "laser")
    assert "scans" not in shown["topics"]
    written = {"launch": "nav {map}", "topics": {"scan": {"front": "/f"}}}
    assert "scan" not in settings_not_written(read_settings(written))["topics"]
