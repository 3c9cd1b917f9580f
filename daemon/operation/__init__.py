"""Keeping a daemon going: what is wrong with it, which traces go, its numbers, its units."""

from daemon.operation._traces import Keeping, Swept, sweep

__all__ = ["Keeping", "Swept", "sweep"]
