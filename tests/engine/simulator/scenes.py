"""Small hand-built worlds for the tests of the simulator, and independent ways to scan them."""

import math
from dataclasses import replace

import numpy as np

from daemon.simulator import World
from grammars.model.behaviour import Walk
from grammars.model.geometry import Pose2
from grammars.model.movers import with_planar_chain
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot
from grammars.model.scene import Doorway, Joint, Link, Scene, SceneObject, Solid


def box(x1, y1, x2, y2):
    return ((x1, y1), (x2, y1), (x2, y2), (x1, y2))


def wall(name, x1, y1, x2, y2, z=2.5):
    return Solid(name, "wall", box(x1, y1, x2, y2), 0.0, z)


DRIVE = Drive("omnidirectional", 1.0, 1.0, 2.0, 1.0, 1.0, 4.0, 300.0, 120.0, 0.0)
LASER = Laser(Mount(0.3, 0.0, 0.0), 0.3, -1.5, 1.5, 61, 0.05, 10.0, 10.0, 0.0, 0.0)
ROBOT = Robot(
    "brick", box(-0.35, -0.233, 0.35, 0.233), 0.29, 150.0, DRIVE, LASER,
    OdometryNoise(20.0, 0.0, 0.0, 0.0),
)  # fmt: skip


IMPOSED = replace(
    ROBOT,
    drive=Drive("omnidirectional", *[math.inf] * 8, 0.0, "imposed", 0.0098, 0.047),
    odometry=OdometryNoise(1.0 / 0.051, 0.0, 0.0, 0.0, 0.051, "mean", "map"),
)
"""The robot of the published worlds: its velocity is imposed, and the ground takes its share."""
ORIGIN, FAR = Pose2(), Pose2(0.0, 50.0)
LINE = Walk("visitor", ((-3.0, 0.0), (3.0, 0.0)), 0.8)
ROUND = tuple((0.25 * math.cos(a), 0.25 * math.sin(a)) for a in np.linspace(0, 6, 12))


def differential():
    return replace(ROBOT, drive=replace(DRIVE, kind="differential"))


def person(name="visitor", pose=FAR, ring=ROUND):
    links, joints = with_planar_chain((Link("body", (ring,), 75.0, 0.0, 1.7),), (), "body")
    return SceneObject(name, "person", pose, links, joints, (0.0, 0.0, 0.0))


def door(name="door", pose=ORIGIN, initial=0.0, *, mass=10.0, frozen=False, doorway="", **hinge):
    """A hinged door: post at the origin, closed leaf along +y, opens towards -x, 0 to 2 rad."""
    post = Link("post", (box(-0.025, -0.025, 0.025, 0.025),), 100.0, 0.0, 2.0)
    leaf = Link("leaf", (box(-0.025, 0.035, 0.025, 0.965),), mass, 0.0, 2.0)
    joint = Joint(
        "hinge", "revolute", "post", "leaf", (-0.025, 0.025), (0.0, 0.0), 0.0, 2.0, **hinge
    )
    return SceneObject(name, "door", pose, (post, leaf), (joint,), (initial,), frozen, doorway)


def sliding_door(name="slider", pose=ORIGIN, initial=0.0, **rail):
    """A panel closed along +y from 0 to 1, which slides towards +y, 0 to 1 m."""
    panel = Link("panel", (box(-0.025, 0.0, 0.025, 1.0),), 10.0, 0.0, 2.0)
    joint = Joint(
        "rail", "prismatic", "world", "panel", (0.0, 0.0), (0.0, 1.0), 0.0, 1.0, **rail
    )  # fmt: skip
    return SceneObject(name, "slider", pose, (panel,), (joint,), (initial,))


def folding(name, pose):
    """A bi-fold door: leaf ``a`` hinged to the world at the origin, ``b`` to the end of ``a``."""
    a = Link("a", (box(-0.02, 0.0, 0.02, 0.5),), 8.0, 0.0, 2.0)
    b = Link("b", (box(-0.02, 0.5, 0.02, 1.0),), 8.0, 0.0, 2.0)
    root = Joint("root", "revolute", "world", "a", (0.0, 0.0), (0.0, 0.0), -2.0, 2.0, 0.5)
    fold = Joint("fold", "revolute", "a", "b", (0.0, 0.5), (0.0, 0.0), -2.5, 2.5, 0.5)
    return SceneObject(name, "folding", pose, (a, b), (fold, root), (0.3, 0.0))


def scene(*parts):
    solids = tuple(p for p in parts if isinstance(p, Solid))
    objects = tuple(p for p in parts if isinstance(p, SceneObject))
    doorways = tuple(p for p in parts if isinstance(p, Doorway))
    return Scene("test", (), doorways, solids, objects)


def world(*parts, robot=ROBOT, start=ORIGIN, behaviours=(), seed=7, waypoints=()):
    seed = np.random.SeedSequence(seed)
    return World(scene(*parts), robot, start, behaviours, seed, waypoints)


def driven(command, ticks, *parts, **options):
    """A world whose robot has followed a command for some ticks."""
    now = world(*parts, **options)
    now.command(command)
    now.advance(ticks)
    return now


def world_segments(world):
    """All laser segments in the world frame, shape (n, 4), moving ones at their present place."""
    plane, table = world._scanner(None)._plane, world._bodies.at(world.tick)
    rows = [tuple(row) for row in plane.static.tolist()]
    for (x1, y1, x2, y2), slot in zip(
        plane.moving.tolist(), plane.moving_slot.tolist(), strict=True
    ):
        frame = Pose2(*table[slot, :3].tolist())
        rows.append((*frame.apply((x1, y1)), *frame.apply((x2, y2))))
    return np.array(rows).reshape(-1, 4)


def true_ranges(world, laser=None):
    """Return the ranges [m] a scan is made from, inf where the laser meets nothing."""
    scanner = world._scanner(laser)
    scanner._cast(world.pose(), world._bodies.at(world.tick), world._bodies.version)
    rays = scanner._rays
    return np.where(rays.inverse > 1.0 / rays.reach, 1.0 / rays.inverse, np.inf)


def ray_angles(laser, base):
    """World directions of all rays [rad]."""
    return (base @ laser.mount).yaw + np.linspace(laser.angle_min, laser.angle_max, laser.rays)


def cast_by_broadcast(segments, origin, angles):
    """Intersect every ray with every segment (closed, no tolerance); inf where none is hit."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    px, py = segments[:, 0] - origin[0], segments[:, 1] - origin[1]
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    with np.errstate(all="ignore"):
        across = c * ey - s * ex
        ranges = (px * ey - py * ex) / across
        along = (px * s - py * c) / across
        hit = (ranges > 0.0) & (along >= 0.0) & (along <= 1.0)
    return np.where(hit, ranges, np.inf).min(axis=1, initial=np.inf)


def near_an_end(segments, origin, angles, width=1e-7):
    """Rays that pass a segment's end within ``width`` radians: a silhouette, either is right."""
    ends = segments.reshape(-1, 2) - np.array(origin)
    bearings = np.arctan2(ends[:, 1], ends[:, 0])
    turn = np.abs(np.angle(np.exp(1j * (angles[:, None] - bearings[None, :]))))
    return np.asarray((turn < width).any(axis=1))
