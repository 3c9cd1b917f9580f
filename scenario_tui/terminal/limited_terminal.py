"""Apps for slow lines and poor terminals: they send only changed cells, in characters they show.

Textual draws a changed widget as a whole, although most of it is on the screen already. That costs
time on a slow line. :class:`TerminalDiff` remembers the cells of the terminal and reduces every
frame to the differences.
"""

from __future__ import annotations

import os
import re
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, ClassVar, Final

from rich.cells import cell_len
from textual.app import App
from textual.binding import Binding, BindingType
from textual.driver import Driver
from textual.filter import LineFilter, Monochrome

from grammars.text.terminal_text import printable, unfiltered
from scenario_tui.terminal.capabilities import TerminalLimits, copy_to_tmux
from scenario_tui.terminal.filters import AsciiGlyphs, PrintableText, ReducedColours
from scenario_tui.terminal.printable_console import PrintableConsole

# The parts of Textual's frames: moves of the cursor, styles, text, ends of lines.
_TOKEN: Final = re.compile(
    r"\x1b\[(?P<row>\d+);(?P<column>\d+)H"
    r"|\x1b\[(?P<style>[\d;:]*)m"
    r"|(?P<text>[^\x00-\x1f\x7f-\x9f]+)"
    r"|(?P<newline>\r?\n)"
)
_FRAME: Final = re.compile(r"\x1b\[\d+;\d+H")
# After these the cells of the terminal are unknown: reset, other screen, cleared.
_LOST: Final = re.compile(r"\x1b(c|\[\?(1049|47|1047)[hl]|\[\d*J)")
# Begin and end of a frame that the terminal shows at once (DEC mode 2026).
_SYNC: Final = ("\x1b[?2026h", "\x1b[?2026l")
_GAP: Final = 6
"""Most unchanged cells to send instead of stepping over them. A step costs five bytes
(``ESC [ 1 2 C``), and may need a style behind it.
"""
_UNKNOWN: Final = "\0"
_SETTLED = 0.25
"""Seconds after which a dragged window has its size."""


@dataclass(slots=True)
class _Row:
    """Characters and styles of the cells of a row, as far as known."""

    cells: list[str] = field(default_factory=list)
    styles: list[str] = field(default_factory=list)

    def reach(self, width: int) -> None:
        missing = width - len(self.cells)
        self.cells.extend([_UNKNOWN] * missing)
        self.styles.extend([_UNKNOWN] * missing)


class TerminalDiff:
    """Memory of the cells that the terminal shows; reduces frames to the differences."""

    def __init__(self) -> None:
        self._rows: dict[int, _Row] = {}
        self._place: tuple[int, int] | None = None
        self._style: str | None = None
        self._held = False
        self._opened = False

    def forget(self) -> None:
        """Forget all cells of the terminal, so that the next frame is sent as it is."""
        self._rows.clear()
        self._place = self._style = None

    def reduce(self, data: str) -> str:
        """Return the part of ``data`` to send; frames begin with a move of the cursor."""
        if data in _SYNC:
            return self._synchronise(begins=data == _SYNC[0])
        if not _FRAME.match(data):
            if _LOST.search(data):
                self.forget()
            self._place = self._style = None
            return data
        tokens = list(_TOKEN.finditer(data))
        if sum(token.end() - token.start() for token in tokens) != len(data):
            self.forget()  # other sequences must arrive, and may change any cell
            return self._opening() + data
        changes = "".join(self._changes(tokens))
        return self._opening() + changes if changes else ""

    def _synchronise(self, *, begins: bool) -> str:
        """Announce frames to terminals that show them at once, unless they are empty."""
        # Textual brackets every frame, ten a second. Empty ones are not sent, nor their brackets,
        # which would be 38 bytes a second (measured).
        opened, self._held, self._opened = self._opened, begins, False
        return _SYNC[1] if opened and not begins else ""

    def _opening(self) -> str:
        announce, self._held = self._held, False
        self._opened = self._opened or announce
        return _SYNC[0] if announce else ""

    def _changes(self, tokens: list[re.Match[str]]) -> Iterator[str]:
        row = column = 0
        style = ""
        for token in tokens:
            kind = token.lastgroup
            if kind == "text":
                text = token["text"]
                yield from self._write(row, column, style, text)
                column += cell_len(text)
            elif kind == "style":
                style = "" if token["style"] == "0" else token["style"]
            elif kind == "newline":
                row, column = row + 1, 0
            else:
                row, column = int(token["row"]) - 1, int(token["column"]) - 1
        # Textual expects the cursor at the end of its frame, without a style.
        if self._place != (row, column):
            yield from self._restyle("")
            yield self._move(row, column)
        yield from self._restyle("")

    def _write(self, row: int, column: int, style: str, text: str) -> Iterator[str]:
        here = self._rows.setdefault(row, _Row())
        end = column + cell_len(text)
        here.reach(end)
        if not (text.isascii() or _single(text)):
            # Half of a wide character cannot be overwritten, and terminals disagree on some widths.
            # Such a run is always sent, and its cells are unknown afterwards.
            yield self._move(row, column) + "".join(self._restyle(style)) + text
            self._place = None
            here.cells[column:end] = [_UNKNOWN] * (end - column)
            return
        for first, last in _spans(here, column, style, text):
            yield self._move(row, column + first) + "".join(self._restyle(style))
            yield text[first:last]
            self._place = (row, column + last)
        here.cells[column:end] = text
        here.styles[column:end] = [style] * len(text)

    def _restyle(self, style: str) -> Iterator[str]:
        if style != self._style:
            # Styles add up in a terminal: begin with a reset.
            is_plain = self._style == ""
            self._style = style
            yield f"\x1b[{style if is_plain or not style else '0;' + style}m"

    def _move(self, row: int, column: int) -> str:
        if self._place == (row, column):
            return ""
        before, self._place = self._place, (row, column)
        # A step to the right in the same row takes fewer bytes than coordinates.
        if before is not None and before[0] == row and before[1] < column:
            return f"\x1b[{column - before[1]}C"
        return f"\x1b[{row + 1};{column + 1}H"


