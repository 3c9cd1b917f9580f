"""What every part of the daemon is given: its clock and its log.

A clock that is set back an hour would keep leases alive for an hour, one set forward would end
them all at once. Leases and graces are measured on a clock that only follows the wall clock when
it is told to, and whoever tells it moves them along by as much.
"""

from __future__ import annotations

import json
import logging
import logging.handlers
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

_STEP: Final = 0.5
"""Seconds; less than this between two looks is a clock being disciplined, not set."""
_LARGEST: Final = 4 * 2**20
_OLD_FILES: Final = 3


class DaemonClock:
    """Seconds since the epoch that pass evenly between calls of :meth:`follow_wall_clock`."""

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

    def follow_wall_clock(self) -> float:
        """Go on with what the wall clock says now; returns by how much it was set [s], else 0.

        A machine that slept looks the same as a clock that was set forward.
        """
        before = self._offset
        self._offset = self._wall() - self._steady()
        moved = self._offset - before
        return moved if abs(moved) > _STEP else 0.0


class EventLog:
    """Writes events of the daemon to ``daemon.log``; safe to use from any thread."""

    def __init__(self, path: Path) -> None:
        self._handler = logging.handlers.RotatingFileHandler(
            path, maxBytes=_LARGEST, backupCount=_OLD_FILES, encoding="utf-8"
        )

    def write(self, event: str, **fields: object) -> None:
        """Add a line ``{"at": ..., "event": event, ...fields}``."""
        line = json.dumps({"at": round(time.time(), 3), "event": event, **fields}, default=str)
        # The handler alone, no logger: it has the lock and the rotation that is wanted of it, and
        # whatever a library configures for logging cannot reach this file.
        self._handler.handle(logging.makeLogRecord({"msg": line}))

    def close(self) -> None:
        """Close the file."""
        self._handler.close()
