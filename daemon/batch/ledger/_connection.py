"""The ledger as a file: opening it to write or to read, and checking it as a whole."""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError, PlaceUnusable, Unavailable

SCHEMA_VERSION: Final = 19
_IN_MEMORY: Final = Path(":memory:")
"""SQLite's name of a database that ends with its connection."""
UNREADABLE: Final = (sqlite3.Error, UnicodeDecodeError)
"""Errors of queries to a damaged ledger; even the message may not be text."""
_READER_PATIENCE: Final = 5.0
_CACHE_KIB: Final = 64 * 2**10


def connect(path: Path) -> sqlite3.Connection:
    """Open the ledger for writing, creating it if necessary.

    Acknowledged data survives kill -9 and a power cut. Raises :class:`Unavailable` when the disk is
    full or another process holds the file, and :class:`DaemonError` when it is damaged or has
    another schema.
    """
    try:
        # Set the mode here: SQLite would follow the umask; the WAL and its index copy the mode.
        if path != _IN_MEMORY:
            os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600))
    except OSError as error:
        no_room = error.errno in (errno.ENOSPC, errno.EDQUOT)
        kind = Unavailable if no_room else DaemonError
        raise kind(f"{path} cannot be opened: {error.strerror}") from error
    # No isolation level: otherwise the module begins its own transactions, and ours must be
    # IMMEDIATE with savepoints. One thread at a time uses the connection, not always the one that
    # opened it.
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    try:
        # Only possible before the first table: return the space of deleted campaigns.
        connection.execute("PRAGMA auto_vacuum = INCREMENTAL")
        # WAL: readers use a snapshot while the writer goes on. In WAL mode only FULL syncs at every
        # commit; NORMAL would lose the last commits in a power cut, after their senders got the
        # acknowledgement and removed their own copies. Measured with one writer: 2,950 runs a
        # second leased and completed, 7,580 with NORMAL; less than ten writes a second and core are
        # needed.
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        # Every new run changes six indexes; the default of 2 MB is too small for a large campaign.
        connection.execute(f"PRAGMA cache_size = -{_CACHE_KIB}")
        connection.execute("PRAGMA foreign_keys = ON")  # off by default, and per connection
        _prepare(connection, path)
    except UNREADABLE as error:
        connection.close()
        if _is_passing(error):
            raise Unavailable(f"{path} cannot be used now: {error}") from error
        raise DaemonError(f"{path} is not a usable ledger: {error}") from error
    except DaemonError:
        connection.close()
        raise
    return connection


_PASSING: Final = (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_FULL)
_NO_ROOM: Final = (
    sqlite3.SQLITE_IOERR_WRITE,
    sqlite3.SQLITE_IOERR_TRUNCATE,
    sqlite3.SQLITE_IOERR_FSYNC,
    sqlite3.SQLITE_IOERR_SHMSIZE,
    sqlite3.SQLITE_IOERR_SHMMAP,
)
"""Errors of writing the WAL or its index on a full disk, or beyond a quota."""


def _is_passing(error: Exception) -> bool:
    """Return whether the error may pass without repairing the ledger."""
    code = getattr(error, "sqlite_errorcode", 0)
    return code & 0xFF in _PASSING or code in _NO_ROOM


@contextmanager
def open_reader(path: Path) -> Iterator[sqlite3.Connection]:
    """Open an existing ledger read-only, with or without a running daemon.

    Waits five seconds at most for a lock. Raises :class:`DaemonError`, also for a query in the
    block, when there is no ledger, it cannot be read or has another schema.
    """
    try:
        with closing(_open_to_read(path)) as connection:
            check_current(connection, path)
            yield connection
    except UNREADABLE as error:
        raise DaemonError(f"{path} is not a usable ledger: {error}") from error


def _open_to_read(path: Path) -> sqlite3.Connection:
    # mode=ro, not PRAGMA query_only: that would create a missing file, and on closing write the WAL
    # of a killed daemon into it. Readers change only the index of the WAL (the -shm file).
    address = f"{path.absolute().as_uri()}?mode=ro"
    return sqlite3.connect(
        address,
        uri=True,
        timeout=_READER_PATIENCE,
        isolation_level=None,
        check_same_thread=False,
    )


