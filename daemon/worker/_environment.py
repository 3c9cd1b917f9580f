"""The environment of the fork server: it has to be there before it loads anything."""

from __future__ import annotations

import os

from daemon.executor import EXECUTOR_VARIABLE


def prepare_environment(executor: str) -> None:
    """Say what executes runs, and that a run is one thread of one core."""
    os.environ[EXECUTOR_VARIABLE] = executor
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
