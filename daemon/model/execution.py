"""How runs are executed: processes, the function, its limits, the cluster.

Whoever starts a worker decides it, and no one else.
"""

from __future__ import annotations

import contextlib
import functools
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
"""Who imports this first finds our packages, whoever else has one of their names."""
_RUN_MODULE: Final = (
    f"import {IMPORT_FIRST}, runpy, sys; "
    "runpy.run_module(sys.argv.pop(1), run_name='__main__', alter_sys=True)"
)


def python_command(option: str, what: str, *words: str) -> list[str]:
    """Return the command of a child process that imports our modules: ``-m`` or ``-c``, and what.

    ``-P`` keeps the current folder off the modules' path, in which there may be somebody's
    ``daemon.py``. It does not keep PYTHONPATH off, nor what other projects install: importing
    :data:`IMPORT_FIRST` makes our names mean ours.
    """
    if option == "-m":
        return [sys.executable, "-P", "-c", _RUN_MODULE, what, *words]
    return [sys.executable, "-P", "-c", f"import {IMPORT_FIRST}\n{what}", *words]


_COMMANDS_VARIABLE: Final = "SCENARIO_COMMANDS"
_REFUSED: Final = "refused"


def decide_on_commands(wanted: bool | None, *, elsewhere: bool) -> None:
    """Decide for this process and its children whether runs may start commands of SUT files.

    ``None``: they may, unless runs come from ``elsewhere``, from people who have a key but perhaps
    no account here.
    """
    if wanted or (wanted is None and not elsewhere):
        # What a daemon has decided holds for its own workers, who know it as somebody local.
        if wanted:
            os.environ.pop(_COMMANDS_VARIABLE, None)
        return
    os.environ[_COMMANDS_VARIABLE] = _REFUSED


def commands_allowed() -> bool:
    """Whether runs in this process may start commands that stand in SUT files."""
    return os.environ.get(_COMMANDS_VARIABLE) != _REFUSED


def available_cores() -> int:
    """Number of cores this process may use: the default number of slots."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@functools.cache
def machine_text() -> str:
    """Return this machine in a line for people: processor, cores, system, Python.

    Without its name, which is nobody's business who reads a report.
    """
    name = ""
    with contextlib.suppress(OSError):
        found = re.search(r"^model name\s*:\s*(.+)$", _CPU_INFO.read_text("utf-8"), re.MULTILINE)
        name = " ".join(found[1].split()) if found else ""
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
