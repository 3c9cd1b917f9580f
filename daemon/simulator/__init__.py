"""The 2D world: pymunk space, robot, doors, laser, behaviour controllers.

The first call in a process loads or compiles machine code (about a second); workers call
``warm_up`` once before they fork.
"""

from daemon.simulator._building import RobotContact, WorldEvent
from daemon.simulator._world import World, warm_up

__all__ = [
    "RobotContact",
    "World",
    "WorldEvent",
    "warm_up",
]
