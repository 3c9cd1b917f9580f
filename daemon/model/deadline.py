"""A wall clock limit for this process, which interrupts calls of other people's code.

It interrupts only calls marked :func:`interruptible`: an exception elsewhere could leave a trace
half written. Other code calls :func:`check_wall_clock` where it can stop.

The signal arrives between two Python instructions. It does not interrupt compiled code that never
returns: the parent has to end such a process.
"""

from __future__ import annotations

import signal
import sysconfig
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Final

_STANDARD_LIBRARY: Final = sysconfig.get_path("stdlib") + "/"
_AGAIN: Final = 1.0
"""Period of further interruptions, for code that swallowed the first [s]."""
_EDGES: Final = (__name__, "daemon.stacks.calls")
"""Modules with the code around a call, not in it."""
SHORTEST_SPARE: Final = 2.0
_LONGEST_SPARE: Final = 30.0


def stopped_after(seconds: float) -> str:
    """Return the message of a run that the wall clock ended."""
    return f"stopped after {seconds:g} s of wall clock time"


class OutOfTime(BaseException):
    """The wall clock limit has passed; the message says where.

    Not an ``Exception``: other people's code must not catch it by accident.
    """


def spare_time(limit: float) -> float:
    """Return the time [s] in which a process may write and judge its run after its limit."""
    return min(max(limit, SHORTEST_SPARE), _LONGEST_SPARE)


class _Limits:
    """Current limits as (seconds, end by the monotonic clock), and the current call."""

    def __init__(self) -> None:
        self.active: list[tuple[float, float]] = []
        self.passed = 0.0
        """Seconds of the limit that has passed, 0 before."""
        self.call = ""
        self.since = 0.0
        self.message = ""
        """Message of the interrupted call, more detailed than the time limit alone."""

    def arm(self) -> None:
        """Set the timer to the next end, or switch it off."""
        now = time.monotonic()
        rest = min((end - now for _, end in self.active), default=None)
        self.passed = next((seconds for seconds, end in self.active if end <= now), 0.0)
        self.message = self.message if self.passed else ""
        signal.setitimer(signal.ITIMER_REAL, 0.0 if rest is None else max(rest, 1e-3), _AGAIN)

    def on_alarm(self, _: int, frame: FrameType | None) -> None:
        """Note that the time is up; interrupt an interruptible call."""
        now = time.monotonic()
        self.passed = next((seconds for seconds, end in self.active if end <= now), 0.0)
        # At the edge of a call nothing could catch the exception; the next check raises it.
        if self.passed and self.call and not _is_at_its_edge(frame):
            share = f"{now - self.since:.1f} s of them in one call of {self.call}{_place(frame)}"
            self.message = f"{stopped_after(self.passed)}, {share}"
            raise OutOfTime(self.message)


_limits: Final = _Limits()


@contextmanager
def wall_clock_limit(seconds: float) -> Iterator[None]:
    """Limit the time of the context to ``seconds``; the shortest of several limits holds.

    Signals reach the main thread only; other threads have no limit.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    began = time.monotonic()
    rest, again = signal.getitimer(signal.ITIMER_REAL)
    previous = signal.signal(signal.SIGALRM, _limits.on_alarm)
    _limits.active.append((seconds, began + seconds))
    _limits.arm()
    try:
        yield
    finally:
        _limits.active.pop()
        _limits.arm()
        signal.signal(signal.SIGALRM, previous)
        if rest and not _limits.active:
            # Resume a foreign timer, such as a test runner's.
            elapsed = time.monotonic() - began
            signal.setitimer(signal.ITIMER_REAL, max(rest - elapsed, 1e-3), again)


class interruptible:  # noqa: N801  (used as a function is)
    """Raise :class:`OutOfTime` inside when a limit passes; ``call`` goes into the message."""

    # A class: ``contextmanager`` would cost three times as much, at every update.
    __slots__ = ("_call",)

    def __init__(self, call: str) -> None:
        self._call = call

    def __enter__(self) -> None:
        check_wall_clock()
        _limits.since, _limits.call = time.monotonic(), self._call

    def __exit__(self, *_: object) -> None:
        _limits.call = ""


def check_wall_clock() -> None:
    """Raise :class:`OutOfTime` when a limit has passed."""
    if _limits.passed:
        raise OutOfTime(_limits.message or stopped_after(_limits.passed))


def _is_at_its_edge(frame: FrameType | None) -> bool:
    """Return whether the frame only enters or leaves a call, where most alarms arrive."""
    return frame is not None and frame.f_globals.get("__name__") in _EDGES


def _place(frame: FrameType | None) -> str:
    """Return the innermost place outside the standard library, such as the call of a sleep."""
    while frame is not None and _in_standard_library(frame.f_code.co_filename):
        frame = frame.f_back
    return f" ({Path(frame.f_code.co_filename).name}:{frame.f_lineno})" if frame else ""


def _in_standard_library(file: str) -> bool:
    # Without a virtual environment, site-packages lies inside the library's folder.
    return file.startswith((_STANDARD_LIBRARY, "<frozen")) and "site-packages" not in file
