"""Synthetic traces: a robot in a corridor with one hinged door, told in a few arrays."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from daemon.judging.oracles import judge
from daemon.model.spec import OracleText, SutReference
from daemon.model.sut import BehaviorTreeLog, TreeChange
from daemon.trace import CommandTrack, JointTrack, MotionTrack, PoseTrack, Trace
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot
from grammars.model.scene import Joint, Link, Scene, SceneObject, Solid
from tests.make import make_spec

ROBOT = Robot(
    name="base",
    footprint=((0.35, 0.233), (-0.35, 0.233), (-0.35, -0.233), (0.35, -0.233)),
    height=1.1,
    mass=50.0,
    drive=Drive("omnidirectional", 1.0, 1.0, 1.5, 1.0, 1.0, 2.0, 200.0, 100.0, 0.5),
    laser=Laser(Mount(0.25, 0.0), 0.3, -2.0, 2.0, 181, 0.05, 12.0, 10.0, 0.0, 0.0),
    odometry=OdometryNoise(50.0, 0.0, 0.0, 0.0),
)


def box(x0, y0, x1, y1):
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def wall(name, x0, y0, x1, y1, **heights):
    span = {"z_min": 0.0, "z_max": 2.7} | heights
    return Solid(name, "wall", box(x0, y0, x1, y1), **span)


def door(name, x, y, yaw=0.0):
    """A leaf of 0.9 m along its own x axis, hinged at its origin."""
    leaf = Link("leaf", (box(0.0, -0.02, 0.9, 0.02),), 20.0, 0.01, 2.0)
    hinge = Joint("hinge", "revolute", "world", "leaf", (0.0, 0.0), (0.0, 0.0), -1.7, 1.7)
    return SceneObject(name, "door", Pose2(x, y, yaw), (leaf,), (hinge,), (0.0,))


CORRIDOR = Scene(
    name="corridor",
    regions=(),
    doorways=(),
    solids=(
        wall("wall-north", -5.0, 1.0, 50.0, 1.2),
        wall("wall-south", -5.0, -1.2, 50.0, -1.0),
        wall("lintel", 4.0, -1.0, 4.2, 1.0, z_min=2.1),
    ),
    objects=(door("door-17", 8.0, 1.0),),
)


def still(time):
    zero = np.zeros(len(time))
    return MotionTrack(time, zero, zero, zero, zero, zero, zero)


def along(time, speed=0.5, **channels):
    """Straight along x from the origin at constant speed; channels can be replaced."""
    zero = np.zeros(len(time))
    motion = MotionTrack(time, speed * (time - time[0]), zero, zero, zero + speed, zero, zero)
    return replace(motion, **channels)


def track(time, x, y=0.0, sigma=0.1):
    covariance = np.tile(np.diag([sigma**2, sigma**2, 0.01]), (len(time), 1, 1))
    zero = np.zeros(len(time))
    return PoseTrack(time, x + zero, y + zero, zero, covariance)


NOTHING = track(np.empty(0), np.empty(0))


def times(seconds, rate=20.0):
    return np.arange(round(seconds * rate) + 1) / rate


def mission(*points):
    waypoints = tuple(Waypoint(f"w{i}", x, y) for i, (x, y) in enumerate(points, start=1))
    return Mission("there", Pose2(), waypoints)


def make_trace(
    motion,
    *,
    scene=CORRIDOR,
    goal=None,
    robot=ROBOT,
    estimate=NOTHING,
    cloud=NOTHING,
    joints=None,
    contacts=(),
    progress=(),
    limit=60.0,
    **fields,
):
    """Build a complete trace of ``motion``; ``fields`` replace whatever else is recorded.

    Unless there is another ``goal`` the mission asks for nothing but to stay.
    """
    time = motion.time
    goal = goal or mission((float(motion.x[0]), float(motion.y[0])))
    values = {"robot": robot, "mission": goal, "oracles": (), "limit": limit}
    spec = replace(make_spec(1), scene=scene.digest, **values)
    names = scene.joint_names
    initial = np.array([p for item in scene.objects for p in item.initial])
    if joints is None:
        position = np.tile(initial, (1, 1))
        joints = JointTrack(names, time[:1], position, np.zeros_like(position))
    trace = Trace(
        path=Path("run.mcap"),
        spec=spec,
        scene=scene,
        ended="finished",
        note="",
        complete=True,
        valid_until=float(time[-1]) if len(time) else 0.0,
        problems=(),
        versions={},
        ground_truth=motion,
        odometry=motion,
        command=CommandTrack(time, motion.vx, motion.vy, motion.wz),
        estimate=estimate,
        cloud=cloud,
        cloud_count=np.full(len(cloud.time), 500, dtype=np.int64),
        joints=joints,
        contacts=contacts,
        progress=progress,
        events=(),
        scans=None,
    )
    return replace(trace, **fields)


def with_tree(trace, *ticks):
    """A trace that recorded a behaviour tree: each tick a time and its changes, as text."""
    changes = [
        (
            time,
            [
                TreeChange(node, int(uid), *way.split(">"))
                for node, uid, way in (change.rsplit(" ", 2) for change in tick)
            ],
        )
        for time, *tick in ticks
    ]
    reports = tuple(BehaviorTreeLog(time, tuple(tick)) for time, tick in changes)
    sut = SutReference("nav2", "ros2", {"record": ["behavior tree"]})
    return replace(trace, spec=replace(trace.spec, sut=sut), reports=reports)


def cut(trace, at):
    """Return ``trace`` as if its writer had died at ``at`` [s]; nothing later is in it.

    ``trace`` itself when it is cut and ends before that.
    """
    if not trace.complete and trace.valid_until <= at:
        return trace
    tracks = ("ground_truth", "odometry", "command", "estimate", "joints", "scans", "latency")
    changes = {name: _cut_track(getattr(trace, name), at) for name in tracks}
    for name in ("contacts", "progress", "events", "reports"):
        records = getattr(trace, name)
        changes[name] = tuple(r for r in records if r.time <= at + 1e-9)
    return replace(
        trace,
        ended=None,
        note="judged while it was going on",
        complete=False,
        valid_until=min(at, trace.valid_until),
        cloud=_cut_track(trace.cloud, at),
        cloud_count=trace.cloud_count[: _samples_until(trace.cloud.time, at)],
        **changes,
    )


def _cut_track(track, at):
    if track is None:
        return None
    count = _samples_until(track.time, at)
    names = [field.name for field in fields(track)]
    arrays = {n: getattr(track, n) for n in names if isinstance(getattr(track, n), np.ndarray)}
    return replace(track, **{name: array[:count] for name, array in arrays.items()})


def _samples_until(time, at):
    """Return how many leading samples are not later than ``at``; clocks may run backwards."""
    later = np.flatnonzero(time > at + 1e-9)
    return int(later[0]) if len(later) else len(time)


def verdict(trace, text):
    return judge(trace, (OracleText("it", text),))[0]


def answers(path, things, answer):
    """Return a file anew: below each line, ``answer`` of that line and the thing of its section.

    A section begins with ``== name: description``.
    """
    lines, thing = [], None
    for line in path.read_text("utf-8").splitlines():
        if line.startswith("    "):
            continue
        lines.append(line)
        if line.startswith("== "):
            thing = things(line.removeprefix("== ").partition(":")[0])
        elif line:
            lines.append(f"    {answer(thing, line)}")
    return "\n".join([*lines, ""])
