"""The ledger's file: opening it, its schema, its version."""

from __future__ import annotations

import sqlite3
from importlib import resources
from pathlib import Path
from typing import Final

from daemon.errors import DaemonError

SCHEMA_VERSION: Final = 1


def connect(path: Path) -> sqlite3.Connection:
    """Open the ledger for writing, creating it if need be.

    WAL with synchronous FULL: what was acknowledged survives kill -9 and a power cut. Raises
    :class:`DaemonError` when the file is damaged or was made by another version.
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
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if version == 0:
        schema = resources.files("daemon.ledger").joinpath("schema.sql").read_text("utf-8")
        connection.executescript(
            f"BEGIN;\n{schema}\nPRAGMA user_version = {SCHEMA_VERSION};\nCOMMIT;"
        )
    elif version != SCHEMA_VERSION:
        raise DaemonError(
            f"{path} has schema {version}, this version writes {SCHEMA_VERSION}: "
            "use the version that made it, or another state directory"
        )
