"""Timers: rates and periods of the original's nodes, in simulated time [s].

Instants are sums of steps of 10 ms in binary floating point, so 0.3 may be 0.30000000000000004.
Comparisons of times therefore allow :data:`TIME_TOLERANCE`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

TIME_TOLERANCE: Final = 1e-9
"""Far below a step and far above the rounding of an hour's sum of steps [s]."""


def is_after(now: float, limit: float) -> bool:
    """Tell whether ``now`` is later than ``limit`` [s] by more than rounding.

    The original counts whole nanoseconds, where 0.7 + 0.1 equals 0.8.
    """
    return now > limit + TIME_TOLERANCE


@dataclass(slots=True)
class UpdateTimer:
    """Timer of a task at ``rate`` [Hz]: run k is at the first instant not before k / rate."""

    rate: float
    count: int = 0

    def due(self, now: float) -> bool:
        """Tell whether the task runs at ``now``, and count the run."""
        # Count, do not add periods: 1 / rate is rarely a binary fraction.
        if now < self.count / self.rate - TIME_TOLERANCE:
            return False
        self.count += 1
        return True


@dataclass(slots=True)
class MinimumInterval:
    """Limit of an action to once per ``period`` [s], counted from the last time."""

    period: float
    due: float = 0.0

    def begin(self, now: float) -> bool:
        """Tell whether the action may happen at ``now``, and restart the period if so."""
        if now < self.due - TIME_TOLERANCE:
            return False
        self.restart(now)
        return True

    def restart(self, now: float) -> None:
        """Start a period at ``now``."""
        self.due = now + self.period


@dataclass(slots=True)
class LoopRate:
    """``ros::Rate`` of roscpp.

    A late loop runs at once, repeatedly until it has caught up. A delay beyond a whole period is
    forgotten.
    """

    period: float
    due: float

    def is_over(self, now: float) -> bool:
        """Tell whether the loop runs at ``now``."""
        return now >= self.due - TIME_TOLERANCE

    def sleep(self, now: float) -> None:
        """End a round of the loop at ``now``."""
        self.due += self.period
        if is_after(now, self.due + self.period):
            self.due = now


@dataclass(slots=True)
class RosRate:
    """``rospy.Rate``: the rest of a period, without drift and without catching up."""

    period: float
    last: float

    def sleep(self, now: float) -> float:
        """Return the end [s] of a sleep that begins at ``now``; it may lie in the past."""
        until = self.last + self.period
        self.last = until
        if now - self.last > 2.0 * self.period:
            self.last = now
        return until
