"""The question what background the terminal has (OSC 11), asked early and answered late.

The answer takes a round trip, and some terminals never give one: it is asked before the libraries
of a screen are loaded, which takes longer than most answers, and nobody waits for it afterwards.
"""

from __future__ import annotations

import os
import re
import select
import termios
import tty
from collections.abc import Mapping
from typing import Any, Final

_QUESTION: Final = b"\x1b]11;?\x1b\\"
_REPORT: Final = re.compile(
    rb"\x1b\]11;rgba?:([0-9a-fA-F]{1,4})/([0-9a-fA-F]{1,4})/([0-9a-fA-F]{1,4})"
)
_LIGHT_COLOURS: Final = frozenset({"7", *map(str, range(9, 16))})
"""Numbers of the colours of a terminal that are bright, as COLORFGBG names them."""


class BackgroundQuestion:
    """A question to the terminal, which echoes nothing until :meth:`close`.

    Where ``COLORFGBG`` tells the background, and where there is no terminal, nothing is asked.
    """

    def __init__(
        self, environ: Mapping[str, str] = os.environ, reading: int = 0, writing: int = 2
    ) -> None:
        self._reading = reading
        self._before: list[Any] | None = None
        told = environ.get("COLORFGBG", "").rpartition(";")[2]
        self._light = told in _LIGHT_COLOURS
        if not told.isdigit() and os.isatty(reading) and os.isatty(writing):
            self._before = termios.tcgetattr(reading)
            tty.setcbreak(reading, termios.TCSANOW)
            os.write(writing, _QUESTION)

    def close(self) -> bool:
        """Let the terminal echo again; return whether its background is light, as far as was told
        until now: nobody waits here.
        """
        before, self._before = self._before, None
        if before is not None:
            said = b""
            while select.select([self._reading], [], [], 0.0)[0]:
                more = os.read(self._reading, 256)
                if not more:
                    break
                said += more
            termios.tcsetattr(self._reading, termios.TCSANOW, before)
            self._light = says_light(said)
        return self._light


def says_light(said: bytes) -> bool:
    """Whether there is an answer to the question in what a terminal ``said``, and it is light."""
    report = _REPORT.search(said)
    if report is None:
        return False
    # Of one to four hexadecimal digits each.
    parts = report.groups()
    red, green, blue = (float(int(part, 16)) / (16.0 ** len(part) - 1.0) for part in parts)
    return 0.299 * red + 0.587 * green + 0.114 * blue > 0.5
