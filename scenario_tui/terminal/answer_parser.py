"""What comes from a terminal without what it answers late: the library takes that for keys."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from textual._xterm_parser import XTermParser
from textual.message import Message

from scenario_tui.terminal.background_question import says_light

_REPORT: Final = re.compile(r"\x1b\]11;[^\x07\x1b]*(?:\x07|\x1b\\)")
_BEGUN: Final = re.compile(r"\x1b\](?:1(?:1(?:;[^\x07\x1b]{,40}\x1b?)?)?)?\Z")
"""What may become an answer; ESC alone is a key, and must act at once."""


class BackgroundTold(Message):
    """The terminal told its background after the first frame."""

    def __init__(self, *, light: bool) -> None:
        super().__init__()
        self.light = light


class AnswerParser(XTermParser):
    """Makes messages of answers to OSC 11, in pieces of any length, and keys of the rest."""

    _begun = ""

    def feed(self, data: str) -> Iterable[Message]:
        """Return the messages in ``data``; nothing at all means that no more comes."""
        if not data:
            return super().feed(data)
        data, self._begun = self._begun + data, ""
        told = [
            BackgroundTold(light=says_light(found.group().encode()))
            for found in _REPORT.finditer(data)
        ]
        data = _REPORT.sub("", data)
        if begun := _BEGUN.search(data):
            data, self._begun = data[: begun.start()], begun.group()
        return [*told, *(super().feed(data) if data else ())]
