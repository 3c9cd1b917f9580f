"""Setting a joint at once, as far as the robot lets it."""

from __future__ import annotations

import math

import numpy as np
import pymunk

from daemon.simulator._geometry import convex_distance, ring_array, transform_array
from daemon.simulator._joints import JointDrive
from daemon.simulator._links import Assembly
from grammars.values import Floats, Pose2

_STEP = 0.02
"""Largest move of a point between two tests of a blocked jump [m]."""
_RESOLUTION = 1e-4
"""How closely a blocked jump approaches the robot [m]."""


class Jumper:
    """Teleports the part of an object that hangs on one joint.

    A target that is clear of the robot is reached at once, whatever lies between: that is what a
    jump is. A target inside the robot is not: the part then sweeps from where it is towards the
    target and stays at the first touch, where the physics takes over and the contact is recorded.
    """

    def __init__(self, drive: JointDrive, assembly: Assembly) -> None:
        self._drive = drive
        slots = assembly.behind(drive.motion.child)
        self._bodies = [assembly.bodies[slot] for slot in slots]
        solid = set(assembly.owners.values())
        self._outlines = [
            (assembly.bodies[slot], ring_array(ring))
            for slot in slots
            for placement in assembly.placements_on(slot)
            if placement.owner in solid
            for ring in placement.rings
        ]

    def jump(self, target: float, footprint: Floats) -> float:
        """Move to ``target`` or as far as possible; return the position reached.

        ``footprint`` is the robot's outline in the world, shape (n, 2).
        """
        start = self._drive.position()
        way = target - start
        reached = target
        if self._hits(way, footprint):
            reached = start + self._free_way(way, footprint)
        self._place(reached - start)
        return reached

    def _free_way(self, way: float, footprint: Floats) -> float:
        if self._hits(0.0, footprint):
            return 0.0
        reach = self._reach()
        steps = max(1, math.ceil(abs(way) * reach / _STEP))
        low = high = 0.0
        for k in range(1, steps + 1):
            high = way * k / steps
            if self._hits(high, footprint):
                break
            low = high
        while abs(high - low) * reach > _RESOLUTION:
            middle = 0.5 * (low + high)
            if self._hits(middle, footprint):
                high = middle
            else:
                low = middle
        return high

    def _reach(self) -> float:
        """Return the way [m] of the fastest point per unit of joint motion."""
        motion = self._drive.motion
        if motion.joint.kind == "prismatic":
            return 1.0
        hinge = np.array(self._drive.hinge())
        outlines = self._world_outlines(Pose2())
        return max(float(np.hypot(*(outline - hinge).T).max()) for outline in outlines)

    def _move(self, way: float) -> Pose2:
        """Return the rigid motion of the part in the world for a joint displacement."""
        motion, parent = self._drive.motion, self._drive.parent
        if motion.joint.kind == "prismatic":
            x, y = pymunk.Vec2d(*motion.axis).rotated(parent.angle) * way
            return Pose2(x, y, 0.0)
        x, y = self._drive.hinge()
        return Pose2(x, y, 0.0) @ Pose2(0.0, 0.0, way) @ Pose2(-x, -y, 0.0)

    def _world_outlines(self, move: Pose2) -> list[Floats]:
        return [
            transform_array(move @ Pose2(*body.position, body.angle), outline)
            for body, outline in self._outlines
        ]

    def _hits(self, way: float, footprint: Floats) -> bool:
        outlines = self._world_outlines(self._move(way))
        return any(convex_distance(outline, footprint) == 0.0 for outline in outlines)

    def _place(self, way: float) -> None:
        move = self._move(way)
        turn = 0.0 if self._drive.motion.joint.kind == "prismatic" else way
        for body in self._bodies:
            position = move.apply((body.position.x, body.position.y))
            body.angle += turn
            body.position = position
            body.velocity, body.angular_velocity = (0.0, 0.0), 0.0
            if body.space is not None:
                body.space.reindex_shapes_for_body(body)
