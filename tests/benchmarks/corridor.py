"""The corridor scene of the benchmarks: 60 m long, 20 hinged doors that the robot brushes open."""

import math

import numpy as np

from daemon.simulator import World
from grammars.model.geometry import Pose2, Twist2
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot
from grammars.model.scene import Joint, Link, Scene, SceneObject, Solid

LENGTH = 60.0
HALF_WIDTH = 1.125
DOORS = 20
SPEED = 0.8


def _box(x1, y1, x2, y2):
    return ((x1, y1), (x2, y1), (x2, y2), (x1, y2))


def _side(sign, prefix, length, pieces):
    """One wall with recesses every 4 m, on the left with columns, as separate convex pieces.

    Each of these along the wall is cut into so many ``pieces`` again.
    """
    inner, outer = sign * HALF_WIDTH, sign * (HALF_WIDTH + 0.3)
    niche = sign * (HALF_WIDTH + 0.15)
    parts = []

    def add(kind, x1, x2, y1, y2):
        low, high = min(y1, y2), max(y1, y2)
        for k in range(pieces):
            left, right = x1 + k * (x2 - x1) / pieces, x1 + (k + 1) * (x2 - x1) / pieces
            name = f"{prefix}-{kind}-{len(parts)}"
            parts.append(Solid(name, "wall", _box(left, low, right, high), 0.0, 2.5))

    x = -1.0
    while x < length:
        add("wall", x, x + 3.0, inner, outer)
        if sign > 0.0:
            add("column", x + 0.9, x + 1.1, inner - 0.1, inner)
        add("niche", x + 3.0, x + 4.0, niche, outer)
        x += 4.0
    return parts


def scene(length=LENGTH, doors=DOORS, pieces=1):
    """Return a corridor with walls, niches, columns, ends and doors that stand into it."""
    solids = _side(1.0, "left", length, pieces) + _side(-1.0, "right", length, pieces)
    solids.append(Solid("end", "wall", _box(length + 1.0, -1.5, length + 1.3, 1.5), 0.0, 2.5))
    solids.append(Solid("begin", "wall", _box(-1.3, -1.5, -1.0, 1.5), 0.0, 2.5))
    leaf = Link("leaf", (_box(-0.02, 0.0, 0.02, 0.9),), 15.0, 0.0, 2.0)
    hinge = Joint(
        "hinge", "revolute", "world", "leaf", (0.0, 0.0), (0.0, 0.0), -1.6, 1.6, 0.5, 1.0, 4.0
    )  # fmt: skip
    objects = []
    for k in range(doors):
        left = k % 2 == 0
        pose = Pose2(2.5 + 2.8 * k, HALF_WIDTH if left else -HALF_WIDTH, math.pi if left else 0.0)
        objects.append(SceneObject(f"door-{k}", "door", pose, (leaf,), (hinge,), (0.0,)))
    return Scene("corridor", (), (), tuple(solids), tuple(objects))


def robot():
    """Return a robot of the size of the paper's, with a 500-ray laser over 270 degrees."""
    return Robot(
        "bench", _box(-0.35, -0.233, 0.35, 0.233), 0.29, 150.0,
        Drive("omnidirectional", 1.0, 1.0, 2.0, 1.0, 1.0, 4.0, 300.0, 120.0, 0.0),
        Laser(
            Mount(0.3, 0.0, 0.0), 0.3, -0.75 * math.pi, 0.75 * math.pi, 500, 0.05, 30.0, 10.0,
            0.01, 0.0,
        ),
        OdometryNoise(20.0, 0.01, 0.01, 0.01),
    )  # fmt: skip


def build_world():
    """Return a fresh world with the robot at the west end."""
    return World(scene(), robot(), Pose2(), (), np.random.SeedSequence(1))


def steer(world):
    """Return a weaving drive along the corridor, turning back at the ends (20 Hz)."""
    pose = world.pose()
    east = (world.time * SPEED) % (2.0 * (LENGTH - 2.0)) < LENGTH - 2.0
    heading = (0.0 if east else math.pi) + 0.25 * math.sin(0.8 * world.time)
    heading -= 0.6 * pose.y * (1.0 if east else -1.0)
    error = math.remainder(heading - pose.yaw, math.tau)
    return Twist2(SPEED if abs(error) < 1.0 else 0.0, 0.0, max(-1.5, min(1.5, 2.0 * error)))
