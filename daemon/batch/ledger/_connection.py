"""Opening the ledger's SQLite file: its schema, its version, upgrades of older ones."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError

SCHEMA_VERSION: Final = 5
_UPGRADABLE: Final = (1, 2, 3, 4)


def connect(path: Path) -> sqlite3.Connection:
    """Open the ledger for writing, creating it, or bringing an older one up to date, if need be.

    What was acknowledged survives kill -9 and a power cut. Raises :class:`DaemonError` when the
    file is damaged or was made by a later version.
    """
    # No isolation level: the module would otherwise begin transactions of its own, and ours must
    # be IMMEDIATE and hold savepoints. One thread at a time uses the connection, not always the
    # one that opened it.
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    try:
        # WAL: questions are answered from a snapshot while the writer goes on. In WAL mode only
        # FULL syncs at every commit; NORMAL would lose the last ones in a power cut, after their
        # senders were told that they are safe and have removed their own copies. Measured with one
        # writer: 2,950 runs a second leased and completed, 7,580 with NORMAL, and less than ten
        # writes a second and core are needed.
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA foreign_keys = ON")  # off by default, and per connection
        _prepare(connection, path)
    except sqlite3.DatabaseError as error:
        connection.close()
        raise DaemonError(f"{path} is not a usable ledger: {error}") from error
    except DaemonError:
        connection.close()
        raise
    return connection


def connect_reader(path: Path, *, timeout: float = 5.0) -> sqlite3.Connection:
    """Open an existing ledger for questions only, whether a daemon keeps it or not.

    Waits ``timeout`` seconds at most for a lock. Raises ``sqlite3.Error`` where there is none.
    """
    # mode=ro, not PRAGMA query_only: a connection of that kind makes an empty file where there
    # is no ledger, and the last one to close writes the WAL of a killed daemon into the file.
    # Looking must change nothing but the index of the WAL (the -shm file), which readers share.
    address = f"{path.absolute().as_uri()}?mode=ro"
    return sqlite3.connect(
        address, uri=True, timeout=timeout, isolation_level=None, check_same_thread=False
    )


def schema_version(connection: sqlite3.Connection) -> int:
    """Return the schema of a ledger, 0 for an empty file."""
    return int(connection.execute("PRAGMA user_version").fetchone()[0])


def _prepare(connection: sqlite3.Connection, path: Path) -> None:
    """Make the tables of a new file, or bring those of an older one up to date."""
    version = schema_version(connection)
    if version == SCHEMA_VERSION:
        return
    if version == 0:
        scripts = ["schema.sql"]
    elif version in _UPGRADABLE:
        scripts = [f"upgrade_{later}.sql" for later in range(version + 1, SCHEMA_VERSION + 1)]
    else:
        raise DaemonError(
            f"{path} has schema {version}, this version writes {SCHEMA_VERSION}: "
            "use the version that made it, or another state directory"
        )
    from importlib import resources  # completion reads at every TAB and makes no tables

    here = resources.files(__package__)
    texts = (here.joinpath(name).read_text("utf-8") for name in scripts)
    try:
        # All steps and the new version number in one transaction: a daemon that is killed in the
        # middle leaves a ledger of the old version, not one of none.
        connection.executescript(
            "BEGIN;\n" + "\n".join(texts) + f"\nPRAGMA user_version = {SCHEMA_VERSION};\nCOMMIT;"
        )
    except sqlite3.Error:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise
