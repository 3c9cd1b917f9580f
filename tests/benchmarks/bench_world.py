"""Simulated seconds per CPU second in a corridor with 20 hinged doors, and where they go.

Configurations take turns in one process, and a fixed piece of work (500 Gaussian numbers) is timed
along, which is what the noise of a scan takes at least.
"""

import statistics
import time

import numpy as np

from tests.benchmarks.corridor import build_world, steer
from tests.benchmarks.measurement import Measurement, Reference
from tests.engine.simulator.reference import world_segments
from tests.kernels import load_all

SECONDS = 60
REPEATS = 7


def drive(world, *, scans, reads):
    """Drive one minute with 20 Hz control, 10 Hz scans and 20 Hz reads; return CPU ms per s."""
    begin = time.thread_time()
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
    return (time.thread_time() - begin) / SECONDS * 1e3


def idle():
    """Return CPU ms per simulated second of a world in which nothing moves."""
    world = build_world()
    begin = time.thread_time()
    world.advance(SECONDS * 100)
    return (time.thread_time() - begin) / SECONDS * 1e3


def build():
    """Return CPU ms for building the world."""
    begin = time.thread_time()
    build_world()
    return (time.thread_time() - begin) * 1e3


def gaussians():
    """Return CPU microseconds for 500 Gaussian numbers."""
    generator, numbers = np.random.default_rng(0), np.empty(500)
    begin = time.thread_time()
    for _ in range(2000):
        generator.standard_normal(out=numbers)
    return (time.thread_time() - begin) / 2000 * 1e6


def measure():
    """Yield each configuration, the world in which nothing moves being the reference."""
    load_all()
    rows = {}
    for _ in range(REPEATS):
        for name, value in (
            ("gaussians", gaussians()),
            ("build", build()),
            ("idle", idle()),
            ("physics", drive(build_world(), scans=False, reads=False)),
            ("scans", drive(build_world(), scans=True, reads=False)),
            ("reads", drive(build_world(), scans=False, reads=True)),
            ("all", drive(build_world(), scans=True, reads=True)),
        ):
            rows.setdefault(name, []).append(value)
    median = {name: statistics.median(values) for name, values in rows.items()}
    world = build_world()
    count = len(world_segments(world))
    sizes = f"{len(world.joint_names)} doors, {count} laser segments, 500 rays"
    rest, physics = Reference("at rest", median["idle"]), Reference("physics", median["physics"])
    yield Measurement("500 Gaussian numbers", median["gaussians"], "us", None, (), sizes)
    yield Measurement(
        "world built", median["build"], "ms", Reference("a second of physics", physics.value)
    )
    yield Measurement("nothing moves, a simulated second", rest.value, "ms", physics)
    yield Measurement("physics, 20 Hz control", physics.value, "ms", rest)
    for name, label in (
        ("scans", "  with 10 Hz scans"), ("reads", "  with 20 Hz reads"), ("all", "  with both")
    ):  # fmt: skip
        speed = f"{1e3 / median[name]:.0f} x real time, best {1e3 / min(rows[name]):.0f}"
        yield Measurement(label, median[name], "ms", physics, (), speed)
