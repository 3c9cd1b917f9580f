"""2D world: pymunk space, robot, doors, laser, behaviours."""

from daemon.simulator._world import World
