import hashlib
import math
from dataclasses import replace

import numpy as np

from daemon.simulator import World
from daemon.simulator import _chipmunk as chipmunk
from grammars.model.behaviour import Jump, KeyFrame, KeyFrames, Servo, Trigger
from grammars.model.geometry import Pose2, Twist2
from grammars.model.robot import OdometryNoise
from tests.engine.simulator.reference import true_ranges
from tests.engine.simulator.scenes import ROBOT, door, scene, sliding_door, wall


def digest(seed):
    """Hash everything a run produces."""
    robot = replace(
        ROBOT, laser=replace(ROBOT.laser, noise=0.01, dropout=0.02),
        odometry=OdometryNoise(20.0, 0.02, 0.02, 0.02),
    )  # fmt: skip
    parts = (
        wall("north", -2.0, 1.2, 20.0, 1.4), wall("south", -2.0, -1.4, 20.0, -1.2),
        *(door(f"door-{k}", Pose2(2.0 + 2.0 * k, 1.2, math.pi), friction=0.3) for k in range(5)),
        sliding_door("slider", Pose2(13.0, -0.5, 0.0)),
    )  # fmt: skip
    behaviours = (
        KeyFrames("door-1.hinge", (KeyFrame(2.0, 0.9), KeyFrame(4.0, 0.1)), Jump()),
        Trigger("door-3.hinge", 0.0, 1.2, 2.0, Servo(), of="leaf", to="footprint", rearm=3.0),
    )
    world = World(scene(*parts), robot, Pose2(), behaviours, np.random.SeedSequence(seed))
    state = hashlib.sha256()
    for step in range(400):
        world.command(Twist2(0.8, 0.0, 0.6 * math.sin(0.1 * step) - 0.5 * world.pose().yaw))
        world.advance(5)
        odometry = world.odometry()
        state.update(repr((world.pose(), world.twist(), odometry)).encode())
        state.update(b"".join(part.tobytes() for part in world.joint_states()))
        if step % 2 == 0:
            state.update(world.scan().tobytes() + true_ranges(world).tobytes())
        state.update(repr((world.take_contacts(), world.take_events())).encode())
    return state.hexdigest()


def test_the_seed_matters_and_is_not_used_up():
    assert digest(3) == digest(3)
    assert digest(3) != digest(4)
    seed = np.random.SeedSequence(5)
    World(scene(), ROBOT, Pose2(), (), seed)
    assert seed.n_children_spawned == 0


def test_a_world_is_the_same_by_the_steps_of_pymunk(monkeypatch):
    """With doors, contacts, triggers and jumps: callbacks reach Python in either kind of step."""
    direct = digest(5)
    monkeypatch.setattr(chipmunk, "stepper", lambda space: lambda: space.step(0.01))
    assert digest(5) == direct
