"""Locks that end with the process that holds them."""

from __future__ import annotations

import fcntl
from contextlib import suppress
from pathlib import Path


def is_locked(path: Path) -> bool:
    """Whether somebody holds the lock that ``path`` is; raises ``OSError`` for what cannot be one.

    One that is not there is held by nobody.
    """
    with suppress(FileNotFoundError, NotADirectoryError), path.open("rb") as lock:
        try:
            # Shared, so that two who look do not take each other for its holder, and given back at
            # once: a daemon that starts meanwhile would be told that there is one already.
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False
