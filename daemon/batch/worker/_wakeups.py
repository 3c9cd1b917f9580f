"""Events that wake the loop of a worker, which waits for sockets: signals, hints, answers.

Over a long way an answer takes as long as a short run: a worker that waits for each answer before
it asks the next question spends its time waiting. Threads ask; each answer wakes the loop.
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
"""Questions under way at a time, at most; threads are started as they are needed."""


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


class BackgroundAsks:
    """Questions under way in threads, by key; ``receiver`` is ready when one has its answer."""

    def __init__(self, threads: int = _THREADS) -> None:
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="asks")
        self._wakeup = WakeupSocket()
        self._under_way: dict[Hashable, Future[Any]] = {}
        self._closing = threading.Lock()
        self.receiver = self._wakeup.receiver

    def start(self, key: Hashable, ask: Callable[[], object]) -> None:
        """Ask in a thread."""
        future = self._pool.submit(ask)
        self._under_way[key] = future
        future.add_done_callback(self._wake)

    def _wake(self, _: Future[Any]) -> None:
        with self._closing:
            if self._wakeup.receiver.fileno() >= 0:
                self._wakeup.wake()

    def __contains__(self, key: Hashable) -> bool:
        return key in self._under_way

    def __len__(self) -> int:
        return len(self._under_way)

    def take(self) -> list[tuple[Hashable, Future[Any]]]:
        """Return what has been answered, in the order it was asked; each answer once."""
        self._wakeup.take_wakeups()
        answered = [(key, future) for key, future in self._under_way.items() if future.done()]
        for key, _ in answered:
            del self._under_way[key]
        return answered

    def wait(self, seconds: float | None = None) -> None:
        """Wait until all is answered, ``seconds`` at most; answers are there to be taken then."""
        concurrent.futures.wait(self._under_way.values(), seconds)

    def close(self) -> None:
        """Ask nothing more; what is under way ends with the session."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        with self._closing:
            self._wakeup.close()
