"""The ledger: which runs there are, who executes them, what came out; one SQLite file."""

from daemon.batch.ledger._connection import SCHEMA_VERSION, connect, connect_reader
from daemon.batch.ledger._reader import ExpectedUpload, LedgerReader, count_states
from daemon.batch.ledger._records import find_traces
from daemon.batch.ledger._retention import (
    RetentionPolicy,
    StoredTrace,
    SweepResult,
    stored_bytes,
    sweep_traces,
)
from daemon.batch.ledger._transitions import (
    Cancelled,
    Completed,
    ExecutionState,
    Leased,
    Released,
    Renewed,
    Retried,
    RunEvent,
    RunTransition,
    advance,
)
from daemon.batch.ledger._writer import LedgerWriter

__all__ = [
    "SCHEMA_VERSION",
    "Cancelled",
    "Completed",
    "ExecutionState",
    "ExpectedUpload",
    "Leased",
    "LedgerReader",
    "LedgerWriter",
    "Released",
    "Renewed",
    "RetentionPolicy",
    "Retried",
    "RunEvent",
    "RunTransition",
    "StoredTrace",
    "SweepResult",
    "advance",
    "connect",
    "connect_reader",
    "count_states",
    "find_traces",
    "stored_bytes",
    "sweep_traces",
]
