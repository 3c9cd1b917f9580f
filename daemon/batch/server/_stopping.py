"""Being told to end: by a signal, a request, or the end of whoever holds the daemon's tether."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from daemon.batch.tether import await_stdin_end


class StopRequest:
    """Whether, and how often, the daemon was told to stop; ``tether_cut`` when its parent is gone.

    Safe to use from any thread and from handlers of signals.
    """

    def __init__(self) -> None:
        self.count = 0
        self.tether_cut = False
        self._asked = threading.Event()

    def __call__(self) -> None:
        """Ask for it."""
        self.count += 1
        self._asked.set()

    def wait(self, seconds: float) -> bool:
        """Wait until it was asked for; returns whether it was."""
        return self._asked.wait(seconds)

    @property
    def asked(self) -> bool:
        """Whether it was asked for."""
        return self._asked.is_set()

    @contextmanager
    def signals(self) -> Iterator[None]:
        """Let SIGTERM and SIGINT ask for it."""

        def on_signal(number: int, _: FrameType | None) -> None:
            self()

        kept = {n: signal.signal(n, on_signal) for n in (signal.SIGTERM, signal.SIGINT)}
        try:
            yield
        finally:
            for number, handler in kept.items():
                signal.signal(number, handler)

    def watch_tether(self) -> None:
        """Ask for it when standard input closes."""
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        await_stdin_end()
        self.tether_cut = True
        self()
