"""How runs are executed: by which function, within what limits, on which cluster.

Whoever starts a worker decides it, and no one else.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

DEFAULT_EXECUTOR: Final = "daemon.run:execute"
EXECUTOR_VARIABLE: Final = "SCENARIO_EXECUTOR"
"""Environment variable through which a worker tells its fork server ``module:function``."""


def available_cores() -> int:
    """Number of cores this process may use: the default number of slots."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True, slots=True)
class RunLimits:
    """What a run may use: wall clock [s] (0: ten times its simulated limit, at least five
    minutes), address space [B] (0: no limit) and, by ``nice`` (0 to 19), processors that others
    want too.
    """

    wall: float = 0.0
    memory: int = 4 * 2**30
    nice: int = 10

    def wall_of(self, simulated: float) -> float:
        """Wall clock limit [s] of a run limited to ``simulated`` seconds."""
        return self.wall or max(300.0, 10.0 * simulated)


@dataclass(frozen=True, slots=True)
class DaskScheduler:
    """A Dask cluster: its scheduler's address, ``tcp://host:port`` or ``tls://host:port``.

    The files of the certificate authority, our certificate and its key are for TLS; without them
    Dask's own configuration is asked.
    """

    address: str
    ca: Path | None = None
    certificate: Path | None = None
    key: Path | None = None
