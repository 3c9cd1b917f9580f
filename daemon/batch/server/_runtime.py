"""What a daemon runs with: its settings, the endpoints it listens at, its event log."""

from __future__ import annotations

import errno
import json
import os
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError
from daemon.batch.paths import INSECURE_VARIABLE, StatePaths, is_encrypted, is_local
from daemon.batch.permissions import open_private, refuse_exposed_keys
from daemon.batch.security import DaemonCredentials, find_daemon_credentials, keys_folder


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


@dataclass(frozen=True, slots=True)
class ListenSettings:
    """``socket`` is for the daemon's owner on this machine; ``address`` for others, or empty.

    ``keys`` say whom an encrypted address admits.
    """

    socket: str
    address: str = ""
    keys: DaemonCredentials | None = None

    @property
    def endpoints(self) -> tuple[str, ...]:
        """All endpoints."""
        return (self.socket, self.address) if self.address else (self.socket,)


def prepare_endpoints(
    paths: StatePaths, listen: str = "", keys: Path | None = None, *, insecure: bool = False
) -> ListenSettings:
    """Return where to listen, ready to do so.

    Raises :class:`DaemonError` for plain TCP that other machines could reach, unless ``insecure``,
    and :class:`daemon.batch.errors.KeysUnusable` when an encrypted address has no keys.
    """
    try:
        paths.make_socket_folder()
    except OSError as error:
        words = f"cannot listen at {paths.socket}: {error.filename}: {error.strerror}"
        raise DaemonError(words) from error
    if listen and is_encrypted(listen):
        credentials = find_daemon_credentials(keys)
        refuse_exposed_keys(keys_folder(keys))
        return ListenSettings(paths.endpoint, listen, credentials)
    if listen and not (is_local(listen) or insecure or os.environ.get(INSECURE_VARIABLE)):
        raise DaemonError(
            f"{listen} would be open to every machine of the network: listen at tls/ with keys "
            "(`scenario keys init`), or say --insecure"
        )
    # Said again, the daemon's own socket is still one.
    return ListenSettings(paths.endpoint, "" if listen == paths.endpoint else listen)


def exposure_warning(listen: str) -> str:
    """Say who can reach a daemon that listens at ``listen`` without a key; empty for nobody."""
    if not listen or is_encrypted(listen):
        return ""
    who = "everybody with an account on this machine"
    if not is_local(listen):
        who = "everybody in the network, unencrypted and unasked,"
    return f"INSECURE: {who} can look, submit, cancel and stop the daemon through {listen}"


_LARGEST: Final = 4 * 2**20
_OLD_FILES: Final = 3


class EventLog:
    """Writes events of the daemon to ``daemon.log``; safe to use from any thread.

    What cannot be written, because the disk is full say, is counted and said with the next line.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._file = -1
        self._unwritten = 0

    def write(self, event: str, **fields: object) -> None:
        """Add a line ``{"at": ..., "event": event, ...fields}``."""
        with self._lock:
            lost = {"unwritten": self._unwritten} if self._unwritten else {}
            line = {"at": round(time.time(), 3), "event": event, **fields, **lost}
            try:
                self._append(json.dumps(line, default=str).encode() + b"\n")
                self._unwritten = 0
            except OSError:
                self._unwritten += 1

    def _append(self, line: bytes) -> None:
        if self._file < 0:
            self._file = open_private(self._path)
        size = os.fstat(self._file).st_size
        if size + len(line) > _LARGEST:
            self._rotate()
            size = 0
        if os.write(self._file, line) != len(line):
            os.ftruncate(self._file, size)  # a part of a line is none
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _rotate(self) -> None:
        self._close()
        for number in range(_OLD_FILES, 0, -1):
            older = self._path.with_name(f"{self._path.name}.{number}")
            newer = self._path.with_name(f"{self._path.name}.{number - 1}")
            with suppress(FileNotFoundError):
                (newer if number > 1 else self._path).replace(older)
        self._file = open_private(self._path)

    def _close(self) -> None:
        if self._file >= 0:
            os.close(self._file)
        self._file = -1

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._close()
