"""Distances between the robot and what triggers watch."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from daemon.simulator._geometry import convex_distance, ring_array, transform_array
from daemon.simulator._joints import JointDrive
from daemon.simulator._links import WORLD, Assembly
from grammars.values import Floats, Point2, Pose2

_OVERRUN = 0.05
"""How far a sliding joint may overrun its limits, generously [m]."""

_COMPLIANCE = 0.002
"""More than loaded joints give way without their position changing [m]."""


class Proximity:
    """The distance a trigger watches, and safe bounds on when it need not be watched.

    ``of``: ``hinge`` is the anchor of a revolute joint, or the object's origin for a prismatic
    one; ``foot`` is that origin; ``leaf`` the nearest point of the moving link; ``doorway`` a
    fixed point.
    """

    def __init__(
        self,
        drive: JointDrive,
        assembly: Assembly,
        of: Literal["hinge", "foot", "leaf", "doorway"],
        to: Literal["base", "footprint"],
        doorway: Point2 | None,
        footprint: Floats,
    ) -> None:
        motion, joint = drive.motion, drive.motion.joint
        self._of, self._to, self._doorway = of, to, doorway
        self._parent, self._child = drive.parent, drive.child
        self._turns = joint.kind == "revolute"
        foot = joint.anchor if self._turns and of != "foot" else (0.0, 0.0)
        self._foot = motion.frame.apply(foot)
        self._stands = of == "doorway" or motion.parent == WORLD
        self._outlines = [
            ring_array(ring) for p in assembly.placements if p.owner == motion.owner
            for ring in p.rings
        ]  # fmt: skip
        # The watched distance is the one from the base origin to the centre, less at most
        # ``nearer`` and plus at most ``farther``; corners of the leaf have the lever ``lever``.
        self._nearer = self._farther = self._lever = 0.0
        if to == "footprint":
            self._nearer += float(np.hypot(*footprint.T).max())
            self._farther += float(convex_distance(np.zeros((1, 2)), footprint))
        if of == "leaf":
            levers = np.hypot(*(np.concatenate(self._outlines) - np.array(foot)).T)
            travel = 0.0 if self._turns else max(abs(joint.lower), abs(joint.upper)) + _OVERRUN
            self._lever = float(levers.max())
            self._nearer += self._lever + travel
            self._farther += float(levers.min()) + travel
        self._seen = (0.0, 0.0, 0.0)

    def _centre(self) -> Point2:
        if self._doorway is not None:
            return self._doorway
        x, y = self._parent.local_to_world(self._foot)
        return (x, y)

    def distance(self, base: Pose2, footprint: Floats) -> float:
        """Return the watched distance [m]; ``footprint`` is the robot's outline in the world."""
        robot = footprint if self._to == "footprint" else np.array([[base.x, base.y]])
        if self._of != "leaf":
            return float(convex_distance(np.array([self._centre()]), robot))
        self._seen = (*self._child.position, self._child.angle)
        frame = Pose2(*self._seen)
        return min(
            float(convex_distance(transform_array(frame, outline), robot))
            for outline in self._outlines
        )

    def far_slack(self, base: Pose2, threshold: float, *, inside: bool) -> float:
        """Return a way the base origin may move before the distance can cross ``threshold``.

        Holds however the robot turns and the leaf moves, by the triangle inequality; 0 where no
        such bound holds. ``inside``: the distance is to grow beyond the threshold, not to fall
        below it.
        """
        if not self._stands:
            return 0.0
        x, y = self._centre()
        distance = math.hypot(base.x - x, base.y - y)
        if inside:
            return threshold - distance - self._farther - _COMPLIANCE
        return distance - self._nearer - threshold

    def near_slack(self, distance: float, threshold: float) -> float:
        """Return the motion that leaves a distance just measured on its side of ``threshold``.

        Motion is that of the base origin, of the fastest point of the footprint around it, and
        what ``moved`` says.
        """
        return abs(distance - threshold) - _COMPLIANCE if self._stands else 0.0

    def moved(self) -> float:
        """Return a bound on how far the leaf moved since its distance was measured [m]."""
        if self._of != "leaf":
            return 0.0
        if self._turns:
            return abs(self._child.angle - self._seen[2]) * self._lever
        x, y = self._child.position
        return math.hypot(x - self._seen[0], y - self._seen[1])
