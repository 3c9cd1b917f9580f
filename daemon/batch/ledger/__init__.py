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
        SCHEMA_REMEDY,
        SCHEMA_VERSION,
        LedgerIntegrity,
        check_integrity,
        connect,
        schema_problem,
    )
    from daemon.batch.ledger._reader import LedgerReader, count_states
    from daemon.batch.ledger._retention import (
        RetentionPolicy,
        SweepResult,
        stored_bytes,
        sweep_traces,
    )
    from daemon.batch.ledger._strays import StrayFile, find_strays, remove_strays
    from daemon.batch.ledger._time_left import Forecast, PlannedRun, TimeLeft
    from daemon.batch.ledger._verification import (
        ContentReport,
        VerificationProgress,
        verify_contents,
    )
    from daemon.batch.ledger._writer import LedgerWriter

__all__ = [
    "SCHEMA_REMEDY",
    "SCHEMA_VERSION",
    "ContentReport",
    "Forecast",
    "LedgerIntegrity",
    "LedgerReader",
    "LedgerWriter",
    "PlannedRun",
    "RetentionPolicy",
    "StrayFile",
    "SweepResult",
    "TimeLeft",
    "VerificationProgress",
    "check_integrity",
    "connect",
    "count_states",
    "find_strays",
    "remove_strays",
    "schema_problem",
    "stored_bytes",
    "sweep_traces",
    "verify_contents",
]

_MODULES: Final = {
    "SCHEMA_REMEDY": "_connection",
    "SCHEMA_VERSION": "_connection",
    "ContentReport": "_verification",
    "Forecast": "_time_left",
    "LedgerIntegrity": "_connection",
    "LedgerReader": "_reader",
    "LedgerWriter": "_writer",
    "PlannedRun": "_time_left",
    "StrayFile": "_strays",
    "TimeLeft": "_time_left",
    "VerificationProgress": "_verification",
    "check_integrity": "_connection",
    "connect": "_connection",
    "count_states": "_reader",
    "find_strays": "_strays",
    "remove_strays": "_strays",
    "schema_problem": "_connection",
    "verify_contents": "_verification",
}


def __getattr__(name: str) -> object:
    if name in __all__:
        return getattr(import_module(f"{__name__}.{_MODULES.get(name, '_retention')}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
