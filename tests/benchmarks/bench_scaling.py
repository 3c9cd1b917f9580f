"""How costs grow: more rays, particles, doors, walls and people, and nothing worse than linear.

Each case is timed small and large, in turns in one process. The exponent is that of the power of
the size which the time has grown by, log(t2 / t1) / log(n2 / n1): 1 is linear growth, less is what
costs the same however large it is.
"""

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from daemon.run import execute
from daemon.simulator import World
from daemon.stacks.ros1.amcl.node import Amcl
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.quirks import FAST
from grammars.model.behaviour import KeyFrame, KeyFrames, Servo, Walk
from grammars.model.geometry import Pose2
from grammars.model.movers import with_planar_chain
from grammars.model.scene import Link, SceneObject
from tests.benchmarks import bench_kernels, corridor
from tests.benchmarks.bench_run import idle
from tests.benchmarks.measurement import Measurement, Reference, at_most, in_turns
from tests.kernels import load_all
from tests.stacks.ros1.amcl.world import LASER, PUBLISHED, see

TIMES = 5
SECONDS = 30
METRES = 300.0
"""Length of the corridor that a hundred doors need."""
NOISE = 1.05
"""The exponent that linear growth may come out as: caches hold less of what is larger."""


def measure():
    """Yield the exponent of every case."""
    load_all()
    for case in (rays, particles, doors, walls, people):
        yield from case()


def growth(name, sizes, works, nothing=None):
    """Time the same work on something small and large, in turns, less that of ``nothing``."""
    works = dict(zip(("small", "large"), works, strict=True))
    if nothing is not None:
        works["nothing"] = nothing
    for work in works.values():
        work()
    took = {which: min(times) for which, times in in_turns(works, TIMES).items()}
    base = took.get("nothing", 0.0)
    value = math.log(max(took["large"] - base, 1e-9) / max(took["small"] - base, 1e-9))
    value /= math.log(sizes[1] / sizes[0])
    without = f", {1e3 * base:.2f} ms without any taken off" if base else ""
    return Measurement(
        name, value, "exponent", Reference("linear growth", 1.0), (at_most(NOISE),),
        f"{sizes[0]} to {sizes[1]}: {1e3 * took['small']:.2f} to {1e3 * took['large']:.2f} ms"
        f"{without}",
    )  # fmt: skip


def with_rays(robot, count):
    return replace(robot, laser=replace(robot.laser, rays=count))


def world(scene, robot, behaviours=()):
    return World(scene, robot, Pose2(), behaviours, np.random.SeedSequence(1))


def scanning(here, times=100):
    """Scans at one place with fresh noise, every body read and every ray cast again each time."""

    def work():
        for _ in range(times):
            here.tick += 1
            here.scan()

    return work


def stepping(*case):
    """A world from its beginning, scanned ten times a second."""

    def work():
        here = world(*case)
        for _ in range(10 * SECONDS):
            here.scan()
            here.advance(10)

    return work


def running(scene, robot, behaviours=()):
    """A whole run with an idle system under test: simulator, trace, and that read back."""
    spec = replace(
        idle(scene, doors_move=False), robot=robot, behaviours=behaviours, limit=float(SECONDS)
    )

    def work():
        with tempfile.TemporaryDirectory() as folder:
            execute(spec, scene, trace_path=Path(folder) / "run.mcap")

    return work


def rays():
    sizes = (150, 1080)
    scene = corridor.scene()
    robots = [with_rays(corridor.robot(), count) for count in sizes]
    yield growth("rays: a scan", sizes, (scanning(world(scene, one)) for one in robots))
    yield growth("rays: a run", sizes, (running(scene, one) for one in robots))
    building, robot, grid = bench_kernels.building_c()
    updates = (_updates(building, with_rays(robot, count), grid) for count in sizes)
    yield growth("rays: a costmap's update", sizes, updates)


def _updates(scene, robot, grid):
    steps = bench_kernels.drive(scene, robot)[:300]
    parameters = bench_kernels.GLOBAL
    costmap = Costmap(parameters, parameters.padded_footprint(), FAST, grid, bench_kernels.heard)

    def work():
        for base, scan, _ in steps:
            costmap.update(base, (scan,))

    return work


def particles():
    sizes = (500, 5000)
    grid, walls = bench_kernels.corridor()
    poses = [Pose2(bench_kernels.STEP * k, 0.9, 0.0) for k in range(100)]
    scans = [see(walls, pose) for pose in poses]

    def localising(count):
        parameters = replace(PUBLISHED, min_particles=count, max_particles=count)

        def work():
            amcl = Amcl(parameters, FAST, grid, (LASER,), poses[0], np.random.SeedSequence(1))
            for k, (scan, pose) in enumerate(zip(scans, poses, strict=True)):
                amcl.scan(0.1 * k, scan, pose)

        return work

    yield growth("particles: updates of AMCL", sizes, map(localising, sizes))


def doors():
    sizes, robot = (20, 100), corridor.robot()
    scenes = [corridor.scene(METRES, doors=count) for count in sizes]
    cases = [
        (scene, robot, tuple(swings(name, i) for i, name in enumerate(scene.joint_names)))
        for scene in scenes
    ]
    yield growth("doors at rest: a run", sizes, (running(scene, robot) for scene in scenes))
    yield growth("doors that move: a world", sizes, (stepping(*case) for case in cases))
    yield growth("doors that move: a run", sizes, (running(*case) for case in cases))


def swings(joint, number):
    """A door that opens and closes every few seconds."""
    frames = tuple(
        KeyFrame(float(t), 1.5 * (k % 2))
        for k, t in enumerate(range(1 + number % 7, SECONDS, 5), 1)
    )
    return KeyFrames(joint, frames, Servo(1.0, 40.0))


def walls():
    sizes = (1, 10)
    robot = corridor.robot()
    for what, scenes in (
        ("ten times as long", [corridor.scene(corridor.LENGTH * times) for times in sizes]),
        ("in pieces of a tenth", [corridor.scene(pieces=times) for times in sizes]),
    ):
        works = (scanning(world(one, robot)) for one in scenes)
        yield growth(f"walls, {what}: a scan", sizes, works)
        yield growth(f"walls, {what}: a run", sizes, (running(one, robot) for one in scenes))


def people():
    sizes = (2, 10)
    for what, make in (("a world", stepping), ("a run", running)):
        nobody, *some = (make(*crowd(count)) for count in (0, *sizes))
        yield growth(f"people who walk: {what}", sizes, some, nobody)


def crowd(count):
    """The corridor with people who walk up and down in it, a robot, and what they do."""
    ring = tuple((0.2 * math.cos(a), 0.2 * math.sin(a)) for a in np.linspace(0, 6, 12))
    scene = corridor.scene()
    people, walks = [], []
    for k in range(count):
        links, joints = with_planar_chain((Link("body", (ring,), 75.0, 0.0, 1.7),), (), "body")
        x, name = 5.0 * (k + 1), f"person-{k}"
        people.append(SceneObject(name, "person", Pose2(x), links, joints, (0.0, 0.0, 0.0)))
        walks.append(Walk(name, ((x, 0.0), (x + 3.0, 0.3)), 0.8, manner="back-and-forth"))
    return replace(scene, objects=(*scene.objects, *people)), corridor.robot(), tuple(walks)
