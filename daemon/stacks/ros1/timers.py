"""Timers: rates and periods of the original's nodes, in simulated time [s].

Instants are sums of steps of 10 ms in binary floating point, so 0.3 may be 0.30000000000000004:
what is due at an instant is due within :data:`TIME_TOLERANCE` of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

TIME_TOLERANCE: Final = 1e-9
"""Far below a step and far above the rounding of an hour's sum of steps [s]."""


def is_after(now: float, limit: float) -> bool:
    """Tell whether ``now`` is later than ``limit`` [s], and not only by how it is rounded.

    The original counts whole nanoseconds, in which 0.7 and 0.1 more are 0.8 and no later.
    """
    return now > limit + TIME_TOLERANCE


@dataclass(slots=True)
class UpdateTimer:
    """Instants of something that runs at ``rate`` [Hz]: the first ones not before k / rate."""

    rate: float
    count: int = 0

    def due(self, now: float) -> bool:
        """Tell whether it runs at ``now``, and move on if so."""
        # From the count, not by adding periods: 1 / rate is rarely a binary fraction.
        if now < self.count / self.rate - TIME_TOLERANCE:
            return False
        self.count += 1
        return True


@dataclass(slots=True)
class MinimumInterval:
    """Lets something happen at most once in ``period`` seconds, counted from when it did."""

    period: float
    due: float = 0.0

    def begin(self, now: float) -> bool:
        """Tell whether it may happen at ``now``, and count from there if so."""
        if now < self.due - TIME_TOLERANCE:
            return False
        self.restart(now)
        return True

    def restart(self, now: float) -> None:
        """Say that it has happened at ``now``."""
        self.due = now + self.period


@dataclass(slots=True)
class LoopRate:
    """``ros::Rate`` of roscpp: when a loop runs again.

    A loop that is late runs at once, again and again until it has caught up; what it is late by
    more than a whole period is forgotten.
    """

    period: float
    due: float

    def is_over(self, now: float) -> bool:
        """Tell whether the loop runs at ``now``."""
        return now >= self.due - TIME_TOLERANCE

    def sleep(self, now: float) -> None:
        """Say that a round of the loop is done at ``now``."""
        self.due += self.period
        if is_after(now, self.due + self.period):
            self.due = now


@dataclass(slots=True)
class RosRate:
    """``rospy.Rate``: how long is left of a period, without drifting and without catching up."""

    period: float
    last: float

    def sleep(self, now: float) -> float:
        """Return until when [s] a call at ``now`` sleeps, which may be before ``now``."""
        until = self.last + self.period
        self.last = until
        if now - self.last > 2.0 * self.period:
            self.last = now
        return until
