"""What is written of a stack: settings, placeholders, topics and frames of its lasers."""

import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from daemon.model import ros_messages as ros
from daemon.model.attachments import SutMissing
from daemon.model.execution import decide_on_commands
from daemon.model.sut import Briefing, LaserScan, Odometry
from daemon.stacks.findings import ParameterError
from daemon.stacks.registry import make_sut
from daemon.stacks.ros2 import sensors
from daemon.stacks.ros2.endpoints import fixed_messages, link_setup, measured_messages
from daemon.stacks.ros2.settings import (
    PlaceholderError,
    advise_for_robot,
    fill,
    fill_settings,
    placeholder_names,
    placeholders_in,
    read_settings,
    run_values,
    settings_not_written,
    warnings_about,
)
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot
from tests.stacks.cases import cases, written

SETTINGS = Path(__file__).with_name("settings.txt")
LAUNCH = "ros2 launch my_robot nav.launch.py map:={map} params_file:={params}"
STACK = {"launch": LAUNCH, "files": {"params": "nav2.yaml"}, "repeatable": False}

FRONT = Laser(Mount(0.2), 0.3, -1.0, 1.0, 5, 0.05, 5.0, 10.0, 0.0, 0.0, name="front")
REAR = replace(FRONT, name="rear", mount=Mount(-0.2, 0.0, np.pi), z=0.4, rays=3, rate=8.0)
LASERS = (FRONT, REAR)
DRIVE = Drive("differential", 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 100.0, 100.0, 0.0)
RING = ((-0.3, -0.2), (0.3, -0.2), (0.3, 0.2), (-0.3, 0.2))
ROBOT = Robot("shuttle", RING, 0.3, 40.0, DRIVE, FRONT, OdometryNoise(20.0, 0.0, 0.0, 0.0), (REAR,))
ALONE = replace(ROBOT, laser=replace(FRONT, name=""), other_lasers=())


def flat(values, path=()):
    for name, value in values.items():
        if isinstance(value, dict) and value:
            yield from flat(value, (*path, name))
        else:
            yield f"{'.'.join((*path, name))} = {value!r}"


def test_settings_are_read_as_they_are_written(golden):
    """``settings.txt``: all values of the first case, of others those that differ, and advice."""
    told, usual = [], []
    for name, _ in cases(SETTINGS):
        try:
            found = read_settings(yaml.safe_load(name))
        except ParameterError as error:
            told += written((name, []), [f"error {problem}" for problem in error.problems])
            continue
        results = [line for line in flat(found.model_dump()) if line not in usual]
        usual = usual or results
        results += [f"warning {problem}" for problem in warnings_about(found)]
        for robot in (ROBOT, ALONE):
            lasers = [f"{found.scan_topic(x)} in {found.frames.of_laser(x)}" for x in robot.lasers]
            results += [f"lasers: {', '.join(lasers)}"]
            results += [f"advice {finding}" for finding in advise_for_robot(found, robot)]
        told += written((name, []), results)
    golden(SETTINGS.name, "\n".join(told) + "\n")


def test_each_laser_has_a_topic_and_a_frame():
    scan = {"front": "/f/scan", "rear": "b/scan"}
    found = read_settings(STACK | {"topics": {"scan": scan}, "frames": {"laser": {"rear": "b"}}})
    topics = ["/f/scan", "/b/scan"]
    published = [t.name for t in link_setup(found, LASERS).publish if t.kind == sensors.SCAN]
    assert published == topics
    samples = (Odometry(0.0, Pose2(), Twist2()),)
    scans = [LaserScan(0.0, np.full(x.rays, x.z, np.float32), x.name) for x in LASERS]
    messages = list(measured_messages(found, LASERS, samples, scans, lambda _: 5))[-2:]
    assert [topic for topic, _ in messages] == topics
    front, rear = (sensors.read_message(data, sensors.SCAN) for _, data in messages)
    assert (front.header.frame_id, rear.header.frame_id) == ("laser_front", "b")
    assert (len(front.ranges), rear.ranges[0]) == (5, np.float32(0.4))
    grid, mission = (
        OccupancyGrid(0.1, 0.0, 0.0, np.zeros((2, 2), np.int8)),
        Mission("m", Pose2(), ()),
    )
    briefing = Briefing(ROBOT, grid, mission, Pose2(), np.random.SeedSequence(0))
    ((_, data),) = fixed_messages(found, briefing, 5)
    transforms = ros.deserialize(data, sensors.TRANSFORMS).transforms
    assert {t.header.frame_id for t in transforms} == {"base_link"}
    places = [(t.child_frame_id, t.transform.translation.z) for t in transforms]
    assert places == [("laser_front", 0.3), ("b", 0.4)]


