"""Opening of a state directory by its daemon: lock, endpoints, ledger, and the contact file."""

from __future__ import annotations

import errno
import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

from daemon.batch.errors import AlreadyRunning, DaemonError, PlaceUnusable, Unavailable
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import (
    INSECURE_VARIABLE,
    DaemonContact,
    StatePaths,
    is_encrypted,
    is_local,
)
from daemon.batch.permissions import open_private, refuse_exposed_keys, secure_state
from daemon.batch.security import DaemonCredentials, find_daemon_credentials, keys_folder
from daemon.batch.server._runtime import DaemonSettings, EventLog
from daemon.batch.stores import Marker, write_marker
from grammars.text import codec
from grammars.text.files import write_atomically

_PATIENCE: Final = 1.0
_AGAIN: Final = 0.02
"""Time of attempts to lock a state directory, and between two of them [s]."""
_NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT)


@contextmanager
def hold_alone(paths: StatePaths) -> Iterator[None]:
    """Hold the lock of a state directory, creating it if necessary.

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
    """Lock within a second; return whether that was possible.

    Programs that check for a daemon hold the lock for a moment.
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


@dataclass(frozen=True, slots=True)
class ListenSettings:
    """``socket`` is for the daemon's owner on this machine; ``address`` for others, or empty.

    ``keys`` are those that an encrypted address admits.
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
    """Return the endpoints to listen at, ready for use.

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
            "(`scenario keys init`), or use --insecure"
        )
    # The daemon's own socket may be given again.
    return ListenSettings(paths.endpoint, "" if listen == paths.endpoint else listen)


def exposure_warning(listen: str) -> str:
    """Return a warning if others can reach a daemon at ``listen`` without a key."""
    if not listen or is_encrypted(listen):
        return ""
    who = "everybody with an account on this machine"
    if not is_local(listen):
        who = "everybody in the network, without encryption or a key,"
    return f"INSECURE: {who} can look, submit, cancel and stop the daemon through {listen}"


def open_state(
    stack: ExitStack, paths: StatePaths, settings: DaemonSettings, log: EventLog
) -> tuple[LedgerWriter, Marker]:
    """Open a state directory: its ledger, and the marker of this start; ``stack`` closes both.

    Raises :class:`Unavailable` while its disk is full or another program holds the ledger, and
    :class:`DaemonError` for lasting problems.
    """
    try:
        paths.make_folders()
        tightened = secure_state(paths)
        if tightened:
            log.write("closed to others", paths=tightened)
        ledger = stack.enter_context(LedgerWriter.open(paths, attempts=settings.attempts))
        marker = write_marker(paths, ledger.begin_era())
    except OSError as error:
        where = error.filename or paths.state
        words = f"{where} cannot be written: {error.strerror}"
        if error.errno in _NO_ROOM:
            raise Unavailable(f"{words}: free some space and start the daemon again") from error
        raise DaemonError(words) from error
    for why in ledger.holds():
        log.write("held", why=why)
    return ledger, marker


def write_contact(paths: StatePaths, contact: DaemonContact) -> None:
    """Write the contact file unless it exists; a full disk is tolerated."""
    if not paths.contact_file.exists():
        with suppress(OSError):
            write_atomically(paths.contact_file, codec.to_json(contact), mode=0o600)
