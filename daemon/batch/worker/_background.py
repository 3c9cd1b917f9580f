"""Questions of a worker to its daemon while its loop goes on.

Over a long way an answer takes as long as a short run: a worker that waits for each answer before
it asks the next question spends its time waiting. Threads ask; the loop is woken by each answer.
"""

from __future__ import annotations

import concurrent.futures
import threading
from collections.abc import Callable, Hashable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Final

from daemon.batch.worker._signals import WakeupSocket

_THREADS: Final = 16
"""Questions under way at a time, at most; threads are started as they are needed."""


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
