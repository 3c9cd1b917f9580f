"""Simulated seconds per CPU second in a corridor with 20 hinged doors, and where they go.

Run with ``python -m tests.benchmarks.bench_world``. Configurations take turns in one process, and
a fixed piece of work (500 Gaussian numbers) is timed along as a yardstick of the machine's speed.
"""

from __future__ import annotations

import statistics
import time

import numpy as np

from daemon.simulator import World, warm_up
from tests.benchmarks.corridor import build_world, steer
from tests.daemon.simulator.reference import world_segments

SECONDS = 60
REPEATS = 7


def drive(world: World, *, scans: bool, reads: bool) -> float:
    """Drive one minute with 20 Hz control, 10 Hz scans and 20 Hz reads; return CPU ms per s."""
    begin = time.thread_time()
    for step in range(SECONDS * 20):
        if scans and step % 2 == 0:
            world.scan()
        if reads:
            world.odometry()
            world.joint_positions()
            world.joint_velocities()
            world.take_contacts()
            world.take_events()
        world.command(steer(world))
        world.advance(5)
    return (time.thread_time() - begin) / SECONDS * 1e3


def idle() -> float:
    """Return CPU ms per simulated second of a world in which nothing moves."""
    world = build_world()
    begin = time.thread_time()
    world.advance(SECONDS * 100)
    return (time.thread_time() - begin) / SECONDS * 1e3


def build() -> float:
    """Return CPU ms for building the world."""
    begin = time.thread_time()
    build_world()
    return (time.thread_time() - begin) * 1e3


def yardstick() -> float:
    """Return CPU microseconds for 500 Gaussian numbers."""
    generator, numbers = np.random.default_rng(0), np.empty(500)
    begin = time.thread_time()
    for _ in range(2000):
        generator.standard_normal(out=numbers)
    return (time.thread_time() - begin) / 2000 * 1e6


def main() -> None:
    """Print the table."""
    warm_up()
    rows: dict[str, list[float]] = {}
    for _ in range(REPEATS):
        for name, value in (
            ("yardstick", yardstick()),
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
    print(f"corridor 60 m, {len(world.joint_names)} doors, {count} laser segments, 500 rays")
    print(f"yardstick                 {median['yardstick']:8.2f} us per 500 Gaussian numbers")
    print(f"build                     {median['build']:8.2f} ms")
    print(f"nothing moves             {median['idle']:8.3f} ms per simulated second")
    print(f"physics, 20 Hz control    {median['physics']:8.3f}")
    print(f"10 Hz scans on top        {median['scans'] - median['physics']:8.3f}")
    print(f"20 Hz reads on top        {median['reads'] - median['physics']:8.3f}")
    for name in ("scans", "all"):
        low, middle = 1e3 / median[name], 1e3 / min(rows[name])
        print(f"{name:10} {low:8.0f} simulated s per CPU s (median), {middle:.0f} (best)")


if __name__ == "__main__":
    main()
