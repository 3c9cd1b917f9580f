"""A queue in which everybody has his turn, however much others put into it."""

from __future__ import annotations

import queue
import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class TurnQueue(Generic[T]):
    """A queue in which names take turns: who puts much waits behind his own, not others behind him.

    What comes under one name keeps its order.
    """

    def __init__(self) -> None:
        self._waiting: dict[str, deque[T]] = {}
        self._turns: deque[str] = deque()
        self._changed = threading.Condition()
        self._closed = False

    def put(self, item: T, name: str = "") -> None:
        """Add an item; returns at once."""
        with self._changed:
            line = self._waiting.get(name)
            if line is None:
                line = self._waiting[name] = deque()
                self._turns.append(name)
            line.append(item)
            self._changed.notify()

    def close(self) -> None:
        """Let :meth:`get` return ``None`` when nothing is left."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def get(self, *, block: bool = True, timeout: float | None = None) -> T | None:
        """Wait for the item whose turn it is, ``None`` at the end.

        Raises ``queue.Empty`` after ``timeout`` seconds, at once when it is not to ``block``.
        """
        with self._changed:
            if block:
                self._changed.wait_for(lambda: self._turns or self._closed, timeout)
            if not self._turns:
                if self._closed:
                    return None
                raise queue.Empty
            name = self._turns.popleft()
            line = self._waiting[name]
            item = line.popleft()
            if line:
                self._turns.append(name)
            else:
                del self._waiting[name]
            return item

    def empty(self) -> bool:
        """Whether nothing waits, so that :meth:`get` would wait too."""
        with self._changed:
            return not self._turns
