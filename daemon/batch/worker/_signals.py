"""What a worker is told from outside: signals, its parent's death, hints that there is work.

All of them wake the loop, which waits for sockets, through a socket.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class WakeupSocket:
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


class WorkerSignals:
    """Set by signal handlers and callbacks, read by the agent's loop.

    SIGTERM or SIGINT, or the death of process ``parent``: finish what runs, then leave
    (``drain``). SIGQUIT or a second signal: give everything back (``abort``).
    """

    def __init__(self, *, parent: int = 0) -> None:
        self._bell = WakeupSocket()
        self.wake = self._bell.ear
        self._parent = parent
        self._told = False
        self.abort = False

    @property
    def drain(self) -> bool:
        """Whether to take no more runs."""
        if not self._told and self._parent and os.getppid() != self._parent:
            self._told = True
        return self._told

    def hint(self) -> None:
        """Wake the loop: there may be work. Callable from any thread, never blocks."""
        self._bell.ring()

    def take_hints(self) -> bool:
        """Whether there were hints since the last call."""
        return self._bell.take()

    @contextmanager
    def signals(self) -> Iterator[None]:
        """Handle signals meanwhile; only in the main thread."""

        def on_signal(number: int, _: FrameType | None) -> None:
            self.abort = self.abort or self._told or number == signal.SIGQUIT
            self._told = True
            self.hint()

        numbers = (signal.SIGTERM, signal.SIGINT, signal.SIGQUIT)
        kept = {number: signal.signal(number, on_signal) for number in numbers}
        try:
            yield
        finally:
            for number, handler in kept.items():
                signal.signal(number, handler)

    def close(self) -> None:
        """Free the sockets."""
        self._bell.close()


def exit_when_stdin_closes() -> None:
    """End this process at once when standard input closes; its children follow by themselves."""

    def watch() -> None:
        while os.read(sys.stdin.fileno(), 4096):
            pass
        os._exit(1)

    threading.Thread(target=watch, name="tether", daemon=True).start()
