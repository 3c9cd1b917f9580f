"""Signals over time with a cursor: values at it, and those signals that matter most."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Final

import numpy as np
from rich.style import Style

from grammars.text.words import NOTHING, format_quantity
from scenario_tui.dashboard.signal_strips import RunTimeline, SignalStrip
from scenario_tui.dashboard.widgets.cell_view import CellView, Codes, write_text
from scenario_tui.dashboard.widgets.timeline_drawing import (
    CURSOR,
    CURVE,
    FAINT,
    HIT,
    LIMIT,
    NAME,
    OTHER,
    STYLES,
    TimelineDrawing,
)
from scenario_tui.text.formatting import keep_start

_LEAST_ROWS: Final = 3
"""Rows that name, value and limit of a signal take; a long name takes one more."""


def at_cursor(strip: SignalStrip, time: float) -> str:
    """Return the value at a moment, for people: ``0.123 m``, ``yes``, ``0.1–0.3 m``, ``∞ m``."""
    value, most = strip.between(time)
    if math.isnan(value):
        return NOTHING
    if strip.unit == "bool":
        return "yes" if most > 0.5 else "no"
    if _brief(value) == _brief(most):
        return format_quantity(most, strip.unit)
    # A thinned signal knows no more than that.
    return _range(value, most, strip.unit)


def _range(least: float, greatest: float, unit: str) -> str:
    """Return from where to where: ``0.1–0.3 m``; the lesser end to the third digit of the other."""
    size = max(abs(least), abs(greatest))
    if size and math.isfinite(size):
        places = 2 - math.floor(math.log10(size))
        # Also a zero that was less than nothing has no sign.
        least, greatest = round(least, places) + 0.0, round(greatest, places) + 0.0
    low, high = _brief(least, unit).removesuffix(f" {unit}"), _brief(greatest, unit)
    # A dash beside a minus sign would be read as one.
    return f"{low} to {high}" if min(least, greatest) < 0.0 else f"{low}–{high}"


def _brief(value: float, unit: str = "") -> str:
    return format_quantity(float(f"{value:.2g}"), unit)


class TimelineView(CellView):
    """Draws timelines, the first with its marks and the second over it, with a cursor."""

    STYLES: ClassVar[Sequence[Style]] = STYLES

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._timelines: tuple[RunTimeline, ...] = ()
        self._time = 0.0
        self._first = 0
        self._oracle = ""
        self._ramps = False
        self._drawing: TimelineDrawing | None = None

    @property
    def drawn(self) -> bool:
        """Whether it has anything to show."""
        return bool(self._timelines)

    @property
    def signals(self) -> tuple[SignalStrip, ...]:
        """The signals there are to see, what matters most first."""
        # What the chosen oracle reads, then what any reads; else in the order of the run. What only
        # counts is left out unless somebody asks for it.
        found = [
            strip
            for strip in (self._timelines[0].strips if self._timelines else ())
            if self._ramps or not strip.ramp or self._oracle in strip.readers
        ]
        found.sort(key=lambda strip: (self._oracle not in strip.readers, not strip.readers))
        return tuple(found)

    def show(self, timelines: Sequence[RunTimeline], time: float | None = None) -> None:
        """Show other runs, or more of the same, with the cursor at ``time`` [s]; or none."""
        self._timelines, self._drawing = tuple(timelines), None
        self._time = self._time if time is None else time
        self.redraw()

    def lead(self, oracle: str) -> None:
        """Show what an oracle reads above everything else."""
        if oracle != self._oracle or self._first:
            self._oracle, self._first, self._drawing = oracle, 0, None
            self.redraw()

    def toggle_ramps(self) -> bool:
        """Show signals that only count, too, or leave them out; return whether they are shown."""
        self._ramps, self._drawing = not self._ramps, None
        self._first = 0
        self.redraw()
        return self._ramps

    def move(self, time: float) -> None:
        """Put the cursor at a moment [s]."""
        if time != self._time:
            self._time = time
            self.redraw()

    def scroll_signals(self, step: int) -> None:
        """Show signals further down or up."""
        if self._drawing is None or (step > 0 and not self._drawing.more):
            return
        first = min(max(self._first + step, 0), max(len(self.signals) - 1, 0))
        if first != self._first:
            self._first, self._drawing = first, None
            self.redraw()

    def cells(self, columns: int, rows: int) -> tuple[Codes, Codes] | None:
        """Return the drawing with values and a line at the cursor."""
        if not self._timelines or columns < 12 or rows < 2:
            return None
        drawing = self._drawing
        if drawing is None or drawing.codes.shape != (rows, columns):
            drawing = self._drawing = TimelineDrawing(
                self._timelines, self.signals[self._first :], columns, rows
            )
        codes, owners = drawing.codes.copy(), drawing.owners.copy()
        column = drawing.gutter + drawing.span.column(self._time)
        line = codes[:, column]
        # A line where nothing is to be hidden; signs and curves under it are shown in reverse.
        empty = np.isin(line, [ord(" "), ord("·"), ord("─"), ord("╱")])
        owners[:, column] = np.where(empty, CURSOR, HIT)
        line[empty] = ord("│")
        label_signals(drawing, self._timelines, self._time, codes, owners)
        return codes, owners


def label_signals(
    drawing: TimelineDrawing,
    timelines: Sequence[RunTimeline],
    time: float,
    codes: Codes,
    owners: Codes,
) -> None:
    """Write beside every signal of a drawing what it is called and what it is at a moment [s]."""
    row = 0
    for strip, height in zip(drawing.strips, drawing.heights, strict=False):
        # A signal of one row has no scale.
        width = drawing.gutter - (drawing.ticks if height > 1 else 0) - 1
        same = [s for other in timelines[1:] for s in other.strips if s.name == strip.name]
        values = [at_cursor(strip, time)]
        values += [at_cursor(s, time) for s in same] or [NOTHING] * (len(timelines) - 1)
        words = _words(strip, values, width, height)
        for line, (text, owner) in enumerate(words[:height]):
            write_text(codes, owners, row + line, 0, keep_start(text, width), owner)
        row += height
    if drawing.more:
        text = f"> {drawing.more} more"[: drawing.gutter - 1]
        write_text(codes, owners, len(codes) - 1, 0, text, FAINT)


def _words(
    strip: SignalStrip, values: Sequence[str], width: int, height: int
) -> list[tuple[str, int]]:
    """Return the lines beside a signal: its name, values, limits, and from where to where."""
    said = " ┊ ".join(values)
    if height == 1:
        return [(f"{strip.name[: width - len(said) - 1]} {said}", NAME)]
    named = [strip.name]
    if len(strip.name) > width and height > _LEAST_ROWS:
        # Between its words, where it has any.
        cut = strip.name.rfind(" ", 0, width + 1)
        ends, begins = (cut, cut + 1) if cut > 0 else (width, width)
        named = [strip.name[:ends], strip.name[begins:]]
    words = [(name, NAME) for name in named]
    if len(said) > width and height > 2 and len(values) > 1:
        words += [(values[0], CURVE), (f"┊ {values[1]}", OTHER)]
    else:
        words.append((said, CURVE))
    if strip.limits:
        limits = ", ".join(format_quantity(limit, strip.unit) for limit in strip.limits)
        words.append((f"limit {limits}", LIMIT))
    known = np.isfinite(strip.values)
    if known.any():
        most = strip.values if strip.most is None else strip.most
        least, greatest = strip.values[known].min(), most[known].max()
        if _brief(least) != _brief(greatest):
            words.append((_range(least, greatest, strip.unit), FAINT))
    return words
