"""Workers: lease runs from a daemon and execute each in a process of its own."""

from daemon.batch.worker._work import work
