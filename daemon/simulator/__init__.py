"""The 2D world: pymunk space, robot, doors, laser, behaviour controllers.

The first call in a process loads or compiles machine code (about a second); workers call
``warm_up`` once before they fork.
"""

from daemon.simulator._records import Contact, WorldEvent
from daemon.simulator._warmup import warm_up
from daemon.simulator._world import World

__all__ = ["Contact", "World", "WorldEvent", "warm_up"]
