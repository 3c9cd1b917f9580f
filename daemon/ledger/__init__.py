"""The ledger: which runs there are, who executes them, what came out; one SQLite file."""

from daemon.ledger._book import Book
from daemon.ledger._file import SCHEMA_VERSION, connect, connect_reader
from daemon.ledger._queries import Reader, Upload, standing
from daemon.ledger._records import find_traces
from daemon.ledger._transition import (
    Cancelled,
    Change,
    Completed,
    Happening,
    Leased,
    Record,
    Released,
    Renewed,
    Retried,
    advance,
)

__all__ = [
    "SCHEMA_VERSION",
    "Book",
    "Cancelled",
    "Change",
    "Completed",
    "Happening",
    "Leased",
    "Reader",
    "Record",
    "Released",
    "Renewed",
    "Retried",
    "Upload",
    "advance",
    "connect",
    "connect_reader",
    "find_traces",
    "standing",
]
