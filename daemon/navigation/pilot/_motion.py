"""Whether the robot gets anywhere, and how often it tried to get free."""

from __future__ import annotations

import math
from typing import Final

from grammars.values import Pose2, wrap_angle

_STUCK: Final = 4.0
"""Standing for this long, a robot that wants to move is stuck [s]."""
_MOVED: Final = 0.1
_TURNED: Final = 0.2
"""Less motion than this counts as standing [m, rad]."""
_FURTHER: Final = 1.5
"""So far from where it was stuck, the count of attempts starts anew [m]."""


class Motion:
    """Remembers when and where the robot last moved.

    Attributes:
        attempts: how often it tried to get free around here.
    """

    def __init__(self, start: Pose2) -> None:
        self._at, self._time = start, 0.0
        self._stuck_at = start
        self.attempts = 0

    def note(self, now: float, pose: Pose2) -> None:
        """Count from now: it moved, or stands for a reason."""
        self._at, self._time = pose, now

    def note_attempt(self, pose: Pose2) -> None:
        """Count an attempt to get free."""
        if self.attempts == 0:
            self._stuck_at = pose
        self.attempts += 1

    def standing(self, now: float) -> float:
        """Return for how long it has not moved [s]."""
        return now - self._time

    def is_stuck(self, now: float, pose: Pose2) -> bool:
        """Take the pose at ``now`` and tell whether the robot is stuck."""
        away = math.hypot(pose.x - self._at.x, pose.y - self._at.y)
        if away > _MOVED or abs(wrap_angle(pose.yaw - self._at.yaw)) > _TURNED:
            self.note(now, pose)
        far = math.hypot(pose.x - self._stuck_at.x, pose.y - self._stuck_at.y) > _FURTHER
        if self.attempts and far:
            self.attempts = 0
        return self.standing(now) > _STUCK
