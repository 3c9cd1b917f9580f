"""A wall clock limit for this process, by which calls of other people's code are interrupted.

Only what is marked :func:`interruptible` is: an exception out of nowhere would leave a trace half
written. What runs outside of it asks :func:`check_wall_clock` where it can stop.

The signal reaches Python between two of its instructions. Compiled code that never returns is not
interrupted by it: whoever started the process has to end it.
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
"""Seconds after which code that swallowed the interruption is interrupted again."""
_EDGES: Final = (__name__, "daemon.stacks.calls")
"""Modules whose code is around a call, not in it."""
SHORTEST_SPARE: Final = 2.0
_LONGEST_SPARE: Final = 30.0


def stopped_after(seconds: float) -> str:
    """Say that a run was ended by the wall clock."""
    return f"stopped after {seconds:g} s of wall clock time"


class OutOfTime(BaseException):
    """The wall clock limit has passed; the message says so, and where.

    Not an ``Exception``: code of other people that goes on after those must not after this.
    """


def spare_time(limit: float) -> float:
    """Return for how long [s] a process may write and judge what it has when its limit is over."""
    return min(max(limit, SHORTEST_SPARE), _LONGEST_SPARE)


class _Limits:
    """The limits that hold now: (seconds, end by the monotonic clock), what is being called."""

    def __init__(self) -> None:
        self.held: list[tuple[float, float]] = []
        self.passed = 0.0
        """Seconds of the limit that is over, 0 while none is."""
        self.call = ""
        self.since = 0.0
        self.said = ""
        """What was said when a call was interrupted, which is more than that time is up."""

    def arm(self) -> None:
        """Set the timer to the nearest end, or switch it off."""
        now = time.monotonic()
        left = min((end - now for _, end in self.held), default=None)
        self.passed = next((seconds for seconds, end in self.held if end <= now), 0.0)
        self.said = self.said if self.passed else ""
        signal.setitimer(signal.ITIMER_REAL, 0.0 if left is None else max(left, 1e-3), _AGAIN)

    def on_alarm(self, _: int, frame: FrameType | None) -> None:
        """Notice that the time is up; interrupt what may be."""
        now = time.monotonic()
        self.passed = next((seconds for seconds, end in self.held if end <= now), 0.0)
        # Where a call begins or ends nothing could catch it; the next check notices.
        if self.passed and self.call and not _is_at_its_edge(frame):
            spent, place = now - self.since, _place(frame)
            spent_there = f"{spent:.1f} s of them in one call of {self.call}{place}"
            self.said = f"{stopped_after(self.passed)}, {spent_there}"
            raise OutOfTime(self.said)


_limits: Final = _Limits()


@contextmanager
def wall_clock_limit(seconds: float) -> Iterator[None]:
    """Limit what is done within to that many seconds; the shortest of several limits holds.

    Signals reach the main thread only; in any other nothing is limited.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    began = time.monotonic()
    left, again = signal.getitimer(signal.ITIMER_REAL)
    before = signal.signal(signal.SIGALRM, _limits.on_alarm)
    _limits.held.append((seconds, began + seconds))
    _limits.arm()
    try:
        yield
    finally:
        _limits.held.pop()
        _limits.arm()
        signal.signal(signal.SIGALRM, before)
        if left and not _limits.held:
            # Somebody else's timer, a test runner's say, goes on.
            spent = time.monotonic() - began
            signal.setitimer(signal.ITIMER_REAL, max(left - spent, 1e-3), again)


class interruptible:  # noqa: N801  (used as a function is)
    """Raise :class:`OutOfTime` inside when a limit passes meanwhile; ``call`` is what is said."""

    # A class of its own: made by ``contextmanager`` it costs three times as much, at every update.
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
        raise OutOfTime(_limits.said or stopped_after(_limits.passed))


def _is_at_its_edge(frame: FrameType | None) -> bool:
    """Return whether the frame only enters or leaves a call: alarms come there above all."""
    return frame is not None and frame.f_globals.get("__name__") in _EDGES


def _place(frame: FrameType | None) -> str:
    """Return the innermost place that is not in the standard library: ``time.sleep`` has none."""
    while frame is not None and _in_standard_library(frame.f_code.co_filename):
        frame = frame.f_back
    return f" ({Path(frame.f_code.co_filename).name}:{frame.f_lineno})" if frame else ""


def _in_standard_library(file: str) -> bool:
    # What is installed without an environment of its own lies inside of the library's folder.
    return file.startswith((_STANDARD_LIBRARY, "<frozen")) and "site-packages" not in file
