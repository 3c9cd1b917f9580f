"""What a trace costs: CPU of a simulated minute, against rosbags and mcap.

A minute of a robot with a 500-ray laser among 20 hinged doors, at the rates of a run: 600 scans,
1200 samples of odometry (with tf), ground truth and joint states; then with everything a navigation
stack adds (1200 commands, 600 estimates and particle clouds). One door moves for ten seconds. The
rival takes the same messages and writes them with rosbags' serializer and mcap's writer.
"""

import io
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

from daemon.model import ros_messages as ros
from daemon.model.sut import Cloud, Estimate, Odometry, Progress
from daemon.trace import TraceWriter, messages, read_trace
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from tests.benchmarks.measurement import side_by_side
from tests.engine.trace.recordings import ROBOT, door, scene, specification

RAYS, DOORS = 500, 20
ROUNDS = 7


class Minute:
    """The signals of one simulated minute, computed beforehand."""

    def __init__(self, *, navigated):
        random = np.random.default_rng(1)
        self.navigated = navigated
        self.scene = replace(scene(0), objects=tuple(door(i + 10) for i in range(DOORS)))
        laser = replace(ROBOT.laser, rays=RAYS)
        self.spec = specification(self.scene, robot=replace(ROBOT, laser=laser))
        self.grid = OccupancyGrid(0.05, 0.0, 0.0, np.zeros((300, 1200), np.int8))
        clean = 3.0 + np.sin(np.linspace(0.0, 9.0, RAYS))
        self.scans = (clean + random.normal(0.0, 0.01, (600, RAYS))).astype(np.float32)
        self.poses = [Pose2(*row) for row in random.uniform(-3.0, 3.0, (1200, 3)).tolist()]
        self.twists = [Twist2(*row) for row in random.uniform(-1.0, 1.0, (1200, 3)).tolist()]
        self.positions = np.zeros((1200, DOORS))
        self.positions[200:400, 3] = np.linspace(0.0, 1.0, 200)
        self.positions[400:, 3] = 1.0
        self.velocities = np.gradient(self.positions, axis=0)
        self.covariance = np.diag([0.01, 0.02, 0.03])

    def record(self, path):
        """Write the minute the way the run engine does."""
        with TraceWriter(path, self.spec, self.scene) as trace:
            trace.static(self.grid)
            for step in range(1200):
                now = step * 0.05
                pose, twist = self.poses[step], self.twists[step]
                trace.ground_truth(now, pose, twist)
                trace.joints(now, self.positions[step], self.velocities[step])
                trace.odometry(Odometry(now, pose, twist))
                if step % 2 == 0:
                    trace.clock(now)
                    trace.scan(now, self.scans[step // 2])
                if self.navigated:
                    trace.command(now, twist)
                    if step % 2 == 0:
                        trace.estimate(Estimate(now, pose, self.covariance))
                        trace.cloud(Cloud(now, 500, pose, self.covariance))
            trace.progress(now, Progress(3, 3, "succeeded"))
            return trace.close("finished")


def measure():
    """Yield minutes read and written otherwise, ours written being the reference."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "minute.mcap"
        for name, navigated in (("robot alone", False), ("with navigation", True)):
            minute = Minute(navigated=navigated)
            info = minute.record(path)
            ours = f"{name}, {info.messages} messages, {info.size / 1000:.0f} kB written"
            copy = path.with_name("copy.mcap")
            works = {
                ours: partial(minute.record, copy),
                "  read": partial(read_trace, path),
                "  read with scans": partial(read_trace, path, scans=True),
                "  written by rosbags and mcap": rival(path),
            }
            yield from side_by_side(works, ROUNDS)


def rival(path):
    """Return what writes the messages of a trace again, with rosbags and mcap alone."""
    with path.open("rb") as stream:
        objects = [
            (c.topic, m.log_time, ros.deserialize(m.data, messages.KINDS[c.topic]))
            for _, c, m in make_reader(stream).iter_messages()
        ]

    def write():
        writer = Writer(io.BytesIO())
        writer.start("ros2")
        ids = {}
        for topic, kind in messages.KINDS.items():
            schema = writer.register_schema(kind, "ros2msg", ros.schema(kind).encode())
            ids[topic] = writer.register_channel(topic, "cdr", schema)
        for topic, at, message in objects:
            data = ros.serialize(message, messages.KINDS[topic])
            writer.add_message(ids[topic], at, data, at)
        writer.finish()

    return write
