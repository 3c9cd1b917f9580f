"""Signals over time with a playhead: its values, seeking by the mouse, zoom of the time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Final

import numpy as np
from rich.style import Style
from rich.text import Text
from textual import events, on
from textual.message import Message

from daemon.judging.signals import RunSignal, TimeSpan
from daemon.trace import Trace
from grammars.text.words import NOTHING, format_quantity
from scenario_tui.dashboard.run_timeline import RunTimeline, waypoint_names
from scenario_tui.dashboard.widgets.cell_view import CellView, Codes, text_lines, write_text
from scenario_tui.dashboard.widgets.timeline_drawing import (
    BEHIND,
    CURSOR,
    CURVE,
    FAIL,
    FAINT,
    LIMIT,
    NAME,
    OTHER,
    STYLES,
    TimelineDrawing,
    whole_span,
)
from scenario_tui.text.formatting import keep_start

ZOOM: Final = 0.7
"""Share of the time that stays in view at each zoom step."""
_SHORTEST: Final = 0.1
"""Shortest visible time range [s]."""
_MARGIN: Final = 0.1
"""Share of a new time range before the playhead that has left the old one."""
_LEAST_ROWS: Final = 3
"""Rows for name, value and limit of a signal; a long name takes one more."""
_COUNTING: Final = frozenset(
    {
        "elapsed", "path.length", "mission.leg", "mission.leg.elapsed", "mission.reached",
        "mission.remaining",
    }
)  # fmt: skip
"""Signals that only count, or that repeat the lane of the mission."""
_ASKED: Final = {"above": "≤ ", "below": "≥ ", "": "limit "}
"""Signs of limits, by the side on which a signal contradicts oracles."""

_COLOURS: Final = (
    "yellow", "bold yellow", "cyan", "red", "cyan", "green", "bold red", "dim", "bold", "bold",
)  # fmt: skip
"""The terminal's own colours in the dashboard's order, because the background is unknown here."""
LEAST_ROWS: Final = 4
"""Least rows of a signal; a Boolean one takes one row."""
AXES: Final = 2
"""Rows below the signals: mission and time."""


class TimelineView(CellView):
    """Draws timelines, the first with its marks and the second over it, with a playhead.

    A click or a drag posts :class:`Seek`, and the wheel zooms the time around the pointer.
    """

    STYLES: ClassVar[tuple[Style, ...]] = STYLES
    ALLOW_SELECT = False

    class Seek(Message):
        """A click at the moment ``time`` [s]."""

        def __init__(self, time: float) -> None:
            super().__init__()
            self.time = time

    _timelines: tuple[RunTimeline, ...] = ()
    _time = 0.0
    _first = 0
    _oracle = ""
    _counting = False
    _stretch: TimeSpan | None = None
    _drawing: TimelineDrawing | None = None

    @property
    def drawn(self) -> bool:
        """True once it has a run to show."""
        return bool(self._timelines)

    @property
    def signals(self) -> tuple[RunSignal, ...]:
        """The visible signals: those of the chosen oracle, then of other oracles, then the rest."""
        visible = [
            signal
            for signal in (self._timelines[0].signals if self._timelines else ())
            if self._counting or signal.name not in _COUNTING or self._oracle in signal.readers
        ]
        visible.sort(key=lambda signal: (self._oracle not in signal.readers, not signal.readers))
        return tuple(visible)

    def show(self, timelines: Sequence[RunTimeline]) -> None:
        """Show timelines, with the playhead where it was."""
        self._timelines = tuple(timelines)
        if self._stretch and self._stretch[0] >= whole_span(timelines)[1]:
            self._stretch = None  # it belongs to another run or attempt
        self._draw_anew()

    def lead(self, oracle: str) -> None:
        """Show the signals of an oracle first."""
        if oracle != self._oracle or self._first:
            self._oracle, self._first = oracle, 0
            self._draw_anew()

    def toggle_counting(self) -> None:
        """Show or hide signals that only count."""
        self._counting, self._first = not self._counting, 0
        self._draw_anew()

    def move(self, time: float) -> None:
        """Put the playhead at a moment [s]."""
        if time != self._time:
            was_in_view, self._time = self._is_in_view(), time
            if was_in_view:
                self.reveal()  # the time range moves along
            self.redraw()

    def _is_in_view(self) -> bool:
        return self._stretch is None or self._stretch[0] <= self._time <= self._stretch[1]

    def reveal(self) -> None:
        """Move the visible time range to the playhead, unless that is in view."""
        if self._stretch is not None and not self._is_in_view():
            start, end = self._stretch
            share = _MARGIN if self._time > end else 1.0 - _MARGIN
            self._show_stretch(end - start, self._time, share)

    def zoom_time(self, nearer: bool, around: float | None = None) -> None:
        """Zoom the time in or out; a moment [s], or the playhead, keeps its column."""
        if not self._timelines:
            return
        start, end = self._stretch or whole_span(self._timelines)
        at = min(max(self._time if around is None else around, start), end)
        length = (end - start) * (ZOOM if nearer else 1.0 / ZOOM)
        self._show_stretch(length, at, (at - start) / max(end - start, 1e-9))

    def fit_time(self) -> None:
        """Show the whole time again."""
        self._stretch = None
        self._draw_anew()

    def _show_stretch(self, length: float, time: float, share: float) -> None:
        """Show a time range with a moment at a share of its length, at most the whole time."""
        start, end = whole_span(self._timelines)
        length = max(length, _SHORTEST)
        first = min(max(time - share * length, start), end - length)
        # With a tolerance, so that equal steps in and out show the whole time despite rounding.
        is_part = length < (end - start) * (1.0 - 1e-9)
        self._stretch = (first, first + length) if is_part else None
        self._draw_anew()

    def _draw_anew(self) -> None:
        self._drawing = None
        self.redraw()

    def scroll_signals(self, step: int) -> None:
        """Show signals further down or up."""
        if step < 0 or (self._drawing is not None and self._drawing.more):
            self._first = max(self._first + step, 0)
            self._draw_anew()

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """Seek the moment, and begin a drag."""
        if event.button == 1 and self._drawing and self._column(event) >= self._drawing.gutter:
            self.capture_mouse()
            self._seek(event)

    def on_mouse_move(self, event: events.MouseMove) -> None:
        """Seek while the button is held."""
        if self.app.mouse_captured is self:
            self._seek(event)

    def on_mouse_up(self) -> None:
        """End a drag."""
        self.release_mouse()

    @on(events.MouseScrollUp)
    @on(events.MouseScrollDown)
    def _zoom_at(self, event: events.MouseEvent) -> None:
        """Zoom the time around the pointer."""
        event.stop()
        if self._drawing is not None:
            nearer = isinstance(event, events.MouseScrollUp)
            self.zoom_time(nearer, self._drawing.moment(self._column(event)))

    def _seek(self, event: events.MouseEvent) -> None:
        if self._drawing is not None:
            time = self._drawing.moment(self._column(event))
            if time != self._time:
                self.post_message(self.Seek(time))

    def _column(self, event: events.MouseEvent) -> int:
        """Return the column of the pointer."""
        return event.get_content_offset_capture(self).x

    def cells(self, columns: int, rows: int) -> tuple[Codes, Codes] | None:
        """Return the drawing with values and a line at the playhead."""
        if not self._timelines or columns < 12 or rows < 2:
            return None
        drawing = self._drawing
        if drawing is None or drawing.codes.shape != (rows, columns):
            signals = self.signals[self._first :]
            drawing = self._drawing = TimelineDrawing(
                self._timelines, signals, columns, rows, self._stretch
            )
        return draw_frame(drawing, self._time, (self._time,), CURSOR)


def draw_frame(
    drawing: TimelineDrawing, time: float, lines: Sequence[float], owner: int
) -> tuple[Codes, Codes]:
    """Return the cells of a drawing with the values at a moment, and upright lines at others."""
    codes, owners = drawing.codes.copy(), drawing.owners.copy()
    span = drawing.span
    for column in {drawing.gutter + span.column(at) for at in lines if span.meets(at, at)}:
        line = codes[:, column]
        # Over empty cells, also within shades; other cells only get a background.
        free = np.isin(line, [ord(" "), ord("·"), ord("─")])
        beside = codes[:, [column - 1, min(column + 1, codes.shape[1] - 1)]]
        free |= (line == ord("░")) & (beside == ord("░")).all(axis=1)
        line[free], owners[free, column] = ord("│"), owner
        owners[~free, column] += BEHIND
    row = 0
    for signal, height in zip(drawing.signals, drawing.heights, strict=False):
        # A signal of one row has no scale.
        width = drawing.gutter - (drawing.ticks if height > 1 else 0) - 1
        values = [at_playhead(signal, time)]
        if len(drawing.timelines) > 1:
            values += [at_playhead(other, time) for other in drawing.others(signal)] or [NOTHING]
        for below, (text, style) in enumerate(_words(signal, values, width, height)[:height]):
            write_text(codes, owners, row + below, 0, keep_start(text, width), style)
        row += height
    return codes, owners


def at_playhead(signal: RunSignal, time: float) -> str:
    """Return the value at a moment: ``0.123 m``, ``yes``, ``0.1–0.3 m``, ``∞ m``."""
    least, most = signal.at(time)
    if math.isnan(least):
        return NOTHING
    if signal.unit == "bool":
        return "yes" if most > 0.5 else "no"
    if _brief(least) == _brief(most):
        return format_quantity(most, signal.unit)
    # A thinned signal has only a range.
    return _range(least, most, signal.unit)


def _range(least: float, greatest: float, unit: str) -> str:
    """Return a range: ``0.1–0.3 m``, rounded to the third digit of the larger end."""
    size = max(abs(least), abs(greatest))
    if size and math.isfinite(size):
        places = 2 - math.floor(math.log10(size))
        # Adding zero removes the sign of a negative zero.
        least, greatest = round(least, places) + 0.0, round(greatest, places) + 0.0
    low, high = _brief(least, unit).removesuffix(f" {unit}"), _brief(greatest, unit)
    # A dash beside a minus sign would look like another one.
    return f"{low} to {high}" if min(least, greatest) < 0.0 else f"{low}–{high}"


def _brief(value: float, unit: str = "") -> str:
    return format_quantity(float(f"{value:.2g}"), unit)


def _words(
    signal: RunSignal, values: Sequence[str], width: int, height: int
) -> list[tuple[str, int]]:
    """Return the lines beside a signal: its name, values, limits, and range."""
    text = " ┊ ".join(values)
    if height == 1:
        return [(f"{signal.name[: width - len(text) - 1]} {text}", NAME)]
    named = [signal.name]
    if len(signal.name) > width and height > _LEAST_ROWS:
        # Between its words, if it has any.
        cut = signal.name.rfind(" ", 0, width + 1)
        ends, begins = (cut, cut + 1) if cut > 0 else (width, width)
        named = [signal.name[:ends], signal.name[begins:]]
    words = [(name, NAME) for name in named]
    if len(text) > width and height > 2 and len(values) > 1:
        words += [(values[0], CURVE), (f"┊ {values[1]}", OTHER)]
    else:
        words.append((text, CURVE))
    if signal.limits:
        limits = [
            _ASKED[one.side] + format_quantity(one.value, signal.unit) for one in signal.limits
        ]
        words.append((", ".join(limits), LIMIT))
    finite = np.isfinite(signal.low)
    if finite.any():
        least, greatest = signal.low[finite].min(), signal.high[finite].max()
        if _brief(least) != _brief(greatest):
            words.append((_range(least, greatest, signal.unit), FAINT))
    return words


def draw_signals(
    trace: Trace,
    signals: Sequence[RunSignal],
    width: int,
    rows: int,
    *,
    marks: Sequence[float] = (),
) -> list[Text]:
    """Return signals one above the other, with upright lines at ``marks`` [s].

    They take ``rows``, or more if necessary. The value beside a signal is its last one.
    """
    # The dashboard loads this module, and the judging code takes 70 MB.
    from daemon.judging.live import reached_moments

    start, end = float(trace.ground_truth.time[0]), float(trace.ground_truth.time[-1])
    timeline = RunTimeline(
        start, end, tuple(signals), None, reached_moments(trace), waypoint_names(trace.spec),
        tuple(marks),
    )  # fmt: skip
    least = sum(1 if signal.unit == "bool" else LEAST_ROWS for signal in signals)
    drawing = TimelineDrawing((timeline,), signals, width, max(rows, least + AXES))
    styles = [Style.parse(colour) for colour in _COLOURS] * 2
    lines = text_lines(*draw_frame(drawing, end, marks, FAIL), styles)
    for line in lines:
        line.rstrip()
    return lines
