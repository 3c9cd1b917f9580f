"""Execution of runs: child processes, the function, its limits.

Only the person who starts a worker decides these.
"""

from __future__ import annotations

import contextlib
import functools
import math
import os
import platform
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

DEFAULT_EXECUTOR: Final = "daemon.run:execute"
_CPU_INFO: Final = Path("/proc/cpuinfo")
_LONGEST_PROCESSOR: Final = 80


IMPORT_FIRST: Final = "scenario_tui"
"""Import this first to find our packages, even if others have the same names."""
_RUN_MODULE: Final = (
    f"import {IMPORT_FIRST}, runpy, sys; "
    "runpy.run_module(sys.argv.pop(1), run_name='__main__', alter_sys=True)"
)


def python_command(option: str, program: str, *words: str) -> list[str]:
    """Return the command of a child process: ``-m`` with a module of ours, or ``-c`` with code.

    ``-P`` keeps the current folder, which may have a ``daemon.py``, off the modules' path.
    PYTHONPATH and other installed projects stay on it: importing :data:`IMPORT_FIRST` resolves our
    names to our packages.
    """
    if option == "-m":
        return [sys.executable, "-P", "-c", _RUN_MODULE, program, *words]
    return [sys.executable, "-P", "-c", f"import {IMPORT_FIRST}\n{program}", *words]


_COMMANDS_VARIABLE: Final = "SCENARIO_COMMANDS"
_REFUSED: Final = "refused"


def decide_on_commands(allow: bool | None, *, is_remote: bool) -> None:
    """Decide for this process and its children whether runs may start commands of SUT files.

    ``None`` allows them, unless runs come from a remote daemon, from people who have a key but
    perhaps no account here.
    """
    if allow or (allow is None and not is_remote):
        # A daemon's own workers, which are local, inherit its decision.
        if allow:
            os.environ.pop(_COMMANDS_VARIABLE, None)
        return
    os.environ[_COMMANDS_VARIABLE] = _REFUSED


def commands_allowed() -> bool:
    """Return whether runs in this process may start commands of SUT files."""
    return os.environ.get(_COMMANDS_VARIABLE) != _REFUSED


def available_cores() -> int:
    """Return the number of cores this process may use, the default number of slots.

    The quota of a container limits it to whole cores, at least one.
    """
    has_affinity = hasattr(os, "sched_getaffinity")
    cores = len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count() or 1
    return int(max(1, min(cores, core_quota())))


def core_quota(root: Path = Path("/")) -> float:
    """Return the cores that control groups grant to this process, infinite without a quota."""
    quotas = [math.inf]
    with contextlib.suppress(OSError, ValueError):
        for line in (root / "proc/self/cgroup").read_text("utf-8").splitlines():
            _, controllers, path = line.split(":", 2)
            # Version 2 has no controllers here. In version 1, a container's path leads nowhere, and
            # its group is at the top.
            if controllers == "" or "cpu" in controllers.split(","):
                group = root / "sys/fs/cgroup" / controllers / path.strip("/")
                quotas += map(_group_quota, (group, *group.parents))
    return min(quotas)


def _group_quota(group: Path) -> float:
    """Return the quota of a control group in cores, infinite without one."""
    for names in (("cpu.max",), ("cpu.cfs_quota_us", "cpu.cfs_period_us")):
        with contextlib.suppress(OSError):
            quota, period = " ".join((group / name).read_text("utf-8") for name in names).split()
            return math.inf if quota in ("max", "-1") else int(quota) / int(period)
    return math.inf


@functools.cache
def machine_text() -> str:
    """Return a line about this machine: processor, cores, system, Python.

    Reports are public, so the machine's name stays out.
    """
    name = ""
    with contextlib.suppress(OSError):
        match = re.search(r"^model name\s*:\s*(.+)$", _CPU_INFO.read_text("utf-8"), re.MULTILINE)
        name = " ".join(match[1].split()) if match else ""
    cores = available_cores()
    parts = (
        name[:_LONGEST_PROCESSOR] or f"{platform.machine()} processor",
        f"{cores} core{'' if cores == 1 else 's'}",
        f"{platform.system()} {platform.machine()}",
        f"Python {platform.python_version()}",
    )
    return ", ".join(parts)


@dataclass(frozen=True, slots=True)
class RunLimits:
    """Limits of a run: wall clock [s] (0: ten times its simulated limit, at least five minutes),
    address space [B] (0: no limit) and niceness (0 to 19).
    """

    wall: float = 0.0
    memory: int = 4 * 2**30
    nice: int = 10

    def wall_of(self, simulated: float) -> float:
        """Return the wall clock limit [s] of a run limited to ``simulated`` seconds."""
        return self.wall or max(300.0, 10.0 * simulated)
