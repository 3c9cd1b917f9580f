"""A whole tree of ROS parameters: defaults, what is inherited, who hears, what cannot drive.

``configuration.txt``: changes to a sound tree, ``null`` takes a name out, and what is then read
otherwise than of the sound tree, with all that is said, also for a robot whose lasers stand 0.2 m
high. ``costmaps.txt``: costmaps as people write
them, with and without ``plugins``, and the layers move_base would make of them; in brackets stand
what is written above a costmap, the frames of amcl, the maps that are published, the topics of
lasers, and whether it is the costmap that stops the robot. ``pytest --update`` adds what is read
to new cases.
"""

from copy import deepcopy
from dataclasses import fields, replace
from pathlib import Path

import yaml
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.findings import FindingCollector, ParameterError
from daemon.stacks.ros1.advice import advise
from daemon.stacks.ros1.configuration import RosParameters, read_ros
from daemon.stacks.ros1.costmap.reading import CostmapContext, CostmapReader
from daemon.stacks.ros1.parameters import ParameterNamespace
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot import Laser, Mount
from tests.stacks.cases import cases, written
from tests.stacks.ros1.scenes import ROBOT
from tests.stacks.ros1.sections import said, shown

CONFIGURATION = Path(__file__).with_name("configuration.txt")
COSTMAPS = Path(__file__).with_name("costmaps.txt")
LASER = Laser(Mount(0.0), 0.2, -1.5, 1.5, 181, 0.05, 10.0, 10.0, 0.0, 0.0)
MISSION = Mission("far", Pose2(), (Waypoint("near", 2.0, 1.0), Waypoint("far", 9.0, 1.0)))
SOUND = yaml.safe_load("""
move_base:
  base_local_planner: dwa_local_planner/DWAPlannerROS
  footprint: [[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]
  global_costmap:
    observation_sources: scan
    scan: {data_type: LaserScan, topic: scan, marking: true, clearing: true}
    global_frame: map
    static_map: true
  local_costmap:
    observation_sources: scan
    scan: {data_type: LaserScan, topic: scan, marking: true, clearing: true}
    global_frame: odom
    rolling_window: true
""")


def changed(tree, changes):
    """Return a tree with values changed, or taken out where they are None."""
    new = dict(tree)
    for name, value in changes.items():
        if isinstance(value, dict) and isinstance(tree.get(name, {}), dict):
            new[name] = changed(tree.get(name, {}), value)
        else:
            new[name] = value
    return {name: value for name, value in new.items() if value is not None}


def summary(tree):
    """Return what is read of a tree, and what is said of it."""
    try:
        read = read_ros(tree)
    except ParameterError as error:
        return [], said(error.problems, error.findings)
    lines = [f"quirks: {line}" for line in shown(read.quirks)]
    names = read.topics.lasers()
    lines += [f"heard: {read.topics.wire(names)}"]
    for name, reset in read.resets.items():
        lines += [f"{name}: {line}" for line in shown(reset)]
    for each in fields(RosParameters):
        if each.name not in ("resets", "quirks", "findings"):
            value = getattr(read, each.name)
            found = [str(value)] if each.name == "topics" else shown(value)
            lines += [f"{each.name}: {line}" for line in found]
    front, *others = (replace(LASER, name=name) for name in names)
    body = tuple(map(tuple, SOUND["move_base"]["footprint"]))
    robot = replace(ROBOT, footprint=body, laser=front, other_lasers=tuple(others))
    advice = advise(read, robot, MISSION)
    return lines, said((), read.findings) + [f"advice {finding}" for finding in advice]


def test_trees_are_read_as_they_are_written(golden):
    sound, doubts = summary(SOUND)
    assert doubts == []
    told = []
    for name, _ in cases(CONFIGURATION):
        read, words = summary(changed(SOUND, yaml.safe_load(name)))
        new = [line for line in read if line not in sound]
        told += written((name, []), (sound if name == "{}" else new) + words)
    golden(CONFIGURATION.name, "\n".join(told) + "\n")


def read_costmap(given):
    """Return a costmap, and what was said of it."""
    report, heard = FindingCollector(), given.pop("(heard)", None)
    context = CostmapContext(
        above=ParameterNamespace.of(given.pop("(above)", {}), ()),
        frames=given.pop("(frames)", {"map": "map", "odom": "odom"}),
        resolve=lambda name: f"/{name.lstrip('/')}",
        maps=tuple(given.pop("(maps)", ["/map"])),
        may_carry_scan=lambda topic: heard is None or topic in heard,
        stops_robot=given.pop("(stops robot)", False),
    )
    space = ParameterNamespace.of(given, ("costmap",))
    return CostmapReader(space, report, context).read(), report


def test_costmaps_are_read_as_they_are_written(golden):
    told = []
    for name, lines in cases(COSTMAPS):
        costmap, report = read_costmap(yaml.safe_load("\n".join(lines)) or {})
        results = [] if report.fatal else shown(costmap)
        told += written((name, lines), results + said(report.fatal, report))
    golden(COSTMAPS.name, "\n".join(told) + "\n")


JUNK = st.one_of(
    st.sampled_from([0, -1, 1e9, True, "", "x", "[[1, 2]]", [], [1], {}, {"a": 1}, "$(arg x)"]),
    st.floats(),
    st.lists(st.dictionaries(st.sampled_from(["name", "type"]), st.text(max_size=3)), max_size=2),
    st.lists(
        st.builds(
            "{{name: {}, type: costmap_2d::{}Layer}}".format,
            st.sampled_from(["a", "scan", "static_map", "footprint"]),
            st.sampled_from(["Static", "Obstacle", "Voxel", "X"]),
        ).map(yaml.safe_load),
        max_size=3,
    ),
)
NAMES = {
    (): ("topics", "quirks", "dispatcher"),
    ("topics",): ("remap", "scan", "nodes", "maps"),
    ("amcl",): ("kld_err", "odom_frame_id"),
    ("move_base",): (
        "footprint", "robot_radius", "base_local_planner", "base_global_planner", "scan", "x",
        "recovery_behaviors", "conservative_reset", "DWAPlannerROS", "TrajectoryPlannerROS",
    ),
    ("move_base", "DWAPlannerROS"): ("sim_time", "max_vel_trans", "vx_samples"),
    ("move_base", "local_costmap"): (
        "footprint", "observation_sources", "scan", "plugins", "obstacle_layer", "width",
        "static_map", "map_type", "map_topic", "a",
    ),
    ("move_base", "local_costmap", "obstacle_layer"): ("enabled", "observation_sources", "scan"),
}  # fmt: skip
PLACES = st.sampled_from([(*path, name) for path, names in NAMES.items() for name in names])


@given(st.lists(st.tuples(PLACES, JUNK), min_size=1, max_size=3))
def test_whatever_is_written_is_read_or_refused_in_words(changes):
    tree = deepcopy(SOUND)
    for path, value in changes:
        node = tree
        for name in path[:-1]:
            node = node.setdefault(name, {}) if isinstance(node, dict) else {}
        if isinstance(node, dict):
            node[path[-1]] = deepcopy(value)  # a later path may lead into it
    try:
        assert isinstance(read_ros(tree), RosParameters)
    except ParameterError as error:
        assert error.problems
