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
    """Times [s] and counts of the daemon.

    A ``lease`` lasts this long, even without a connection, and is renewed every third of it. A run
    is lost after ``attempts`` bad endings. A stopping daemon lets its local worker finish for
    ``patience``. Traces take at most ``quota`` bytes of the state directory (0: no limit); those of
    finished runs move to the ``store``, a URL, if given.
    """

    # Long enough that two renewals in a row may get lost. Runs of an unplugged machine also wait
    # this long, since it looks like a short loss of connection. Runs of a worker that only died
    # itself do not: the next worker on its machine returns them at once.
    lease: float = 30.0
    # A run may end badly because of its machine. After three times the run counts as the cause, so
    # that it does not bring down every worker.
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
        """Period of checks for lapsed leases [s], without keeping an idle core awake."""
        return min(0.5, max(self.lease / 10, 0.02))


class _LogFile(RotatingFileHandler):
    """A private log; lines that cannot be written, as on a full disk, are dropped."""

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
