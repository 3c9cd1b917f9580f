"""A small but complete run to record: every signal, values that only come back if they are kept."""

import math
from contextlib import contextmanager
from dataclasses import fields, is_dataclass, replace

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

from daemon.model.sut import Cloud, CostmapPicture, Estimate, Odometry, Progress
from daemon.trace import Trace, TraceWriter
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot
from grammars.model.scene import Joint, Link, Scene, SceneObject, Solid
from tests.make import make_spec

RAYS = 90

ROBOT = Robot(
    name="box",
    footprint=((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)),
    height=0.4,
    mass=40.0,
    drive=Drive("omnidirectional", 1.0, 0.5, 1.5, 1.0, 1.0, 2.0, 300.0, 100.0, 0.5),
    laser=Laser(Mount(0.2, 0.0, 0.1), 0.25, -1.5, 1.5, RAYS, 0.05, 30.0, 10.0, 0.01, 0.0),
    odometry=OdometryNoise(20.0, 0.01, 0.01, 0.01),
)

MISSION = Mission(
    "round",
    Pose2(1.0, 2.0, 0.5),
    (Waypoint("café", 3.0, 1.0, 1.5), Waypoint("door", 5.0, 1.0), Waypoint("end", 8.0, 1.0, -3.0)),
)


def door(number, *, frozen=False):
    leaf = ((0.0, 0.0), (0.9, 0.0), (0.9, 0.04), (0.0, 0.04))
    post = ((-0.1, 0.0), (0.0, 0.0), (0.0, 0.1), (-0.1, 0.1))
    return SceneObject(
        name=f"door-{number}",
        model="door",
        pose=Pose2(3.0 * number, 2.0, 0.3 * number),
        links=(Link("leaf", (leaf,), 20.0, 0.01, 2.0), Link("post", (post,), 5.0, 0.0, 2.1)),
        joints=(Joint("hinge", "revolute", "world", "leaf", (0.02, 0.02), (1.0, 0.0), -1.6, 1.6),),
        initial=(0.4,),
        frozen=frozen,
    )


def scene(doors=3):
    wall = ((0.0, 0.0), (20.0, 0.0), (20.0, -0.2), (0.0, -0.2))
    column = ((4.0, 1.0), (4.3, 1.0), (4.3, 1.3), (4.0, 1.3))
    return Scene(
        "corridor",
        (),
        (),
        (Solid("hall-wall-0", "wall", wall, 0.0, 2.5), Solid("c1", "column", column, 0.0, 2.5)),
        tuple(door(i, frozen=i == 2) for i in range(doors)),
    )


def specification(world, **changes):
    values = {"robot": ROBOT, "mission": MISSION, "seed": 7, "limit": 60.0} | changes
    return replace(make_spec(3), scene=world.digest, **values)


GRID = OccupancyGrid(0.05, -1.0, -2.0, np.arange(60, dtype=np.int8).reshape(6, 10))


COSTS = np.arange(256, dtype=np.uint8).reshape(8, 32)


def particles_at(time):
    return np.array([[time, -1.5, 0.3], [time + 0.25, 2.0, -3.1]])


def pose_at(time):
    return Pose2(1.0 + 0.4 * time, 2.0 + math.sin(time), math.remainder(1.3 * time, math.tau))


def twist_at(time):
    return Twist2(0.4 * math.cos(time), 0.1, -0.2 * time)


def odometry_at(time):
    pose = pose_at(time)
    return Odometry(time, Pose2(pose.x + 0.01, pose.y - 0.02, pose.yaw), twist_at(time))


def joints_at(time, count):
    """Joints rest until second 2.5, then the first one turns for a second."""
    moved = min(max(time - 2.5, 0.0), 1.0)
    positions, velocities = np.full(count, 0.4), np.zeros(count)
    positions[0] += moved
    velocities[0] = 1.0 if 0.0 < moved < 1.0 else 0.0
    return positions, velocities


def covariance_at(time):
    return np.arange(9.0).reshape(3, 3) + time


def ranges_at(time):
    ranges = np.linspace(1.0, 2.0 + time, RAYS, dtype=np.float32)
    ranges[3], ranges[4] = np.inf, np.nan
    return ranges


def record_until(trace, seconds, joints):
    """Drive for some seconds at 20 Hz."""
    trace.static(GRID)
    for step in range(round(seconds * 20) + 1):
        time = step / 20
        if step % 2 == 0:
            trace.clock(time)
        trace.ground_truth(time, pose_at(time), twist_at(time))
        trace.joints(time, *joints_at(time, joints))
        trace.odometry(odometry_at(time))
        trace.command(time, twist_at(time))
        if step % 2 == 0:
            trace.scan(time, ranges_at(time))
        if step % 10 == 0:
            trace.estimate(Estimate(time, pose_at(time), covariance_at(time)))
            trace.cloud(Cloud(time, 500 + step, pose_at(time), covariance_at(time)))
            trace.local_plan(time, np.array([[time, 1.0], [time + 1, 2.0]]))
        if step % 20 == 0:
            trace.plan(time, np.array([[0.0, 1.0], [2.0, 3.0], [time // 2, 5.0]]))
            trace.progress(time, Progress(min(step // 40, 2), min(step // 40, 2), "active"))
            trace.particles(time, particles_at(time))
            trace.costmap(CostmapPicture(time, "odom", 0.05, time, -1.5, COSTS))
            trace.event(time, "sut", f"second {time:g} – ok")
    trace.contact(seconds, "robot", "door-0/leaf", (1.0, 2.0), (0.0, -1.0), 0.003)
    trace.contact(seconds, "robot", "hall-wall-0", (4.0, 5.0), (1.0, 0.0), 0.001)
    trace.contact(seconds, "robot", "door-0/leaf", (1.1, 2.1), (0.6, 0.8), 0.002)


@contextmanager
def writing(path, world=None, **changes):
    """A writer of a recording at ``path``, closed at its limit."""
    world = world or scene()
    with TraceWriter(path, specification(world, **changes), world) as trace:
        yield trace
        trace.close("limit")


def record(path, *, seconds=12.0, doors=3):
    world = scene(doors)
    with TraceWriter(path, specification(world), world, versions={"numpy": "2"}) as trace:
        record_until(trace, seconds, doors)
        trace.progress(seconds, Progress(3, 3, "succeeded"))
        trace.event(seconds, "run", "over", level="warn")
        return trace.close("finished", "all waypoints reached")


def same(one, other):
    """Whether two values are equal; those of a trace may lie in different files."""
    if isinstance(one, np.ndarray):
        return bool(np.array_equal(one, other, equal_nan=one.dtype.kind == "f"))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if is_dataclass(one):
        names = [field.name for field in fields(one) if field.name != "path"]
        return all(same(getattr(one, name), getattr(other, name)) for name in names)
    return bool(one == other)


def differing(one, other):
    """Names of what two traces say differently."""
    names = [field.name for field in fields(Trace) if field.name not in ("path", "versions")]
    return [name for name in names if not same(getattr(one, name), getattr(other, name))]


def rewritten(source, target, **options):
    """The same messages in time order, by the mcap library: what other tools make of a trace."""
    with source.open("rb") as stream, target.open("wb") as out:
        reader = make_reader(stream)
        writer = Writer(out, **options)
        writer.start("ros2", "another tool")
        for attachment in reader.iter_attachments():
            writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        channels = {}
        for schema, channel, message in reader.iter_messages():
            if channel.topic not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", kind)
            writer.add_message(
                channels[channel.topic], message.log_time, message.data, message.publish_time
            )
        writer.finish()
    return target
