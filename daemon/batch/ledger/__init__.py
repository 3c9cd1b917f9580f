"""The ledger of runs, leases and results, in one SQLite file.

Only this package uses SQL, except :mod:`daemon.batch.ledger_names` for completion.
"""

from daemon.batch.ledger._connection import (
    SCHEMA_REMEDY,
    SCHEMA_VERSION,
    LedgerIntegrity,
    check_integrity,
    connect,
    schema_problem,
)
from daemon.batch.ledger._disk_space import (
    Removal,
    RetentionPolicy,
    find_strays,
    remove_strays,
    stored_bytes,
    sweep_traces,
)
from daemon.batch.ledger._reader import LedgerReader
from daemon.batch.ledger._time_left import Forecast, RunPace, TimeLeft
from daemon.batch.ledger._verification import (
    ContentReport,
    VerificationProgress,
    verify_contents,
)
from daemon.batch.ledger._writer import LedgerWriter
