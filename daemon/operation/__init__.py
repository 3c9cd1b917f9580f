"""Keeping a daemon going: what is wrong with it, which traces go, its numbers, its units."""

from daemon.operation._traces import Keeping, Swept, sweep
from daemon.operation._units import daemon_unit, worker_unit

__all__ = ["Keeping", "Swept", "daemon_unit", "sweep", "worker_unit"]
