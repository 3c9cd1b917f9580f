"""When a waypoint counts as reached."""

from __future__ import annotations

import math
from typing import Final

from grammars.mission import Waypoint
from grammars.values import Pose2, wrap_angle

_SETTLING: Final = 2.0
"""Within tolerance for this long counts as there, even if it could come closer [s]."""


class Arrival:
    """Watches one waypoint: first the position, then the heading if it has one.

    The robot drives on to half the tolerance, so that the error of its localisation has room;
    if it comes no closer within two seconds, the tolerance itself is enough.

    Attributes:
        turning: the position is reached, the heading is not yet.
    """

    def __init__(self, goal_tolerance: float, yaw_tolerance: float) -> None:
        self._goal_tolerance, self._yaw_tolerance = goal_tolerance, yaw_tolerance
        self._since: float | None = None
        self.turning = False

    def renew(self) -> None:
        """Begin with the next waypoint."""
        self.turning, self._since = False, None

    def check(self, now: float, pose: Pose2, goal: Waypoint) -> bool:
        """Tell whether ``goal`` is reached at ``pose``."""
        away = math.hypot(goal.x - pose.x, goal.y - pose.y)
        if away > self._goal_tolerance * (1.5 if self.turning else 1.0):
            self.renew()
            return False
        if self._since is None:
            self._since = now
        settled = now - self._since >= _SETTLING
        if not (self.turning or settled or away <= 0.5 * self._goal_tolerance):
            return False
        if goal.yaw is None:
            return True
        if not self.turning:
            self.turning, self._since, settled = True, now, False
        error = abs(wrap_angle(goal.yaw - pose.yaw))
        return error <= (1.0 if settled else 0.5) * self._yaw_tolerance
