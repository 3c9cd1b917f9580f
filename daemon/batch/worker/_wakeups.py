"""Events that wake the loop of a worker, which waits for sockets: signals, hints, answers.

Over a slow link an answer takes as long as a short run, so the loop must not wait for each answer.
Threads send the requests; each answer wakes the loop.
"""

from __future__ import annotations

import concurrent.futures
import signal
import socket
import threading
from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final

_THREADS: Final = 16
"""Most requests at a time; threads start on demand."""


class WakeupSocket:
    """Wakes a loop that waits for sockets; never blocks, and merges several wake-ups into one.

    A socket, not a ``threading.Event``: the loop also waits for processes and pipes, and a signal
    handler must not take a lock.
    """

    def __init__(self) -> None:
        self.receiver, self._sender = socket.socketpair()
        self.receiver.setblocking(False)
        self._sender.setblocking(False)

    def wake(self) -> None:
        """Make ``receiver`` readable. Callable from any thread and from signal handlers."""
        try:
            self._sender.send(b"!")
        except BlockingIOError:
            return  # the buffer is full of wake-ups

    def take_wakeups(self) -> bool:
        """Return whether it was woken since the last call."""
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

    SIGTERM or SIGINT: finish running runs, then stop (``drain``: lease no more). SIGQUIT or a
    second signal: return all runs (``abort``).
    """

    def __init__(self) -> None:
        super().__init__()
        self.drain = False
        self.abort = False

    def leave(self) -> None:
        """Finish running runs, then stop."""
        self.drain = True
        self.wake()

    @contextmanager
    def handled(self) -> Iterator[None]:
        """Handle signals in the context; only in the main thread."""

        def on_signal(number: int, _: FrameType | None) -> None:
            self.abort = self.abort or self.drain or number == signal.SIGQUIT
            self.leave()

        # Only flags and a byte: a handler may run between any two instructions of the loop.
        numbers = (signal.SIGTERM, signal.SIGINT, signal.SIGQUIT)
        previous = {number: signal.signal(number, on_signal) for number in numbers}
        try:
            yield
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)


class BackgroundAsks:
    """Pending requests in threads, by key; ``receiver`` is readable when one has its answer."""

    def __init__(self, threads: int = _THREADS) -> None:
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="asks")
        self._wakeup = WakeupSocket()
        self._pending: dict[Hashable, Future[Any]] = {}
        self._closing = threading.Lock()
        self.receiver = self._wakeup.receiver

    def start(self, key: Hashable, ask: Callable[[], object]) -> None:
        """Ask in a thread."""
        future = self._pool.submit(ask)
        self._pending[key] = future
        future.add_done_callback(self._wake)

    def _wake(self, _: Future[Any]) -> None:
        with self._closing:
            if self._wakeup.receiver.fileno() >= 0:
                self._wakeup.wake()

    def __contains__(self, key: Hashable) -> bool:
        return key in self._pending

    def __len__(self) -> int:
        return len(self._pending)

    def take(self) -> list[tuple[Hashable, Future[Any]]]:
        """Return the answered requests in the order of their start, each once."""
        self._wakeup.take_wakeups()
        answered = [(key, future) for key, future in self._pending.items() if future.done()]
        for key, _ in answered:
            del self._pending[key]
        return answered

    def wait(self, seconds: float | None = None) -> None:
        """Wait for all answers, ``seconds`` at most; :meth:`take` returns them."""
        concurrent.futures.wait(self._pending.values(), seconds)

    def close(self) -> None:
        """Send no more requests; pending ones end with the session."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        with self._closing:
            self._wakeup.close()
