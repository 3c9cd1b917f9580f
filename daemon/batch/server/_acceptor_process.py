"""Where others connect: keeps the process running that accepts TLS connections for Zenoh."""

from __future__ import annotations

import json
import socket
import subprocess
import threading
import time
from contextlib import suppress
from typing import Final

from daemon.batch.errors import PlaceUnusable
from daemon.batch.paths import split_endpoint
from daemon.batch.server._runtime import EventLog
from daemon.batch.tether import end_tethered
from daemon.model.execution import python_command

_BACKLOG: Final = 1024
_PAUSE: Final = 0.5
"""Seconds to the next start of a process that died."""
_LAST_MOMENT: Final = 2.0


class AcceptorProcess:
    """Listens at an encrypted address and passes connections to a port that Zenoh listens at.

    Raises :class:`DaemonError` when it cannot listen at the address.
    """

    def __init__(self, address: str, log: EventLog) -> None:
        self._log = log
        self._listener = _listen(address)
        self._process: subprocess.Popen[str] | None = None
        self._next_start = 0.0
        self._problem = ""
        self._held = _hold_port()
        self.port = self._held.getsockname()[1]

    @property
    def behind(self) -> str:
        """The endpoint for Zenoh, on loopback: only this machine reaches it."""
        return f"tls/127.0.0.1:{self.port}"

    def supervise(self) -> None:
        """Start the process unless it runs; call this every now and then, once Zenoh listens."""
        now = time.monotonic()
        if self._process is not None:
            code = self._process.poll()
            if code is None:
                return
            self._log.write("acceptor ended", code=code)
            self._process, self._next_start = None, now + _PAUSE
        if now >= self._next_start:
            self._start()

    def _start(self) -> None:
        descriptor = self._listener.fileno()
        command = python_command("-m", "daemon.batch.acceptor", str(descriptor), str(self.port))
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,  # its end tells the process that the daemon is gone
                stdout=subprocess.PIPE,
                pass_fds=(descriptor,),
                start_new_session=True,
                text=True,
            )
        except OSError as error:
            # No process to be had just now: those who are connected already need this daemon.
            problem, self._problem = self._problem, str(error)
            if problem != self._problem:  # twice a second the same would push all else out
                self._log.write("acceptor not started", problem=self._problem)
            self._next_start = time.monotonic() + _PAUSE
            return
        self._process, self._problem = process, ""
        threading.Thread(target=self._read_reports, args=(process,), daemon=True).start()
        self._log.write("acceptor started", pid=process.pid)

    def _read_reports(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout as lines:
            for line in lines:
                with suppress(ValueError):
                    self._log.write("connections dropped", by_address=json.loads(line))

    def close(self) -> None:
        """Let nobody in any more, and end the links there are."""
        self._listener.close()
        self._held.close()
        if self._process is not None:
            end_tethered(self._process, _LAST_MOMENT)


def _listen(address: str) -> socket.socket:
    host, port = split_endpoint(address)
    try:
        family, kind, protocol, _, found = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, protocol)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                # [::] is everything there is, of both kinds, as it is for Zenoh.
                listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
            listener.bind(found)
            listener.listen(_BACKLOG)
        except OSError:
            listener.close()
            raise
    except OSError as error:
        raise PlaceUnusable(f"cannot listen at {address}: {error.strerror or error}") from error
    return listener


def _hold_port() -> socket.socket:
    """Return a socket that keeps a port of loopback for a server of ours until it is closed.

    Nobody else is given the port: only who sets SO_REUSEADDR, as Zenoh does, can listen there.
    """
    held = socket.socket()
    held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    held.bind(("127.0.0.1", 0))
    return held
