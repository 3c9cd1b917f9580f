"""2D world: pymunk space, robot, doors, laser, behaviours."""

from daemon.simulator._building import RobotContact, WorldEvent
from daemon.simulator._world import World

__all__ = [
    "RobotContact",
    "World",
    "WorldEvent",
]
