"""The daemon itself: the ledger behind a Zenoh router, and a local worker."""

from daemon.batch.server._askers import MOST_WAITING, Askers, TurnQueue
from daemon.batch.server._door import Door
from daemon.batch.server._runtime import (
    DaemonClock,
    DaemonSettings,
    EventLog,
    exposure_warning,
    prepare_endpoints,
)
from daemon.batch.server._serve import STOP_MARGIN, serve
from daemon.batch.server._submissions import admit_submission
from daemon.batch.server._uploads import FileUploads, TraceUploads
from daemon.batch.server._workers import WorkerRegistry

__all__ = [
    "MOST_WAITING",
    "STOP_MARGIN",
    "Askers",
    "DaemonClock",
    "DaemonSettings",
    "Door",
    "EventLog",
    "FileUploads",
    "TraceUploads",
    "TurnQueue",
    "WorkerRegistry",
    "admit_submission",
    "exposure_warning",
    "prepare_endpoints",
    "serve",
]
