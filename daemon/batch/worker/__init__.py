"""Workers: lease runs from a daemon and execute each in a process of its own."""

from daemon.batch.worker._attempts import AdoptedWork, Attempt, Spool
from daemon.batch.worker._background import BackgroundAsks
from daemon.batch.worker._connection import (
    InputCache,
    InputDamaged,
    WorkerPaths,
    choose_paths,
)
from daemon.batch.worker._trouble import WorkerTrouble
from daemon.batch.worker._work import work

__all__ = [
    "AdoptedWork",
    "Attempt",
    "BackgroundAsks",
    "InputCache",
    "InputDamaged",
    "Spool",
    "WorkerPaths",
    "WorkerTrouble",
    "choose_paths",
    "work",
]
