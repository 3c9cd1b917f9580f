"""Compiles or loads the machine code of this room."""

from __future__ import annotations

import numpy as np

from daemon.simulator._world import World
from grammars.behaviour import Servo, Trigger
from grammars.robot import Drive, Laser, OdometryNoise, Robot
from grammars.scene import Joint, Link, Scene, SceneObject, Solid
from grammars.values import Pose2, Ring

_SQUARE: Ring = ((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2))


def warm_up() -> None:
    """Load every kernel once by running a tiny world, so that forked workers start hot."""
    leaf = Link("leaf", (_SQUARE,), 1.0, 0.0, 2.0)
    hinge = Joint("hinge", "revolute", "world", "leaf", (-0.2, -0.2), (0.0, 0.0), 0.0, 1.0)
    door = SceneObject("door", "door", Pose2(2.0, 0.0, 0.0), (leaf,), (hinge,), (0.0,))
    wall = Solid("wall", "wall", tuple((x - 2.0, y) for x, y in _SQUARE), 0.0, 2.0)
    robot = Robot(
        "warm-up", _SQUARE, 0.5, 10.0,
        Drive("omnidirectional", 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 100.0, 100.0, 0.0),
        Laser(Pose2(), 0.2, -1.0, 1.0, 3, 0.1, 5.0, 10.0, 0.01, 0.01),
        OdometryNoise(20.0, 0.01, 0.01, 0.01),
    )  # fmt: skip
    near = Trigger("door.hinge", 0.0, 0.5, 5.0, Servo(), of="leaf", to="footprint")
    scene = Scene("warm-up", (), (), (wall,), (door,))
    world = World(scene, robot, Pose2(), (near,), np.random.SeedSequence(0))
    world.advance(2)
    world.scan()
    world.true_ranges()
    world.joint_positions()
