"""The wire to a supervisor: requests there, events back, and the supervisor as a process."""

from __future__ import annotations

import inspect
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from daemon.supervision.plan import CONTROL_SOCKET, PROGRAM, StackPlan

ERRORS: Final = "supervisor.txt"
"""What a supervisor itself has to say, when it fails."""
ANSWER_LIMIT: Final = 60.0
"""Seconds within which a supervisor answers, beside what it waits for itself: it may have to share
a processor with many runs."""
_ROOM: Final = Path(inspect.getfile(StackPlan)).parent
_kept: Final[list[subprocess.Popen[bytes]]] = []
"""Supervisors that this process has started and does not hold any more."""


class SupervisorWire:
    """One supervisor, held: it ends its stack when this end of the wire is closed.

    ``events`` are those it has told, oldest first; ``lost`` says that no more will come.
    """

    def __init__(self, wire: socket.socket, process: subprocess.Popen[bytes] | None) -> None:
        self.events: list[dict[str, Any]] = []
        self.lost = False
        self._wire, self._process = wire, process
        self._received = b""

    @classmethod
    def start(
        cls, folder: Path, environment: Mapping[str, str], inherited: tuple[int, ...]
    ) -> SupervisorWire:
        """Start a supervisor, with locks in the descriptors ``inherited``; raises ``OSError``."""
        _reap_kept()
        ours, theirs = socket.socketpair()
        # Without what variables of Python's say, which are for the stack.
        words = [sys.executable, "-I", "-S", "-c", PROGRAM, str(_ROOM.parent)]
        try:
            with theirs, (folder / ERRORS).open("wb") as errors:
                process = subprocess.Popen(
                    [*words, str(theirs.fileno())],
                    env=environment,
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=errors,
                    stderr=errors,
                    start_new_session=True,
                    pass_fds=(theirs.fileno(), *inherited),
                )
        except OSError:
            ours.close()
            raise
        return cls(ours, process)

    @classmethod
    def take_over(cls, folder: Path) -> SupervisorWire | None:
        """Hold a supervisor that waits for somebody; ``None`` when it does not, or no more."""
        connection = socket.socket(socket.AF_UNIX)
        try:
            connection.connect(str(folder / CONTROL_SOCKET))
        except OSError:
            connection.close()
            return None
        wire = cls(connection, None)
        if wire.wait_for("taken", limit=ANSWER_LIMIT) is None:
            connection.close()
            return None
        return wire

    @property
    def supervisor(self) -> int:
        """Its process id."""
        if self._process is not None:
            return self._process.pid
        # Of who listened at the other end (unix(7)).
        size = struct.calcsize("3i")
        data = self._wire.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size)
        return int(struct.unpack("3i", data)[0])

    def send_plan(self, plan: StackPlan) -> None:
        """Say what to start; once."""
        self._send(asdict(plan))

    def tell(self, request: str) -> None:
        """Ask for something without content: ``end``, ``keep``."""
        self._send({request: True})

    def _send(self, request: dict[str, Any]) -> None:
        # That nobody is there is noticed where the answer is waited for.
        with suppress(OSError):
            self._wire.sendall(json.dumps(request).encode() + b"\n")

    def wait_for(self, *names: str, limit: float) -> dict[str, Any] | None:
        """Return the first event of one of these names, ``None`` when none comes in ``limit`` s."""
        deadline = time.monotonic() + limit
        while True:
            for event in self.events:
                if any(name in event for name in names):
                    return event
            rest = deadline - time.monotonic()
            if self.lost or rest <= 0:
                return None
            self.listen(rest)

    def listen(self, limit: float = 0.0) -> None:
        """Take in what has happened; waits so many seconds for something."""
        while not self.lost and select.select([self._wire], [], [], limit)[0]:
            limit = 0.0
            try:
                data = self._wire.recv(4096)
            except ConnectionError:
                data = b""
            self.lost = not data
            *lines, self._received = (self._received + data).split(b"\n")
            self.events += map(json.loads, lines)

    def let_go(self) -> None:
        """Leave a supervisor that has agreed to go on without us."""
        if self._process is not None:
            _kept.append(self._process)
            self._process = None
        self._wire.close()

    def close(self, *, limit: float) -> bool:
        """Hang up and wait until the supervisor is gone: within so many seconds, or by SIGKILL.

        Returns whether it went by itself.
        """
        supervisor = self.supervisor
        try:
            alive = os.pidfd_open(supervisor) if self._process is None else None
        except ProcessLookupError:
            self._wire.close()
            return not self.lost
        self._wire.close()
        if self._process is not None:
            try:
                return self._process.wait(limit) == 0
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
                return False
        assert alive is not None
        try:
            if select.select([alive], [], [], limit)[0]:
                return True
            signal.pidfd_send_signal(alive, signal.SIGKILL)
            select.select([alive], [], [])
            return False
        finally:
            os.close(alive)


def _reap_kept() -> None:
    """Leave no zombies of supervisors that have ended since they were let go."""
    _kept[:] = [process for process in _kept if process.poll() is None]
