"""The ledger: which runs there are, who executes them, what came out; one SQLite file.

Nobody outside of this room speaks SQL. Names are loaded when first asked for: shell completion
reads :mod:`daemon.batch.ledger.names` at every TAB, and what judges and validates takes longer
to import than people wait for a word.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from daemon.batch.ledger._connection import (
        SCHEMA_VERSION,
        LedgerIntegrity,
        check_integrity,
        connect,
    )
    from daemon.batch.ledger._reader import LedgerReader, count_states
    from daemon.batch.ledger._retention import (
        RetentionPolicy,
        SweepResult,
        stored_bytes,
        sweep_traces,
    )
    from daemon.batch.ledger._waiting import retry_delay
    from daemon.batch.ledger._writer import LedgerWriter

__all__ = [
    "SCHEMA_VERSION",
    "LedgerIntegrity",
    "LedgerReader",
    "LedgerWriter",
    "RetentionPolicy",
    "SweepResult",
    "check_integrity",
    "connect",
    "count_states",
    "retry_delay",
    "stored_bytes",
    "sweep_traces",
]

_MODULES: Final = {
    "SCHEMA_VERSION": "_connection",
    "LedgerIntegrity": "_connection",
    "LedgerReader": "_reader",
    "LedgerWriter": "_writer",
    "check_integrity": "_connection",
    "connect": "_connection",
    "count_states": "_reader",
    "retry_delay": "_waiting",
}


def __getattr__(name: str) -> object:
    if name in __all__:
        return getattr(import_module(f"{__name__}.{_MODULES.get(name, '_retention')}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
