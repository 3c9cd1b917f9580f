"""The simulator in a corridor with 20 hinged doors: the laser's kernel, and what a second costs.

The kernel beside numpy, which tries all rays with all segments, on the same poses with all doors
shut; also with the caches full of something else, as in a run, where a costmap and a plan come
between two scans. Then a minute of driving, with scans and with what else a stack reads.
"""

import itertools
import math
import statistics
import time

import numpy as np

from grammars.model.geometry import Pose2
from tests.benchmarks.corridor import LENGTH, build_world, robot, steer
from tests.benchmarks.measurement import (
    Measurement,
    Reference,
    in_turns,
    microseconds,
    side_by_side,
)
from tests.engine.simulator.scenes import cast_by_broadcast, world_segments
from tests.kernels import load_all

POSES = 40
REPEATS = 5
SECONDS = 60
OTHER = np.zeros(64 * 2**20 // 8)
"""More than any cache holds [64 MiB]."""


def measure():
    """Yield ways to scan, the kernel being the reference, then driving beside a world at rest."""
    load_all()
    yield from scans()
    yield from minutes()


def scans():
    """Yield each way to scan [CPU us]."""
    world = build_world()
    laser, bodies, scanner = robot().laser, world._bodies.at(0), world._scanner(None)
    # Another one each time: a scanner keeps what it found when nothing has moved.
    version = itertools.count(1)
    segments = world_segments(world)
    offsets = np.linspace(laser.angle_min, laser.angle_max, laser.rays)
    rows = np.linspace(0.0, LENGTH, POSES).tolist()
    where = [Pose2(x, 0.1 * math.sin(x), 0.3 * math.cos(x)) for x in rows]
    rays = [((at.x, at.y), at.yaw + offsets) for at in (pose @ laser.mount for pose in where)]

    def kernel(pose):
        scanner._cast(pose, bodies, next(version))

    def noisy(pose):
        scanner.scan(pose, bodies, next(version))

    def cold(pose):
        OTHER.__iadd__(1.0)
        return microseconds(lambda: kernel(pose))

    works = {
        "kernel": lambda: list(map(kernel, where)),
        "scan with noise, float32": lambda: list(map(noisy, where)),
        "numpy, all rays x all segments": lambda: [cast_by_broadcast(segments, *at) for at in rays],
    }
    warm = list(side_by_side(works, REPEATS, "us", POSES))
    yield from warm
    note = f"{len(segments)} segments, {laser.rays} rays"
    value = statistics.median(map(cold, where))
    yield Measurement("kernel, cold caches", value, "us", warm[0].reference, (), note)


def drive(*, scans=False, reads=False):
    """Drive with 20 Hz control, 10 Hz scans and 20 Hz reads."""
    world = build_world()
    for step in range(SECONDS * 20):
        if scans and step % 2 == 0:
            world.scan()
        if reads:
            world.odometry()
            world.joint_states()
            world.take_contacts()
            world.take_events()
        world.command(steer(world))
        world.advance(5)


def minutes():
    """Yield CPU of simulated seconds, the world in which nothing moves being the reference."""
    works = {
        "nothing moves": lambda: build_world().advance(SECONDS * 100),
        "physics, 20 Hz control": drive,
        "  with 10 Hz scans": lambda: drive(scans=True),
        "  with 20 Hz reads": lambda: drive(reads=True),
        "  with both": lambda: drive(scans=True, reads=True),
    }
    took = in_turns(works, REPEATS, time.thread_time)
    rest, *others = (
        (name, 1e3 * statistics.median(times) / SECONDS) for name, times in took.items()
    )
    for name, value in others:
        speed = f"{1e3 / value:.0f} x real time"
        yield Measurement(f"{name}, a second", value, "CPU ms", Reference(*rest), (), speed)
