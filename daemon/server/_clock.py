"""The daemon's clock: the wall clock, of which nothing waits for a moment that never comes.

A clock that is set back an hour would keep leases alive for an hour, one set forward would end
them all at once. Leases and graces are measured on a clock that only follows the wall clock when
it is told to, and whoever tells it moves them along by as much.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

_STEP: Final = 0.5
"""Seconds; less than this between two looks is a clock being disciplined, not set."""


class Clock:
    """Wall clock seconds since the epoch that pass evenly between two calls of :meth:`follow`."""

    def __init__(
        self,
        wall: Callable[[], float] = time.time,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        self._wall = wall
        self._steady = steady
        self._offset = wall() - steady()

    def now(self) -> float:
        """The time [s]; safe to ask from any thread."""
        return self._steady() + self._offset

    def follow(self) -> float:
        """Go on with what the wall clock says now; returns by how much it was set [s], else 0.

        A machine that slept looks the same as a clock that was set forward.
        """
        before = self._offset
        self._offset = self._wall() - self._steady()
        moved = self._offset - before
        return moved if abs(moved) > _STEP else 0.0
