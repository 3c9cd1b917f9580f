"""Operation of a daemon: the examination of its state, and its systemd units."""

from daemon.batch.operation._doctor import (
    DoctorFinding,
    Examination,
    FindingLevel,
    check_keys,
    examine,
    guarded,
)
from daemon.batch.operation._systemd import daemon_unit, worker_unit

__all__ = [
    "DoctorFinding",
    "Examination",
    "FindingLevel",
    "check_keys",
    "daemon_unit",
    "examine",
    "guarded",
    "worker_unit",
]
