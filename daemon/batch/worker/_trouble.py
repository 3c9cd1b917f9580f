"""What keeps a worker from working, and how long it leaves off for it."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from typing import Final

from daemon.model.messages import LONGEST_TROUBLE

_FIRST_PAUSE: Final = 1.0
_LONGEST_PAUSE: Final = 60.0
"""Seconds: after the first trouble, and after many without a success in between."""
_SPREAD: Final = 0.25
"""Workers that share a full disk do not all come back in the same moment."""


class WorkerTrouble:
    """A trouble of the worker's surroundings: a full disk, no process to be had, a damaged scene.

    Each time it is met again, after a pause, the next pause is twice as long; one success ends it.
    ``changed`` is called when it begins and when it ends, which ``log`` gets too.
    """

    def __init__(self, log: Callable[[str], None], changed: Callable[[], None]) -> None:
        self._log = log
        self._changed = changed
        self.words = ""
        """What it is, empty when there is none."""
        self.until = 0.0
        """Nothing new is begun before, by the monotonic clock [s]."""
        self._pause = 0.0

    def note(self, words: str) -> None:
        """It was met; of several lines the last says what it was, as what ends a run does."""
        if not self.words:
            self._changed()
        last = (words.strip() or "a run was not executed").splitlines()[-1]
        self.words = last[-LONGEST_TROUBLE:]
        now = time.monotonic()
        if now < self.until:
            return  # of what was under way when the pause began
        self._pause = min(2.0 * self._pause, _LONGEST_PAUSE) if self._pause else _FIRST_PAUSE
        self.until = now + self._pause * random.uniform(1.0 - _SPREAD, 1.0 + _SPREAD)

    def clear(self) -> None:
        """Something succeeded."""
        if self.words:
            self._log(f"over: {self.words}")
            self._changed()
        self.words, self.until, self._pause = "", 0.0, 0.0