def _spans(row: _Row, column: int, style: str, text: str) -> Iterator[tuple[int, int]]:
    """Yield the parts of a run that differ from the row, as [first, last) of the run."""
    end = column + len(text)
    cells, styles = row.cells[column:end], row.styles[column:end]
    if "".join(cells) == text and styles.count(style) == len(styles):
        return
    first = last = -1
    for index, (before, was, now) in enumerate(zip(cells, styles, text, strict=True)):
        if before == now and was == style:
            continue
        if first >= 0 and index - last > _GAP:
            yield first, last
            first = index
        first = index if first < 0 else first
        last = index + 1
    yield first, last


@lru_cache(maxsize=4096)
def _single(text: str) -> bool:
    """Return True if every character takes one cell."""
    return all(cell_len(character) == 1 for character in text)


class LimitedTerminalApp(App[None]):
    """An app that sends few bytes, in colours and characters that its terminal has."""

    BINDING_GROUP_TITLE = "everywhere"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding(
            "ctrl+l", "redraw", "Redraw", show=False, id="redraw", tooltip="Draw the screen again"
        ),
        Binding(
            "ctrl+z", "suspend_process", "Suspend", show=False, id="suspend", tooltip="Back with fg"
        ),
    ]

    def __init__(self, limits: TerminalLimits | None = None) -> None:
        super().__init__()
        # Textual's messages after the end, such as a traceback, quote text of others.
        self.error_console = PrintableConsole(file=unfiltered(sys.stderr))
        self._printable = PrintableText()
        self._limit_filters: tuple[LineFilter, ...] = ()
        self._drawn = False
        # Every step of an animation would send a frame.
        if "TEXTUAL_ANIMATIONS" not in os.environ:
            self.animation_level = "none"
        self.apply_limits(limits or TerminalLimits())

    def apply_limits(self, limits: TerminalLimits) -> None:
        """Show everything within these limits."""
        self.ascii_only = limits.ascii_only
        colours = "none" if self.no_color else limits.colours
        filters: list[LineFilter] = []
        if colours != "all":
            filters.append(ReducedColours(colours=colours == "few"))
        if limits.ascii_only:
            filters.append(AsciiGlyphs())
        self._limit_filters = tuple(filters)

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Return our filters around the library's, in place of its shades of grey."""
        # Textual answers NO_COLOR with greys, which are colours as well.
        theirs = [self._printable, *super().get_line_filters()]
        if not self._limit_filters:
            return theirs
        return [*(one for one in theirs if not isinstance(one, Monochrome)), *self._limit_filters]

    def copy_to_clipboard(self, text: str) -> None:
        """Put text into the clipboard (OSC 52), without control characters."""
        text = printable(text)
        super().copy_to_clipboard(text)
        # By default tmux ignores this sequence of programs inside of it: use its own command.
        threading.Thread(target=copy_to_tmux, args=(text,), daemon=True).start()

    def get_key_display(self, binding: Binding) -> str:
        """Return the name of a key, in ASCII if the terminal lacks its sign."""
        sign = super().get_key_display(binding)
        return {"⏎": "Enter", "⌫": "Bksp"}.get(sign, sign) if self.ascii_only else sign

    def get_driver_class(self) -> type[Driver]:
        """Return a driver that sends only changes of the screen."""
        return _diffing_driver(super().get_driver_class())

    def on_resize(self) -> None:
        """Draw everything again: terminals differ in the cells they keep after a resize."""
        if self._drawn:
            self._forget()
            # Once more at its final size: frames sent during a drag are for other sizes.
            self.set_timer(_SETTLED, self.action_redraw)
        self._drawn = True

    def action_redraw(self) -> None:
        """Draw everything again, over the present content of the screen."""
        self._forget()
        # The timer may still fire while the screens close.
        if self.screen_stack:
            self.screen.refresh()

    def _forget(self) -> None:
        diff = getattr(self._driver, "terminal_diff", None)
        if diff is not None:
            diff.forget()


def _diffing_driver(base: type[Driver]) -> type[Driver]:
    """Return a driver like ``base`` that sends only changes of the screen."""

    # Made at run time, because the base depends on the platform and on the test harness.
    class DiffingDriver(base):  # type: ignore[misc, valid-type]
        """Sends the changes of frames; everything else goes through."""

        def __init__(self, *arguments: Any, **settings: Any) -> None:
            super().__init__(*arguments, **settings)
            self.terminal_diff = TerminalDiff()

        def write(self, data: str) -> None:
            """Send the changes in it; let the mouse report clicks and drags, but no moves."""
            if news := self.terminal_diff.reduce(data.replace("\x1b[?1003", "\x1b[?1002")):
                super().write(news)

    return DiffingDriver
