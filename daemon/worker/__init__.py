"""Workers: lease runs from a daemon and execute each in a process of its own."""

from daemon.executor import Limits
from daemon.worker._work import work

__all__ = ["Limits", "work"]
