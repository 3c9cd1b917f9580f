"""Interrupts (Ctrl-C, SIGINT) that arrive while libraries load, which may lose them.

Python raises ``KeyboardInterrupt`` wherever the program is. A callback of a library written in C,
or a handler of all exceptions, may swallow it: the program would continue for an hour, or end as
if it had failed. Therefore this module remembers the interrupt. Commands check it between their
steps, and it decides the exit code. This module loads first and imports only the standard library.
"""

from __future__ import annotations

import signal
import threading
from types import FrameType

_came = False


def remember_interrupts() -> None:
    """Remember interrupts from now on; they raise as before.

    Another handler of SIGINT stays in place.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _remember)


def was_interrupted() -> bool:
    """Return True if an interrupt came."""
    return _came


def stop_if_interrupted() -> None:
    """Raise ``KeyboardInterrupt`` if one came before and was lost."""
    if _came:
        raise KeyboardInterrupt


def _remember(number: int, frame: FrameType | None) -> None:
    global _came
    _came = True
    signal.default_int_handler(number, frame)
