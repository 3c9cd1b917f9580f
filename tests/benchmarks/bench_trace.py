"""What a trace costs: CPU per message and per simulated minute, against rosbags and mcap.

Two minutes of a robot with a 500-ray laser among 20 hinged doors, at the rates of a run: 600
scans, 1200 samples of odometry (with tf), ground truth and joint states; then with everything a
navigation stack adds (1200 commands, 600 estimates and particle clouds). One door moves for ten
seconds. The rival takes the same messages and writes them with rosbags' serializer and mcap's
writer. CPU time of this process, median of several rounds.
"""

import io
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

from daemon.model import ros_messages as ros
from daemon.model.sut import Cloud, Estimate, Odometry, Progress
from daemon.trace import TraceWriter, layouts, messages, read_trace
from daemon.trace.layouts import HEADER
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from tests.benchmarks.measurement import Measurement, Reference
from tests.engine.trace.recordings import ROBOT, door, scene, specification

RAYS = 500
DOORS = 20
ROUNDS = 7


class Minute:
    """The signals of one simulated minute, computed beforehand."""

    def __init__(self, *, restless, navigated):
        random = np.random.default_rng(1)
        self.navigated = navigated
        self.scene = replace(scene(0), objects=tuple(door(i + 10) for i in range(DOORS)))
        laser = replace(ROBOT.laser, rays=RAYS)
        self.spec = specification(self.scene, robot=replace(ROBOT, laser=laser))
        self.grid = OccupancyGrid(0.05, 0.0, 0.0, np.zeros((300, 1200), np.int8))
        clean = 3.0 + np.sin(np.linspace(0.0, 9.0, RAYS))
        noise = random.normal(0.0, 0.01, (600, RAYS))
        self.scans = (clean + noise).astype(np.float32)
        self.poses = [Pose2(*row) for row in random.uniform(-3.0, 3.0, (1200, 3)).tolist()]
        self.twists = [Twist2(*row) for row in random.uniform(-1.0, 1.0, (1200, 3)).tolist()]
        self.positions = np.zeros((1200, DOORS))
        if restless:
            self.positions[:] = random.uniform(-1.0, 1.0, (1200, DOORS))
        else:
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
    """Yield minutes written and read, the same by the rival, and messages encoded."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "minute.mcap"
        yield from _report("robot alone", Minute(restless=False, navigated=False), path)
        restless = Minute(restless=True, navigated=False)
        yield from _report("robot alone, all doors moving", restless, path)
        navigated = Minute(restless=False, navigated=True)
        yield from _report("with navigation", navigated, path)
        yield _rival(path, 1e3 * _cpu(lambda: navigated.record(path)))
    yield from _compare()


def _report(name, minute, path):
    minute.record(path)
    info = minute.record(path)
    write = _cpu(lambda: minute.record(path))
    read = _cpu(lambda: read_trace(path))
    read_all = _cpu(lambda: read_trace(path, scans=True))
    size = f"{info.messages} messages, {info.size / 1000:.0f} kB per minute"
    each = f"{size}, {write / info.messages * 1e6:.2f} us per message"
    written = Reference("writing", write * 1e3)
    yield Measurement(f"{name}: written", written.value, "ms", None, (), each)
    yield Measurement("  read", read * 1e3, "ms", written)
    yield Measurement("  read with scans", read_all * 1e3, "ms", written)


def _rival(path, ours):
    """Write the messages of a trace again, with rosbags and mcap alone; ``ours`` is in ms."""
    with path.open("rb") as stream:
        raw = [(c.topic, m.log_time, m.data) for _, c, m in make_reader(stream).iter_messages()]
    objects = [(topic, at, ros.deserialize(data, messages.KINDS[topic])) for topic, at, data in raw]

    def write():
        out = io.BytesIO()
        writer = Writer(out)
        writer.start("ros2")
        ids = {}
        for topic, kind in messages.KINDS.items():
            schema = writer.register_schema(kind, "ros2msg", ros.schema(kind).encode())
            ids[topic] = writer.register_channel(topic, "cdr", schema)
        for topic, at, message in objects:
            data = ros.serialize(message, messages.KINDS[topic])
            writer.add_message(ids[topic], at, data, at)
        writer.finish()
        return len(out.getvalue())

    cost = _cpu(write)
    note = f"{len(raw)} messages, {cost / len(raw) * 1e6:.2f} us each, {write() / 1000:.0f} kB"
    beside = Reference("ours", ours)
    return Measurement("  written by rosbags and mcap", cost * 1e3, "ms", beside, (), note)


def _compare():
    """Encode the same messages with layouts and with rosbags, in us per message."""
    random = np.random.default_rng(2)
    names = tuple(f"door-{i}.hinge" for i in range(DOORS))
    for layout in (
        layouts.scan(replace(ROBOT.laser, rays=RAYS)),
        layouts.odometry("/odom", "odom"),
        layouts.transforms((("odom", "base_link"),)),
        layouts.joints(names),
        layouts.estimate("/pose"),
        layouts.command(),
    ):
        fast, slow = _layout_cost(layout, random)
        size = f"{len(layout.template) - HEADER.size} B"
        yield Measurement(
            f"{layout.topic}, in columns", fast, "us", Reference("rosbags", slow), (), size
        )


def _layout_cost(layout, random):
    count = 200
    times = np.arange(count, dtype=np.int64) * 50_000_000
    empty = np.zeros(count, layout.record)
    columns = {n: random.random(empty[n].shape) for n in layout.names}
    rows = layout.encode(1, times, columns)
    kind = messages.KINDS[layout.topic]
    message = ros.deserialize(rows[5].tobytes()[HEADER.size :], kind)
    fast = _cpu(lambda: layout.encode(1, times, columns)) / count * 1e6
    slow = _cpu(lambda: [ros.serialize(message, kind) for _ in range(count)]) / count * 1e6
    return fast, slow


def _cpu(work):
    times = []
    for _ in range(ROUNDS):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return statistics.median(times)
