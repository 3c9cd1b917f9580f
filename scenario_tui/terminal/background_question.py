"""The question what background the terminal has (OSC 11), asked early and answered late.

The answer takes a round trip, and some terminals never give one: it is asked before the libraries
of a screen are loaded, which takes longer than most answers, and nobody waits for it afterwards.
"""

from __future__ import annotations

import os
import select
import termios
import tty
from collections.abc import Mapping
from typing import Any, Final

_QUESTION: Final = b"\x1b]11;?\x1b\\"


class BackgroundQuestion:
    """A question to the terminal, which echoes nothing until :meth:`close`.

    Where ``COLORFGBG`` tells the background, and where there is no terminal, nothing is asked.
    """

    def __init__(
        self, environ: Mapping[str, str] = os.environ, reading: int = 0, writing: int = 2
    ) -> None:
        self._reading = reading
        self._before: list[Any] | None = None
        told = environ.get("COLORFGBG", "").rpartition(";")[2].isdigit()
        if not told and os.isatty(reading) and os.isatty(writing):
            self._before = termios.tcgetattr(reading)
            tty.setcbreak(reading, termios.TCSANOW)
            os.write(writing, _QUESTION)

    def close(self) -> bytes:
        """Let the terminal echo again; return what it has said until now, without waiting."""
        before, self._before = self._before, None
        if before is None:
            return b""
        said = b""
        while select.select([self._reading], [], [], 0.0)[0]:
            more = os.read(self._reading, 256)
            if not more:
                break
            said += more
        termios.tcsetattr(self._reading, termios.TCSANOW, before)
        return said
