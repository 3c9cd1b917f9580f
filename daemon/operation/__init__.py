"""Keeping a daemon going: what is wrong with it, which traces go, its numbers, its units."""

from daemon.operation._doctor import examine
from daemon.operation._findings import Finding, Level
from daemon.operation._metrics import Standing, exposition
from daemon.operation._units import daemon_unit, worker_unit
from daemon.retention import Keeping, Swept, sweep

__all__ = [
    "Finding",
    "Keeping",
    "Level",
    "Standing",
    "Swept",
    "daemon_unit",
    "examine",
    "exposition",
    "sweep",
    "worker_unit",
]
