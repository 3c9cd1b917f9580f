"""Signals over time, one above the other, with doors, mission and verdicts on the axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Final

import numpy as np
from rich.style import Style

from grammars.model.geometry import Floats
from scenario_tui.dashboard.signal_strips import RunTimeline, SignalStrip
from scenario_tui.dashboard.widgets.cell_view import Canvas, CellView, Codes
from scenario_tui.text.formatting import BAD, BUSY, FACT, GOOD, NOTHING, QUIET, UNSURE, quantity

_LIMIT, _OTHER, _CURVE = range(3)
_AGAINST, _EVENT, _DONE, _FAIL, _QUIET, _NAME, _CURSOR, _HIT = range(3, 11)
_STYLES: Final = (
    Style(color=UNSURE),
    Style(color=UNSURE, bold=True),
    Style(color=BUSY),
    Style(color=BAD),
    Style(color=FACT),
    Style(color=GOOD),
    Style(color=BAD, bold=True),
    Style(color=QUIET),
    Style(bold=True),
    Style(color=FACT, bold=True),
    Style(reverse=True),
)
GUTTER: Final = 20
"""Columns for what a signal is called and its value at the cursor."""
AXIS: Final = 3
"""Rows below the signals: doors, mission, time."""
_ROWS: Final = 4
"""Rows of a signal at most; what is true or false takes one."""
LEGEND: Final = "░ against an oracle  o opens c closes x both  ◇ waypoint done  ✗ decided"


@dataclass(frozen=True, slots=True)
class _Span:
    """The stretch of time drawn [s] and the columns it takes."""

    start: float
    end: float
    columns: int

    def column(self, time: float) -> int:
        """Return the column of a moment, the nearest there is."""
        share = (time - self.start) / max(self.end - self.start, 1e-9)
        return min(max(round(share * (self.columns - 1)), 0), self.columns - 1)


def ranges(strip: SignalStrip, start: float, end: float, count: int) -> tuple[Floats, Floats]:
    """Return the least and greatest value of a signal in each of ``count`` parts of a time.

    The first value of a part is also the last of the one before, so that the curve has no gaps; a
    spike of one sample stays to be seen. NaN where nothing is known.
    """
    low, high = np.full(count, np.nan), np.full(count, np.nan)
    known = np.isfinite(strip.values)
    time, values = strip.time[known], strip.values[known]
    if not len(time):
        return low, high
    # From the last sample at or before an edge: values hold until the next one is written.
    edges = np.linspace(start, end, count + 1)
    first = np.searchsorted(time, edges[:-1] + 1e-9, side="right") - 1
    last = np.searchsorted(time, edges[1:] + 1e-9, side="right")
    for part, (a, b) in enumerate(zip(np.maximum(first, 0).tolist(), last.tolist(), strict=True)):
        if b > a:
            low[part], high[part] = values[a:b].min(), values[a:b].max()
    return low, high


def fit_heights(strips: Sequence[SignalStrip], rows: int) -> list[int]:
    """Return how many rows each signal gets, for as many of the first ones as ``rows`` hold."""
    heights: list[int] = []
    for strip in strips:
        least = 1 if strip.unit == "bool" else 2
        if sum(heights) + least > rows:
            break
        heights.append(least)
    while sum(heights) < rows:
        small = [i for i, h in enumerate(heights) if strips[i].unit != "bool" and h < _ROWS]
        if not small:
            break
        # The lowest one next, the first of several: all grow evenly, those above first.
        heights[min(small, key=heights.__getitem__)] += 1
    return heights


class TimelineDrawing:
    """The cells of timelines drawn one over the other, without the cursor."""

    # The cursor alone moves while a run is played: this is drawn once and copied for each frame.

    def __init__(
        self, timelines: Sequence[RunTimeline], first: int, columns: int, rows: int
    ) -> None:
        self.codes: Codes = np.full((rows, columns), ord(" "), dtype=np.int32)
        self.owners: Codes = np.full((rows, columns), -1, dtype=np.int32)
        # Two values need room beside each other.
        self.gutter = min(GUTTER, columns // (3 if len(timelines) == 1 else 2))
        ends = max(c.end for c in timelines)
        self.span = _Span(min(c.start for c in timelines), ends, max(columns - self.gutter, 1))
        lead = timelines[0]
        self.strips = lead.strips[first:]
        below = AXIS + len(timelines) - 1
        self.heights = fit_heights(self.strips, max(rows - below, 0))
        self.more = len(self.strips) - len(self.heights)
        row = 0
        for strip, height in zip(self.strips, self.heights, strict=False):
            others = [s for c in timelines[1:] for s in c.strips if s.name == strip.name]
            self._draw(strip, others, row, height)
            row += height
        self.axis = max(rows - below, 0) if row else 0
        self._events(timelines)

    def _draw(
        self, strip: SignalStrip, others: Sequence[SignalStrip], top: int, height: int
    ) -> None:
        if strip.unit == "bool":
            self._flag(strip, others, top)
            return
        span, canvas = self.span, Canvas(self.span.columns, height, 3)
        drawn = [strip, *others[:1]]
        curves = [ranges(s, span.start, span.end, canvas.width) for s in drawn]
        low, high = limits_of(strip, curves)
        scale = (canvas.height - 1) / (high - low)

        def dots(values: Floats) -> Floats:
            return (high - values) * scale

        for limit in strip.limits:
            if low <= limit <= high:
                x = np.arange(0.0, canvas.width, 4)  # dotted: told from the curve without colour
                canvas.points(np.column_stack([x, np.full(len(x), dots(np.array(limit)))]), _LIMIT)
        for (least, most), layer in zip(curves, (_CURVE, _OTHER), strict=False):
            x = np.flatnonzero(np.isfinite(least))
            x = x[::2] if layer == _OTHER else x  # told from the other one without colour
            lines = np.column_stack([x, dots(least[x]), x, dots(most[x])])
            canvas.lines(lines, layer)
        codes, owners = canvas.cells()
        self._shade(strip, codes, owners)
        self._put(top, codes, owners)

    def _flag(self, strip: SignalStrip, others: Sequence[SignalStrip], top: int) -> None:
        """Draw what is true or false as one row: a block where it is true."""
        span = self.span
        _, high = ranges(strip, span.start, span.end, span.columns)
        codes = np.where(high > 0.5, ord("▆"), ord("▁")).astype(np.int32)
        owners = np.full(span.columns, _CURVE, dtype=np.int32)
        codes[np.isnan(high)] = ord(" ")
        if others:
            _, theirs = ranges(others[0], span.start, span.end, span.columns)
            differ = np.isfinite(theirs) & ((theirs > 0.5) != (high > 0.5))
            codes[differ], owners[differ] = ord("▒"), _OTHER
        codes, owners = codes[None, :], owners[None, :]
        self._shade(strip, codes, owners)
        self._put(top, codes, owners)

    def _shade(self, strip: SignalStrip, codes: Codes, owners: Codes) -> None:
        """Mark the stretches the run spoke against an oracle, by glyph and by colour."""
        for start, end in strip.against:
            part = slice(self.span.column(start), self.span.column(end) + 1)
            # Beside the curve where there is room, or else over its first row: without colour the
            # stretch must be seen, and so must the curve.
            empty = (codes[:, part] == ord(" ")) | (codes[:, part] == ord("▁"))
            codes[:, part][empty] = ord("░")
            codes[0, part][~empty.any(axis=0)] = ord("░")
            owners[:, part] = _AGAINST

    def _put(self, top: int, codes: Codes, owners: Codes) -> None:
        rows = min(len(codes), len(self.codes) - top)
        self.codes[top : top + rows, self.gutter :] = codes[:rows]
        self.owners[top : top + rows, self.gutter :] = owners[:rows]

    def write(self, row: int, column: int, text: str, owner: int) -> None:
        """Write words into a row, as far as it goes."""
        if not 0 <= row < len(self.codes):
            return
        room = text[: max(self.codes.shape[1] - column, 0)]
        self.codes[row, column : column + len(room)] = [ord(c) for c in room]
        self.owners[row, column : column + len(room)] = owner

    def _events(self, timelines: Sequence[RunTimeline]) -> None:
        """Draw doors of the first run, the mission of every one, and the axis of time."""
        doors, span = self.axis, self.span
        self.write(doors, 0, "doors", _NAME)
        self.write(doors, self.gutter, "·" * span.columns, _QUIET)
        for event in timelines[0].doors if doors < len(self.codes) else ():
            column = self.gutter + span.column(event.time)
            seen, sign = chr(self.codes[doors, column]), "o" if event.opens else "c"
            self.write(doors, column, "x" if seen not in ("·", sign) else sign, _EVENT)
        for row, timeline in enumerate(timelines, start=doors + 1):
            self.write(row, 0, "mission", _NAME)
            self._mission(row, timeline)
        axis = doors + 1 + len(timelines)
        self._axis(axis)
        for row, timeline in enumerate(timelines, start=axis if len(timelines) == 1 else doors + 1):
            for time in timeline.decided:
                self.write(row, self.gutter + span.column(time), "✗", _FAIL)

    def _mission(self, row: int, timeline: RunTimeline) -> None:
        """Draw the legs: a diamond where a waypoint is done, then the number of the next leg."""
        at, span = self.gutter, self.span
        begins, ends = span.column(timeline.start), span.column(timeline.end)
        self.write(row, at + begins, "─" * (ends - begins + 1), _QUIET)
        self.write(row, at + begins, "1", _QUIET)
        for number, time in enumerate(timeline.reached, start=1):
            column = at + span.column(time)
            self.write(row, column, "◇", _DONE)
            if number < timeline.waypoints:
                self.write(row, column + 1, str(number + 1), _QUIET)

    def _axis(self, row: int) -> None:
        span, at = self.span, self.gutter
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            text = f"{span.start + share * (span.end - span.start):.0f} s"
            column = round(share * (span.columns - 1)) - round(share * (len(text) - 1))
            if share in (0.0, 1.0) or span.columns > 50:
                self.write(row, at + column, text, _QUIET)


def limits_of(strip: SignalStrip, curves: Sequence[tuple[Floats, Floats]]) -> tuple[float, float]:
    """Return the least and greatest value a graph shows: of the curves, and limits near them."""
    # Limits far away are left out: the curve would become a flat line at the other end.
    known = np.concatenate([part[np.isfinite(part)] for curve in curves for part in curve])
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    size = max(high - low, 1e-9)
    for limit in strip.limits:
        if low - size <= limit <= high + size:
            low, high = min(low, limit), max(high, limit)
    return (low, high) if high - low > 1e-9 else (low - 0.5, high + 0.5)


def at_cursor(strip: SignalStrip, time: float) -> str:
    """Return the value at a moment, for people: ``0.123 m``, ``yes``, ``∞ m``."""
    value = strip.at(time)
    if math.isnan(value):
        return NOTHING
    return ("yes" if value > 0.5 else "no") if strip.unit == "bool" else quantity(value, strip.unit)


class TimelineView(CellView):
    """Draws timelines, the first with its marks and the second over it, with a cursor."""

    STYLES: ClassVar[Sequence[Style]] = _STYLES

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._timelines: tuple[RunTimeline, ...] = ()
        self._time = 0.0
        self._first = 0
        self._drawing: TimelineDrawing | None = None

    @property
    def drawn(self) -> bool:
        """Whether it has anything to show."""
        return bool(self._timelines)

    def show(self, timelines: Sequence[RunTimeline]) -> None:
        """Show other runs, or none."""
        self._timelines, self._first, self._drawing = tuple(timelines), 0, None
        self.redraw()

    def lead(self, oracle: str) -> None:
        """Show what an oracle reads above everything else."""
        if not self._timelines:
            return
        first, *others = self._timelines
        ordered = sorted(first.strips, key=lambda strip: oracle not in strip.readers)
        if [s.name for s in ordered] != [s.name for s in first.strips] or self._first:
            self._timelines = (replace(first, strips=tuple(ordered)), *others)
            self._first, self._drawing = 0, None
            self.redraw()

    def move(self, time: float) -> None:
        """Put the cursor at a moment [s]."""
        if time != self._time:
            self._time = time
            self.redraw()

    def scroll_signals(self, step: int) -> None:
        """Show signals further down or up."""
        if self._drawing is None or (step > 0 and not self._drawing.more):
            return
        first = min(max(self._first + step, 0), max(len(self._timelines[0].strips) - 1, 0))
        if first != self._first:
            self._first, self._drawing = first, None
            self.redraw()

    def cells(self, columns: int, rows: int) -> tuple[Codes, Codes] | None:
        """Return the drawing with values and a line at the cursor."""
        if not self._timelines or columns < 12 or rows < 2:
            return None
        drawing = self._drawing
        if drawing is None or drawing.codes.shape != (rows, columns):
            drawing = self._drawing = TimelineDrawing(self._timelines, self._first, columns, rows)
        codes, owners = drawing.codes.copy(), drawing.owners.copy()
        column = drawing.gutter + drawing.span.column(self._time)
        line = codes[:, column]
        # A line where nothing is to be hidden; signs and curves under it are shown in reverse.
        empty = np.isin(line, [ord(" "), ord("·"), ord("─")])
        owners[:, column] = np.where(empty, _CURSOR, _HIT)
        line[empty] = ord("│")
        self._label(drawing, codes, owners)
        return codes, owners

    def _label(self, drawing: TimelineDrawing, codes: Codes, owners: Codes) -> None:
        """Write beside every signal what it is called and what it is at the cursor."""
        row, width = 0, drawing.gutter - 1
        for strip, height in zip(drawing.strips, drawing.heights, strict=False):
            said = at_cursor(strip, self._time)
            if len(self._timelines) > 1:
                same = (s for s in self._timelines[1].strips if s.name == strip.name)
                said += " ┊ " + next((at_cursor(s, self._time) for s in same), NOTHING)
            words = [(strip.name, _NAME), (said, _CURVE)]
            if height == 1:
                words = [(f"{strip.name[: width - len(said) - 1]} {said}", _NAME)]
            if strip.limits and height > 2:
                limits = ", ".join(quantity(limit, strip.unit) for limit in strip.limits)
                words.append((f"limit {limits}", _LIMIT))
            for line, (text, owner) in enumerate(words[:height]):
                shown = text if len(text) <= width else f"{text[: width - 1]}…"
                codes[row + line, : len(shown)] = [ord(c) for c in shown]
                owners[row + line, : len(shown)] = owner
            row += height
        if drawing.more:
            text = f"> {drawing.more} more"[:width]
            codes[-1, : len(text)] = [ord(c) for c in text]
            owners[-1, : len(text)] = _QUIET
