"""The laser kernel against pymunk's own ray queries: how much faster, and how equal.

All are timed in turns in one process on the same poses of the benchmark corridor with all doors
shut: with everything in the caches, as in a loop of nothing but scans, and with the caches full of
something else, as in a run, where a costmap and a plan come between two scans.
"""

import itertools
import math
import statistics
import time

import numpy as np
import pymunk

from daemon.simulator import World
from grammars.model.geometry import Pose2
from tests.benchmarks.corridor import LENGTH, build_world, robot, robot_with_two_lasers, scene
from tests.benchmarks.measurement import Measurement, Reference
from tests.engine.simulator.reference import cast_by_broadcast, near_an_end, world_segments
from tests.kernels import load_all

POSES = 40
REPEATS = 5
OTHER = np.zeros(64 * 2**20 // 8)
"""More than any cache holds [64 MiB]."""


def poses():
    """Return poses along a weaving drive between the tips of the leaves."""
    rows = np.linspace(0.0, LENGTH, POSES).tolist()
    return [Pose2(x, 0.1 * math.sin(x), 0.3 * math.cos(x)) for x in rows]


def _query_space(segments):
    space = pymunk.Space()
    for x1, y1, x2, y2 in segments.tolist():
        space.add(pymunk.Segment(space.static_body, (x1, y1), (x2, y2), 0.0))
    return space


def _by_pymunk(space, origin, angles):
    reach = robot().laser.range_max
    everything = pymunk.ShapeFilter()
    ranges = np.full(angles.size, np.inf)
    ends = np.column_stack([np.cos(angles), np.sin(angles)]) * reach + origin
    for i, end in enumerate(ends.tolist()):
        hit = space.segment_query_first(origin, end, 0.0, everything)
        if hit is not None:
            ranges[i] = hit.alpha * reach
    return ranges


def _timed(work, where):
    """Return CPU microseconds per scan."""
    begin = time.thread_time()
    for pose in where:
        work(pose)
    return (time.thread_time() - begin) / len(where) * 1e6


def _timed_cold(work, where):
    """Return CPU microseconds per scan when the caches have been filled with something else."""
    taken = 0.0
    for pose in where:
        OTHER.__iadd__(1.0)
        begin = time.thread_time()
        work(pose)
        taken += time.thread_time() - begin
    return taken / len(where) * 1e6


def measure():
    """Yield each way to scan, the kernel being the reference."""
    load_all()
    world = build_world()
    laser, bodies = robot().laser, world._bodies.at(0)
    # Another one each time: a scanner keeps what it found when nothing has moved.
    version = itertools.count(1)
    segments, where = world_segments(world), poses()
    space = _query_space(segments)
    offsets = np.linspace(laser.angle_min, laser.angle_max, laser.rays)

    def kernel(pose):
        world._scanner(None)._cast(pose, bodies, next(version))

    def exact(pose):
        kernel(pose)
        inverse = world._scanner(None)._inverse
        return np.where(inverse > 1.0 / laser.range_max, 1.0 / inverse, np.inf)

    def scan(pose):
        world._scanner(None).scan(pose, bodies, next(version))

    def query(pose):
        sensor = pose @ laser.mount
        return _by_pymunk(space, (sensor.x, sensor.y), sensor.yaw + offsets)

    def broadcast(pose):
        sensor = pose @ laser.mount
        return cast_by_broadcast(segments, (sensor.x, sensor.y), sensor.yaw + offsets)

    worst = {"pymunk": 0.0, "numpy": 0.0}
    compared = 0
    for pose in where:
        sensor = pose @ laser.mount
        sure = ~near_an_end(segments, (sensor.x, sensor.y), sensor.yaw + offsets)
        ranges = exact(pose)[sure]
        compared += ranges.size
        for name, other in (("pymunk", query(pose)[sure]), ("numpy", broadcast(pose)[sure])):
            other[other > laser.range_max] = np.inf
            hits = np.isfinite(ranges)
            same = np.array_equal(hits, np.isfinite(other))
            difference = float(np.abs(ranges[hits] - other[hits]).max()) if same else math.inf
            worst[name] = max(worst[name], difference)
    pair = World(scene(), robot_with_two_lasers(), Pose2(), (), np.random.SeedSequence(1))

    def one_of(_):
        # By the world, as a run asks: with the true pose and where all bodies are.
        world.tick += 1
        world.scan()

    def both(_):
        pair.tick += 1
        pair.scan("front")
        pair.scan("rear")

    rows = {}
    for _ in range(REPEATS):
        rows.setdefault("kernel", []).append(_timed(kernel, where * 50))
        rows.setdefault("scan", []).append(_timed(scan, where * 50))
        rows.setdefault("one", []).append(_timed(one_of, where * 50))
        rows.setdefault("both", []).append(_timed(both, where * 50))
        rows.setdefault("kernel, cold", []).append(_timed_cold(kernel, where))
        rows.setdefault("scan, cold", []).append(_timed_cold(scan, where))
        rows.setdefault("numpy", []).append(_timed(broadcast, where))
        rows.setdefault("pymunk", []).append(_timed(query, where))
    median = {name: statistics.median(times) for name, times in rows.items()}
    size = f"{len(segments)} segments, {laser.rays} rays"
    base = Reference("kernel", median["kernel"])
    yield Measurement("kernel, exact ranges and owners", base.value, "us", None, (), size)
    for name, label in (
        ("kernel, cold", "  the same, cold caches"),
        ("scan", "scan with noise, float32"),
        ("scan, cold", "  the same, cold caches"),
        ("numpy", "numpy, all rays x all segments"),
        ("pymunk", "pymunk segment_query_first"),
    ):
        different = f"{worst[name]:.1e} m the largest difference" if name in worst else ""
        beside = Reference("warm scan", median["scan"]) if name == "scan, cold" else base
        note = f"{different} over {compared} rays" if different else ""
        yield Measurement(label, median[name], "us", beside, (), note)
    yield Measurement("one laser of a world", median["one"], "us", base)
    one = Reference("one laser", median["one"])
    yield Measurement("two lasers at one instant", median["both"], "us", one)
