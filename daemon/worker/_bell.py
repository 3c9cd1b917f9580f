"""A bell: rung from any thread, heard by a loop that waits for sockets."""

from __future__ import annotations

import socket


class Bell:
    """Ringing never blocks; however often it rang, it is heard once."""

    def __init__(self) -> None:
        self.ear, self._button = socket.socketpair()
        self.ear.setblocking(False)
        self._button.setblocking(False)

    def ring(self) -> None:
        """Make ``ear`` ready to be read. Callable from any thread and from signal handlers."""
        try:
            self._button.send(b"!")
        except BlockingIOError:
            return  # it has not been heard yet, and will be

    def take(self) -> bool:
        """Whether it rang since the last call."""
        try:
            return bool(self.ear.recv(4096))
        except BlockingIOError:
            return False

    def close(self) -> None:
        """Free the sockets."""
        self.ear.close()
        self._button.close()
