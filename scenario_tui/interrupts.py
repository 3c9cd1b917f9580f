"""Interrupts (Ctrl-C, SIGINT) that arrive while libraries load, which may lose them.

Python raises ``KeyboardInterrupt`` wherever the program is. In a callback of a library written in
C, or where one catches everything, that is the end of it: the program would go on for an hour, or
end as if it had failed. So that one came is remembered, looked at between the steps of a command,
and decides the exit code. Imports nothing but the standard library: it is there before anything
else.
"""

from __future__ import annotations

import signal
import threading
from types import FrameType

_came = False


def remember_interrupts() -> None:
    """Remember from now on that an interrupt came; it raises as it did.

    Where somebody else handles SIGINT, or ignores it, nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _remember)


def was_interrupted() -> bool:
    """Whether an interrupt came."""
    return _came


def stop_if_interrupted() -> None:
    """Raise ``KeyboardInterrupt`` if one came before, whatever has become of it."""
    if _came:
        raise KeyboardInterrupt


def _remember(number: int, frame: FrameType | None) -> None:
    global _came
    _came = True
    signal.default_int_handler(number, frame)