def _schema_version(connection: sqlite3.Connection) -> int:
    """Return the schema of a ledger, 0 for an empty file."""
    return int(connection.execute("PRAGMA user_version").fetchone()[0])


def check_present(path: Path) -> None:
    """Refuse a place without a ledger, as :class:`PlaceUnusable`."""
    if not path.exists():
        raise PlaceUnusable(f"there is no ledger in {path.parent}: no daemon has run there yet")


def check_current(connection: sqlite3.Connection, path: Path) -> None:
    """Refuse a ledger of another schema than ours, as :class:`DaemonError`."""
    version = _schema_version(connection)
    if version == 0:
        raise DaemonError(f"{path} is empty: the daemon makes the ledger when it starts")
    if version != SCHEMA_VERSION:
        raise DaemonError(f"{path} {schema_problem(version)}: {SCHEMA_REMEDY}")


SCHEMA_REMEDY: Final = "use the version that made it, or name another state directory with --state"


def schema_problem(version: int) -> str:
    """Return the message for a ledger with another ``version`` of the schema."""
    return f"has schema {version}, this version reads and writes schema {SCHEMA_VERSION}"


def _prepare(connection: sqlite3.Connection, path: Path) -> None:
    """Make the tables of a new file; refuse one with other tables."""
    if _schema_version(connection) != 0:
        check_current(connection, path)
        return
    from importlib import resources  # not needed by completion, which never creates tables

    tables = resources.files(__package__).joinpath("schema.sql").read_text("utf-8")
    # Tables and version number in one transaction: a kill in between leaves an empty file.
    connection.executescript(f"BEGIN;\n{tables}\nPRAGMA user_version = {SCHEMA_VERSION};\nCOMMIT;")


_MOST_SHOWN: Final = 3


@dataclass(frozen=True, slots=True)
class LedgerIntegrity:
    """Integrity of a ledger: its schema ``version`` and the ``damage`` of the file.

    The numbers are 0 for other schemas. ``alarms`` counts nondeterministic executions,
    ``newest_event`` is in seconds since the epoch.
    """

    version: int
    damage: tuple[str, ...] = ()
    runs: int = 0
    results: int = 0
    alarms: int = 0
    newest_event: float = 0.0


def check_integrity(path: Path, *, quick: bool = False) -> LedgerIntegrity:
    """Examine a ledger without changing it; a daemon may be writing.

    ``quick`` does not compare indices with their tables. Raises :class:`Unavailable` when another
    process holds it, and :class:`DaemonError` when it cannot be read at all.
    """
    try:
        with closing(_open_to_read(path)) as db:
            return _examine(db, quick)
    except UNREADABLE as error:
        if _is_passing(error):
            raise Unavailable(f"{path} cannot be read now: {error}") from error
        raise DaemonError(f"{path} cannot be read: {error}") from error


def _examine(db: sqlite3.Connection, quick: bool) -> LedgerIntegrity:
    version = _schema_version(db)
    if version != SCHEMA_VERSION:
        return LedgerIntegrity(version)
    check = db.execute(f"PRAGMA {'quick' if quick else 'integrity'}_check({_MOST_SHOWN})")
    damage = [" ".join(str(row[0]).split()) for row in check if row[0] != "ok"]
    dangling = db.execute("PRAGMA foreign_key_check").fetchall()
    damage += [f"{row[0]} refers to nothing" for row in dangling[:_MOST_SHOWN]]
    if damage:
        return LedgerIntegrity(version, tuple(damage))
    # One statement, so one snapshot: the numbers must agree.
    numbers = db.execute(
        "SELECT (SELECT count(*) FROM run), (SELECT count(*) FROM result), count(*)"
        " FILTER (WHERE kind = 'alarm'), ifnull(max(at), 0.0) FROM event"
    ).fetchone()
    return LedgerIntegrity(version, (), *numbers)
