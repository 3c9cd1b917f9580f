"""Time step, contact parameters and who collides with whom."""

from __future__ import annotations

import pymunk

TICK_RATE = 100
"""Physics ticks per simulated second."""
DT = 1.0 / TICK_RATE

FRICTION = 0.5
"""Coulomb friction of every surface; two surfaces in contact multiply to 0.25."""

ROBOT_TYPE = 1
"""Collision type of the robot, the only one whose contacts are recorded."""

_ROBOT, _BUILDING, _FIXED, _MOVING, _WALKING = 1, 2, 4, 8, 16

ROBOT_FILTER = pymunk.ShapeFilter(categories=_ROBOT)
BUILDING_FILTER = pymunk.ShapeFilter(categories=_BUILDING, mask=_ROBOT)


def link_filter(group: int, *, moves: bool) -> pymunk.ShapeFilter:
    """Return the filter of a link of object number ``group`` (from 1).

    Moving links meet the robot and the links of other objects. They ignore walls, columns and
    dividers: a leaf stands in its jamb and a sliding panel runs into its wall by design, and how
    far a leaf may go is said by the limits of its joint. Links of one object ignore each other
    for the same reason.
    """
    if moves:
        return pymunk.ShapeFilter(group, _MOVING, _ROBOT | _FIXED | _MOVING)
    return pymunk.ShapeFilter(group, _FIXED, _ROBOT | _MOVING)


def walker_filter(group: int) -> pymunk.ShapeFilter:
    """Return the filter of a mover's body: it meets the robot alone.

    Nothing stops a mover, so between it and a leaf at its limit the hinge would break.
    """
    return pymunk.ShapeFilter(group, _WALKING, _ROBOT)
