"""The daemon itself: the ledger behind a Zenoh router, and a local worker."""

from daemon.batch.server._opening import exposure_warning, prepare_endpoints
from daemon.batch.server._revoked_keys import RevokedKeys
from daemon.batch.server._runtime import DaemonSettings, EventLog
from daemon.batch.server._search_handlers import read_extension
from daemon.batch.server._serve import STOP_MARGIN, serve
from daemon.batch.server._submissions import admit_submission
from daemon.batch.server._threads import LedgerJob, WriterThread
from daemon.batch.server._workers import LeaseClock, LeaseDeadlines, WorkerRegistry

__all__ = [
    "STOP_MARGIN",
    "DaemonSettings",
    "EventLog",
    "LeaseClock",
    "LeaseDeadlines",
    "LedgerJob",
    "RevokedKeys",
    "WorkerRegistry",
    "WriterThread",
    "admit_submission",
    "exposure_warning",
    "prepare_endpoints",
    "read_extension",
    "serve",
]
