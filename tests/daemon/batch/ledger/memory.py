"""A ledger that is nowhere on the disk, for tests that make hundreds of them."""

from __future__ import annotations

import sqlite3
import tempfile
from contextlib import chdir
from pathlib import Path

from daemon.batch.ledger import connect


def memory_ledger() -> sqlite3.Connection:
    """An empty ledger in memory."""
    # A ledger is private from the start: an empty file of this very name is made where we are.
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        return connect(Path(":memory:"))
