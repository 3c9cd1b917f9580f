"""systemd user units for the daemon and for workers.

Stopping sends SIGTERM to the main process only (``KillMode=mixed``): the daemon stops its worker,
and a worker lets its children finish; systemd's default would kill the runs. systemd then waits a
little longer than the drain may take. Quoting follows systemd.syntax(7) and systemd.service(5): C
escapes in double quotes, ``%`` and, in commands, ``$`` doubled.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from daemon.batch.server import STOP_MARGIN, DaemonSettings
from daemon.model.deadline import spare_time
from daemon.model.execution import RunLimits

# Seconds in addition to the process's own limit: after TimeoutStopSec systemd kills the runs.
_MARGIN: Final = 10.0
_UNSAFE: Final = frozenset("\"'\\$")
_UNIT: Final = """\
[Unit]
Description={about}
StartLimitIntervalSec=0

[Service]
Type=exec
ExecStart={command}
Restart={restart}
RestartSec={pause}
KillMode=mixed
TimeoutStopSec={patience:.0f}
OOMPolicy=continue
UMask=0077
{more}
[Install]
WantedBy=default.target
"""


def daemon_unit(words: Sequence[str]) -> str:
    """Return the unit of a daemon; ``words`` are its command line, the first an absolute path.

    It restarts after a failure, not after ``scenario daemon --stop``.
    """
    return _UNIT.format(
        about="scenario: queue and results of simulated runs",
        command=_command(words),
        restart="on-failure",
        pause=2,
        patience=DaemonSettings().patience + STOP_MARGIN + _MARGIN,
        more="RestartPreventExitStatus=2\n",
    )


def worker_unit(words: Sequence[str], limits: RunLimits) -> str:
    """Return the unit of a worker; it restarts after every end, also after the daemon's.

    It gets the time of the shortest wall clock limit of a run, and the niceness of runs.
    """
    longest = limits.wall_of(0.0)
    return _UNIT.format(
        about="scenario: worker, executes simulated runs",
        command=_command(words),
        restart="always",
        pause=5,
        patience=longest + spare_time(longest) + _MARGIN,
        more=f"Nice={limits.nice}\n",
    )


def _command(words: Sequence[str]) -> str:
    # systemd refuses such names of programs with any quoting.
    detour = ("/usr/bin/env",) if _UNSAFE & set(words[0]) else ()
    return " ".join(_quoted(word) for word in (*detour, *words))


def _quoted(word: str) -> str:
    """Quote a word of ``ExecStart``."""
    escaped = word.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return '"' + escaped.replace("%", "%%").replace("$", "$$") + '"'
