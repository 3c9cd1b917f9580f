"""The ledger: which runs there are, who executes them, what came out; one SQLite file.

Nobody outside of this room speaks SQL. Names are loaded when first asked for: shell completion
reads :mod:`daemon.batch.ledger.names` at every TAB, and what judges and validates takes longer
to import than people wait for a word.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from daemon.batch.ledger._connection import SCHEMA_VERSION, connect, connect_reader
    from daemon.batch.ledger._integrity import LedgerIntegrity, check_integrity
    from daemon.batch.ledger._reader import ExpectedUpload, LedgerReader, count_states
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
    "LedgerIntegrity",
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
    "check_integrity",
    "connect",
    "connect_reader",
    "count_states",
    "stored_bytes",
    "sweep_traces",
]

_MODULES: Final = {
    "SCHEMA_VERSION": "_connection",
    "ExpectedUpload": "_reader",
    "LedgerIntegrity": "_integrity",
    "LedgerReader": "_reader",
    "LedgerWriter": "_writer",
    "RetentionPolicy": "_retention",
    "StoredTrace": "_retention",
    "SweepResult": "_retention",
    "check_integrity": "_integrity",
    "connect": "_connection",
    "connect_reader": "_connection",
    "count_states": "_reader",
    "stored_bytes": "_retention",
    "sweep_traces": "_retention",
}


def __getattr__(name: str) -> object:
    if name in __all__:
        return getattr(import_module(f"{__name__}.{_MODULES.get(name, '_transitions')}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
