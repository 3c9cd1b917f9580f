"""Settings of a daemon, and its log of events."""

from __future__ import annotations

import json
import logging
import os
import time
from dataclasses import dataclass
from io import TextIOWrapper
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import Final

from daemon.batch.permissions import open_private

_LARGEST: Final = 4 * 2**20
_OLD_FILES: Final = 3


@dataclass(frozen=True, slots=True)
class DaemonSettings:
    """Seconds and counts of the daemon.

    A ``lease`` lasts this long, whatever becomes of the connection, and is renewed every third of
    it; a run is lost after ``attempts`` bad endings; a daemon told to stop lets its local worker
    finish for ``patience``. Traces take at most ``quota`` bytes of the state directory (0: as much
    as they like); those of finished runs move to the ``store``, a URL, if there is one.
    """

    # Two renewals in a row may get lost. It is also what a run waits whose worker's machine is
    # unplugged: from here that looks like a cable that is pulled, and back in a moment. What a
    # worker leaves that only died itself, the next one on its machine gives back at once.
    lease: float = 30.0
    # A run may end badly because of its machine; one that does so three times on any of them is
    # taken for the cause, and is not to bring down every worker in turn.
    attempts: int = 3
    patience: float = 20.0
    store: str = ""
    quota: int = 0

    @property
    def renew(self) -> float:
        """Seconds between two renewals."""
        return self.lease / 3

    @property
    def tick(self) -> float:
        """Seconds between two looks at the clock for leases that have lapsed.

        Small against a lease, and not so small that an idle daemon keeps a core awake.
        """
        return min(0.5, max(self.lease / 10, 0.02))


class _LogFile(RotatingFileHandler):
    """A log for its owner alone; lines that cannot be written, to a full disk say, are left out."""

    def _open(self) -> TextIOWrapper:
        return TextIOWrapper(os.fdopen(open_private(Path(self.baseFilename)), "ab"), "utf-8")

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 (the base's name)
        """Go on: the daemon does not depend on its log."""


class EventLog:
    """Writes events of the daemon to ``daemon.log``; safe to use from any thread."""

    def __init__(self, path: Path) -> None:
        self._file = _LogFile(path, maxBytes=_LARGEST, backupCount=_OLD_FILES, delay=True)

    def write(self, event: str, **fields: object) -> None:
        """Add a line ``{"at": ..., "event": event, ...fields}``."""
        line = json.dumps({"at": round(time.time(), 3), "event": event, **fields}, default=str)
        self._file.handle(logging.makeLogRecord({"msg": line}))

    def close(self) -> None:
        """Close the file."""
        self._file.close()
