"""The daemon's log: one JSON object per line, rotated."""

from __future__ import annotations

import json
import logging
import logging.handlers
import time
from pathlib import Path
from typing import Final

_LARGEST: Final = 4 * 2**20
_OLD_FILES: Final = 3


class Journal:
    """Writes events of the daemon to ``daemon.log``; safe to use from any thread."""

    def __init__(self, path: Path) -> None:
        self._handler = logging.handlers.RotatingFileHandler(
            path, maxBytes=_LARGEST, backupCount=_OLD_FILES, encoding="utf-8"
        )

    def write(self, event: str, **fields: object) -> None:
        """Add a line ``{"at": ..., "event": event, ...fields}``."""
        line = json.dumps({"at": round(time.time(), 3), "event": event, **fields}, default=str)
        self._handler.handle(logging.makeLogRecord({"msg": line}))

    def close(self) -> None:
        """Close the file."""
        self._handler.close()
