"""The ledger as a file: opened to write or to read, and checked as a whole."""

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
"""What SQLite calls a database that is gone with its connection: no file has this name."""
UNREADABLE: Final = (sqlite3.Error, UnicodeDecodeError)
"""What a question to a damaged ledger may raise: also that its message is no text."""
_READER_PATIENCE: Final = 5.0
_CACHE_KIB: Final = 64 * 2**10


def connect(path: Path) -> sqlite3.Connection:
    """Open the ledger for writing, creating it if need be.

    What was acknowledged survives kill -9 and a power cut. Raises :class:`Unavailable` when the
    disk is full or somebody else holds the file, and :class:`DaemonError` when it is damaged or has
    another schema.
    """
    try:
        # SQLite gives the WAL and its index the mode of the file, and the file what the umask says.
        if path != _IN_MEMORY:
            os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600))
    except OSError as error:
        raise _open_error(path, error) from error
    # No isolation level: the module would otherwise begin transactions of its own, and ours must
    # be IMMEDIATE and hold savepoints. One thread at a time uses the connection, not always the
    # one that opened it.
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    try:
        # Before the first table, or never: space that deleted campaigns leave is given back.
        connection.execute("PRAGMA auto_vacuum = INCREMENTAL")
        # WAL: questions are answered from a snapshot while the writer goes on. In WAL mode only
        # FULL syncs at every commit; NORMAL would lose the last ones in a power cut, after their
        # senders were told that they are safe and have removed their own copies. Measured with one
        # writer: 2,950 runs a second leased and completed, 7,580 with NORMAL, and less than ten
        # writes a second and core are needed.
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        # Six indexes are written for every new run: the 2 MB that are usual hold none of those of
        # a large campaign.
        connection.execute(f"PRAGMA cache_size = -{_CACHE_KIB}")
        connection.execute("PRAGMA foreign_keys = ON")  # off by default, and per connection
        _prepare(connection, path)
    except UNREADABLE as error:
        connection.close()
        if _is_passing(error):
            raise Unavailable(f"{path} cannot be used just now: {error}") from error
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
"""What a full disk, or a quota that is reached, makes of writing the WAL and of its index."""


def _is_passing(error: Exception) -> bool:
    """Whether it may be otherwise in a while, without anybody mending the ledger."""
    code = getattr(error, "sqlite_errorcode", 0)
    return code & 0xFF in _PASSING or code in _NO_ROOM


def _open_error(path: Path, error: OSError) -> DaemonError:
    words = f"{path} cannot be opened: {error.strerror}"
    passing = error.errno in (errno.ENOSPC, errno.EDQUOT)
    return Unavailable(words) if passing else DaemonError(words)


@contextmanager
def open_reader(path: Path) -> Iterator[sqlite3.Connection]:
    """Open an existing ledger for questions only, whether a daemon keeps it or not.

    Waits five seconds at most for a lock. Raises :class:`DaemonError`, also for a question in the
    block, when there is no ledger, it cannot be read or has another schema.
    """
    try:
        with closing(_open_to_read(path)) as connection:
            check_current(connection, path)
            yield connection
    except UNREADABLE as error:
        raise DaemonError(f"{path} is not a usable ledger: {error}") from error


def _open_to_read(path: Path) -> sqlite3.Connection:
    # mode=ro, not PRAGMA query_only: a connection of that kind makes an empty file where there
    # is no ledger, and the last one to close writes the WAL of a killed daemon into the file.
    # Looking must change nothing but the index of the WAL (the -shm file), which readers share.
    address = f"{path.absolute().as_uri()}?mode=ro"
    return sqlite3.connect(
        address,
        uri=True,
        timeout=_READER_PATIENCE,
        isolation_level=None,
        check_same_thread=False,
    )


def schema_version(connection: sqlite3.Connection) -> int:
    """Return the schema of a ledger, 0 for an empty file."""
    return int(connection.execute("PRAGMA user_version").fetchone()[0])


def check_present(path: Path) -> None:
    """Refuse a place without a ledger, as :class:`PlaceUnusable`."""
    if not path.exists():
        raise PlaceUnusable(f"there is no ledger in {path.parent}: nothing was ever run there")


def check_current(connection: sqlite3.Connection, path: Path) -> None:
    """Refuse a ledger of another schema than ours, as :class:`DaemonError`."""
    version = schema_version(connection)
    if version == 0:
        raise DaemonError(f"{path} is empty: the daemon makes the ledger when it starts")
    if version != SCHEMA_VERSION:
        raise DaemonError(f"{path} {schema_problem(version)}: {SCHEMA_REMEDY}")


SCHEMA_REMEDY: Final = "use the version that made it, or name another state directory with --state"


def schema_problem(version: int) -> str:
    """Say that a ledger has a ``version`` of the schema that we do not read."""
    return f"has schema {version}, this version reads and writes schema {SCHEMA_VERSION}"


def _prepare(connection: sqlite3.Connection, path: Path) -> None:
    """Make the tables of a new file; refuse one with other tables."""
    if schema_version(connection) != 0:
        check_current(connection, path)
        return
    from importlib import resources  # completion reads at every TAB and makes no tables

    tables = resources.files(__package__).joinpath("schema.sql").read_text("utf-8")
    try:
        # The tables and the version number in one transaction: a daemon that is killed in the
        # middle leaves an empty file.
        connection.executescript(
            f"BEGIN;\n{tables}\nPRAGMA user_version = {SCHEMA_VERSION};\nCOMMIT;"
        )
    except sqlite3.Error:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise


_MOST_SHOWN: Final = 3


@dataclass(frozen=True, slots=True)
class LedgerIntegrity:
    """A ledger under examination: its schema ``version`` and the ``damage`` of the file.

    The numbers are those of a ledger of our schema. ``alarms`` count executions that came out
    differently, ``newest_event`` is in seconds since the epoch.
    """

    version: int
    damage: tuple[str, ...] = ()
    runs: int = 0
    results: int = 0
    alarms: int = 0
    newest_event: float = 0.0


def check_integrity(path: Path, *, quick: bool = False) -> LedgerIntegrity:
    """Examine a ledger, which a daemon may be writing; changes nothing.

    A ``quick`` look leaves out whether indices agree with their tables. Raises
    :class:`Unavailable` when somebody else holds it, and :class:`DaemonError` when it cannot be
    read at all.
    """
    try:
        with closing(_open_to_read(path)) as db:
            return _examine(db, quick)
    except UNREADABLE as error:
        if _is_passing(error):
            raise Unavailable(f"{path} cannot be read just now: {error}") from error
        raise DaemonError(f"{path} cannot be read: {error}") from error


def _examine(db: sqlite3.Connection, quick: bool) -> LedgerIntegrity:
    version = schema_version(db)
    if version != SCHEMA_VERSION:
        return LedgerIntegrity(version)
    check = db.execute(f"PRAGMA {'quick' if quick else 'integrity'}_check({_MOST_SHOWN})")
    damage = [" ".join(str(row[0]).split()) for row in check if row[0] != "ok"]
    dangling = db.execute("PRAGMA foreign_key_check").fetchall()
    damage += [f"{row[0]} refers to nothing" for row in dangling[:_MOST_SHOWN]]
    if damage:
        return LedgerIntegrity(version, tuple(damage))
    # In one statement, of one snapshot: the numbers must agree.
    numbers = db.execute(
        "SELECT (SELECT count(*) FROM run), (SELECT count(*) FROM result), count(*)"
        " FILTER (WHERE kind = 'alarm'), ifnull(max(at), 0.0) FROM event"
    ).fetchone()
    return LedgerIntegrity(version, (), *numbers)
