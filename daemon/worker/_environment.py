"""The environment of the fork server: it has to be there before it loads anything."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from daemon.executor import EXECUTOR_VARIABLE


def prepare_environment(executor: str) -> None:
    """Say what executes runs, and that a run is one thread of one core."""
    os.environ[EXECUTOR_VARIABLE] = executor
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")


def step_back(nice: int) -> None:
    """Let this worker's session step back as a whole, if it has one of its own.

    With autogroups (sched(7), usual on Linux) sessions share processors evenly whatever the
    niceness of their processes: that of the runs counts inside the worker's session only.
    """
    if os.getsid(0) == os.getpid():
        with suppress(OSError):  # another system, or a kernel without them
            Path("/proc/self/autogroup").write_text(str(nice))
