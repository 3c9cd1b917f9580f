"""A staged submission as a part of the ledger's connection, for as long as it is being copied."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager

from daemon.batch.ledger._staging import STAGED


class Attachment:
    """Attaches one file at a time to a connection."""

    def __init__(self, db: sqlite3.Connection) -> None:
        self._db = db
        self._detaching = False

    @contextmanager
    def of(self, path: str) -> Iterator[None]:
        """Attach a file for the block."""
        self._db.execute(f"ATTACH ? AS {STAGED}", (path,))
        try:
            yield
        finally:
            # What a transaction has read cannot be detached before its end.
            self._detaching = True
            self.detach()

    def detach(self) -> None:
        """Detach what is not needed any more; to be called after each transaction."""
        if self._detaching and not self._db.in_transaction:
            self._db.execute(f"DETACH {STAGED}")
            self._detaching = False
