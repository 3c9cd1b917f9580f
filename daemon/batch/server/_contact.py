"""Who keeps a state directory, and where it is to be found: its lock and its contact file."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import IO, Final

from daemon.batch.errors import AlreadyRunning, PlaceUnusable
from daemon.batch.paths import DaemonContact, StatePaths
from daemon.batch.permissions import open_private
from grammars.text import codec
from grammars.text.files import write_atomically

_PATIENCE: Final = 1.0
_AGAIN: Final = 0.02
"""Seconds to try for the lock of a state directory, and between two tries."""


@contextmanager
def hold_alone(paths: StatePaths) -> Iterator[None]:
    """Hold the lock of a state directory, which is made if need be.

    Raises :class:`AlreadyRunning` when another daemon has it, and :class:`DaemonError` when the
    directory cannot be used.
    """
    with ExitStack() as stack:
        try:
            paths.state.mkdir(mode=0o700, parents=True, exist_ok=True)
            lock = stack.enter_context(os.fdopen(open_private(paths.lock), "a"))
        except OSError as error:
            words = f"{error.filename or paths.state} cannot be used: {error.strerror}"
            raise PlaceUnusable(f"{words}; choose another directory with --state") from error
        if not _lock_soon(lock):
            contact = paths.read_contact()
            where = f", process {contact.pid}" if contact else ""
            raise AlreadyRunning(f"a daemon already keeps {paths.state}{where}")
        yield


def _lock_soon(lock: IO[str]) -> bool:
    """Lock within a second; returns whether that was possible.

    Programs that only look whether there is a daemon hold the lock for a moment.
    """
    deadline = time.monotonic() + _PATIENCE
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= deadline:
                return False
            time.sleep(_AGAIN)
        else:
            return True


class ContactFile:
    """Says where the daemon is; written when there is room, found by the socket until then."""

    def __init__(self, paths: StatePaths, endpoint: str, version: str) -> None:
        self._path = paths.contact_file
        self._contact = DaemonContact(endpoint, os.getpid(), version, time.time())
        self._written = False

    def write(self) -> None:
        """Write it unless that is done, or there is no room for it."""
        if not self._written:
            with suppress(OSError):
                write_atomically(self._path, codec.to_json(self._contact), mode=0o600)
                self._written = True

    def remove(self) -> None:
        """Remove it."""
        self._path.unlink(missing_ok=True)
