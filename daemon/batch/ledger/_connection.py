"""Opening the ledger's SQLite file: its schema, its version, upgrades of older ones."""

from __future__ import annotations

import sqlite3
from importlib import resources
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError

SCHEMA_VERSION: Final = 5
_UPGRADABLE: Final = (1, 2, 3, 4)


def connect(path: Path) -> sqlite3.Connection:
    """Open the ledger for writing, creating it, or bringing an older one up to date, if need be.

    WAL with synchronous FULL: what was acknowledged survives kill -9 and a power cut. Raises
    :class:`DaemonError` when the file is damaged or was made by a later version.
    """
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    try:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA foreign_keys = ON")
        _prepare(connection, path)
    except sqlite3.DatabaseError as error:
        connection.close()
        raise DaemonError(f"{path} is not a usable ledger: {error}") from error
    except DaemonError:
        connection.close()
        raise
    return connection


def connect_reader(path: Path) -> sqlite3.Connection:
    """Open an existing ledger for questions only."""
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    connection.execute("PRAGMA query_only = ON")
    return connection


def _prepare(connection: sqlite3.Connection, path: Path) -> None:
    """Make the tables of a new file, or bring those of an older one up to date."""
    version = connection.execute("PRAGMA user_version").fetchone()[0]
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
    texts = (
        resources.files("daemon.batch.ledger").joinpath(name).read_text("utf-8") for name in scripts
    )
    try:
        connection.executescript(
            "BEGIN;\n" + "\n".join(texts) + f"\nPRAGMA user_version = {SCHEMA_VERSION};\nCOMMIT;"
        )
    except sqlite3.Error:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise
