"""What executes attempts: processes of this machine, or a cluster; the agent cannot tell."""

from __future__ import annotations

from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from socket import socket
from typing import Protocol, TypeAlias

from daemon.executor import Limits
from daemon.worker._spool import Attempt

Waitable: TypeAlias = Connection | socket | int
"""What :func:`multiprocessing.connection.wait` waits for."""


class Execution(Protocol):
    """An attempt under way. It leaves its trace, then its result, in the attempt's folder."""

    attempt: Attempt
    live: bytes
    """What it last told about itself, a :class:`daemon.protocol.Live` in JSON; or nothing."""
    deadline: float
    """When it has to be listened to at the latest, by the monotonic clock [s]."""

    @property
    def lacks(self) -> bool:
        """Whether the system under test is not installed where it was executed."""

    @property
    def waitables(self) -> Sequence[Waitable]:
        """What becomes ready when there is something to listen to, or at the end."""

    @property
    def ended(self) -> bool:
        """Whether nothing of it runs any more, as far as can be known here."""

    @property
    def blame(self) -> bool:
        """Whether it counts against the run that it ended without a result."""

    def listen(self) -> None:
        """Take in what it has told."""

    def kill(self, why: str = "") -> None:
        """End it at once, for that reason; it has ended afterwards."""

    def why(self) -> str:
        """Why there is no result."""

    def close(self) -> None:
        """Free what belongs to it, once it has ended."""


class Backend(Protocol):
    """Starts executions."""

    @property
    def slots(self) -> int:
        """How many executions it takes at a time, right now."""

    @property
    def waitables(self) -> Sequence[Waitable]:
        """What becomes ready when an execution of it has something to tell, or ``slots`` change."""

    def listen(self) -> None:
        """Take in what made ``waitables`` ready."""

    def start(self, attempt: Attempt, scene: Path, limits: Limits) -> Execution:
        """Start an attempt on the scene in that file.

        Raises :class:`daemon.errors.DaemonError`, ``OSError`` or ``EOFError`` when that is not
        possible now, which is nothing to blame the run for.
        """
