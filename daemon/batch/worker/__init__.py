"""Workers: lease runs from a daemon and execute each in a process of its own."""

from daemon.batch.worker._attempts import AdoptedWork, Attempt, Spool
from daemon.batch.worker._connection import InputCache, WorkerPaths, choose_paths
from daemon.batch.worker._uploader import ResultUploader
from daemon.batch.worker._work import work

__all__ = [
    "AdoptedWork",
    "Attempt",
    "InputCache",
    "ResultUploader",
    "Spool",
    "WorkerPaths",
    "choose_paths",
    "work",
]
