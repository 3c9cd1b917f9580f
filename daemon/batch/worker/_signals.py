"""What a worker is told from outside: signals, hints that there is work.

All of them wake the loop, which waits for sockets, through a socket.
"""

from __future__ import annotations

import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class WakeupSocket:
    """Wakes a loop that waits for sockets: never blocks, and wakes once however often it was told.

    A socket and no ``threading.Event``: the loop waits for processes and pipes at the same time,
    and a signal handler must not take a lock.
    """

    def __init__(self) -> None:
        self.receiver, self._sender = socket.socketpair()
        self.receiver.setblocking(False)
        self._sender.setblocking(False)

    def wake(self) -> None:
        """Make ``receiver`` ready to be read. Callable from any thread and from signal handlers."""
        try:
            self._sender.send(b"!")
        except BlockingIOError:
            return  # the buffer is full of wake-ups that were not taken yet

    def take_wakeups(self) -> bool:
        """Whether it was woken since the last call."""
        try:
            return bool(self.receiver.recv(4096))
        except BlockingIOError:
            return False

    def close(self) -> None:
        """Free the sockets."""
        self.receiver.close()
        self._sender.close()


class WorkerSignals(WakeupSocket):
    """Set by signal handlers and callbacks, read by the worker's loop, which it wakes.

    SIGTERM or SIGINT: finish what runs, then leave (``drain``: take no more runs). SIGQUIT or a
    second signal: give everything back (``abort``).
    """

    def __init__(self) -> None:
        super().__init__()
        self.drain = False
        self.abort = False

    def leave(self) -> None:
        """Finish what runs, then leave."""
        self.drain = True
        self.wake()

    @contextmanager
    def handled(self) -> Iterator[None]:
        """Handle signals meanwhile; only in the main thread."""

        def on_signal(number: int, _: FrameType | None) -> None:
            self.abort = self.abort or self.drain or number == signal.SIGQUIT
            self.leave()

        # Nothing but flags and a byte: a handler may run between any two instructions of the loop.
        numbers = (signal.SIGTERM, signal.SIGINT, signal.SIGQUIT)
        kept = {number: signal.signal(number, on_signal) for number in numbers}
        try:
            yield
        finally:
            for number, handler in kept.items():
                signal.signal(number, handler)