def test_lasers_may_share_a_topic():
    found = read_settings(STACK | {"topics": {"scan": {"front": "/scan", "rear": "/scan"}}})
    published = [t.name for t in link_setup(found, LASERS).publish if t.kind == sensors.SCAN]
    assert published == ["/scan"]


def test_defaults_are_shown_as_they_are_written():
    shown = settings_not_written(read_settings({"launch": "nav {map}"}))
    assert (shown["topics"]["scan"], shown["frames"]["laser"]) == ("/scan", "laser")
    assert "scans" not in shown["topics"]
    written_scan = {"launch": "nav {map}", "topics": {"scan": {"front": "/f"}}}
    assert "scan" not in settings_not_written(read_settings(written_scan))["topics"]


def test_values_are_one_word_to_the_shell():
    awkward = "a b'; rm -rf $HOME #"
    filled = fill("run {params} {{x}} ${{HOME}}", {"params": awkward})
    assert filled == f"run {shlex.quote(awkward)} {{x}} ${{HOME}}"
    assert shlex.split("run " + fill("{params}", {"params": awkward})) == ["run", awkward]
    assert fill("{params}", {"params": awkward}, quoted=False) == awkward
    assert shlex.split(fill("a:={namespace} b", {"namespace": ""})) == ["a:=", "b"]


@pytest.mark.parametrize("text", ["{", "}", "{}", "{ map }", "{{map}", "{map}}"])
def test_lone_braces_are_refused(text):
    with pytest.raises(PlaceholderError, match="does not belong to a placeholder"):
        fill(text, {"map": "m"})


def test_a_run_has_every_placeholder_that_is_offered():
    settings = read_settings(STACK | {"namespace": "/robot1"})
    start, seed = Pose2(1.0, -0.25, 1e-17), np.random.SeedSequence(7)
    values = run_values(settings, Briefing(ROBOT, None, None, start, seed))
    # These two come with the folder and the domain of a process.
    assert {*values, "map", "domain"} == set(placeholder_names(settings))
    assert (values["start.y"], values["namespace"]) == ("-0.25", "robot1")
    assert placeholders_in(LAUNCH) == ("map", "params")


def test_only_the_command_is_quoted():
    container = {"image": "nav2:{robot.name}", "options": ["-v", "{params}:/p"]}
    given = STACK | {"environment": {"PARAMS": "{params}"}, "container": container}
    values = {"params": "a b", "map": "/m", "robot.name": "r"}
    filled = fill_settings(read_settings(given), values)
    assert filled.launch.endswith("map:=/m params_file:='a b'")
    assert filled.environment.variables == {"PARAMS": "a b"}
    assert (filled.container.image, filled.container.options) == ("nav2:r", ("-v", "a b:/p"))


def test_commands_from_elsewhere_are_refused_unless_the_worker_takes_them(monkeypatch):
    monkeypatch.setenv("SCENARIO_COMMANDS", "")
    parameters = {"launch": "true", "repeatable": False}
    decide_on_commands(None, is_remote=True)
    with pytest.raises(SutMissing, match="--commands"):
        make_sut("ros2", parameters)
    # What the daemon decided holds for its own workers, to whom it is local.
    decide_on_commands(None, is_remote=False)
    with pytest.raises(SutMissing):
        make_sut("ros2", parameters)
    decide_on_commands(True, is_remote=True)
    assert make_sut("ros2", parameters).period == 0.05
