"""Signals over time as cells: curves on their own scales, limits, doors, mission, time."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from rich.style import Style

from daemon.judging.signals import RunSignal, TimeSpan
from daemon.model.live_judgement import DoorMotion
from grammars.model.geometry import Floats
from grammars.text.words import format_quantity
from scenario_tui.dashboard.run_timeline import RunTimeline
from scenario_tui.dashboard.widgets.cell_view import Canvas, Codes, write_text
from scenario_tui.text import styles
from scenario_tui.text.formatting import keep_start
from scenario_tui.text.scale import AxisScale, fit_axis, mark_axis, tick_text

LIMIT, OTHER, CURVE, AGAINST, EVENT, DONE, FAIL, FAINT, NAME, CURSOR = range(10)
_PLAIN: Final = (
    Style(color=styles.COLOURS[styles.UNSURE]),
    Style(color=styles.COLOURS[styles.UNSURE], bold=True),
    Style(color=styles.COLOURS[styles.BUSY]),
    Style(color=styles.COLOURS[styles.BAD]),
    Style(color=styles.COLOURS[styles.FACT]),
    Style(color=styles.COLOURS[styles.GOOD]),
    Style(color=styles.COLOURS[styles.BAD], bold=True),
    Style(color=styles.COLOURS[styles.QUIET]),
    Style(bold=True),
    Style(color=styles.COLOURS[styles.FACT], bold=True),
)
BEHIND: Final = len(_PLAIN)
"""Offset of the style of a cell in front of the playhead."""
STYLES: Final = (*_PLAIN, *(style + Style(bgcolor=styles.MARKED) for style in _PLAIN))
_GUTTER: Final = 27
"""Columns for the name of a signal, its value at the cursor, and its scale."""
_TICKS: Final = 7
"""Columns of the scale, if there is room for the whole gutter."""
_LANES: Final = 6
"""Rows of the whole drawing per row for doors."""
_LEAST: Final = 3
"""Least rows of a signal; a Boolean one takes one row."""
_LITTLE: Final = 9
"""Rows of a drawing below which a signal takes two rows."""
_APART: Final = 12
"""Least columns between two marks of the time."""
LEGEND: Final = "░ against oracle  ━ door open  ◇ waypoint  ✗ decided"


@dataclass(frozen=True, slots=True)
class PlottedSpan:
    """The drawn time range [s] and its columns."""

    start: float
    end: float
    columns: int

    def column(self, time: float) -> int:
        """Return the column of a moment, or the nearest one."""
        share = (time - self.start) / max(self.end - self.start, 1e-9)
        return min(max(round(share * (self.columns - 1)), 0), self.columns - 1)

    def moment(self, column: int) -> float:
        """Return the moment [s] of a column, or the nearest one."""
        share = min(max(column / max(self.columns - 1, 1), 0.0), 1.0)
        return self.start + share * (self.end - self.start)

    def meets(self, start: float, end: float) -> bool:
        """Return True if any part of a time range is drawn."""
        return start <= self.end and end >= self.start


def whole_span(timelines: Sequence[RunTimeline]) -> TimeSpan:
    """Return the time range [s] of all timelines, with room for the future of a running run."""
    ends = (max(one.end, one.horizon or one.end) for one in timelines)
    return min(one.start for one in timelines), max(ends)


def ranges(signal: RunSignal, start: float, end: float, count: int) -> tuple[Floats, Floats]:
    """Return the least and greatest value of a signal in each of ``count`` parts of a time.

    The first value of a part is also the last of the one before, so that the curve has no gaps. A
    spike of one sample stays visible. Unknown values are NaN.
    """
    low, high = np.full(count, np.nan), np.full(count, np.nan)
    finite = np.isfinite(signal.low)
    time, least, most = signal.time[finite], signal.low[finite], signal.high[finite]
    if not len(time):
        return low, high
    # From the last sample at or before an edge, because a value holds until the next one.
    edges = np.linspace(start, end, count + 1)
    first = np.maximum(np.searchsorted(time, edges[:-1] + 1e-9, side="right") - 1, 0)
    last = np.searchsorted(time, edges[1:] + 1e-9, side="right")
    # An empty part reduces to its first value, and is left out. The appended value is never used.
    stretches = np.column_stack([first, last]).ravel()
    filled = (last > first) & (edges[:-1] <= signal.time[-1])
    low[filled] = np.minimum.reduceat(np.append(least, np.inf), stretches)[::2][filled]
    high[filled] = np.maximum.reduceat(np.append(most, -np.inf), stretches)[::2][filled]
    return low, high


def fit_heights(signals: Sequence[RunSignal], rows: int) -> list[int]:
    """Return the rows of each signal, for as many of the first ones as fit into ``rows``."""
    heights: list[int] = []
    smallest = 2 if rows < _LITTLE else _LEAST
    for signal in signals:
        least = 1 if signal.unit == "bool" else smallest
        if sum(heights) + least > rows:
            break
        heights.append(least)
    tall = [i for i, _ in enumerate(heights) if signals[i].unit != "bool"]
    spare = rows - sum(heights)
    for place, index in enumerate(tall):
        # All grow evenly, the upper ones first.
        heights[index] += spare // len(tall) + (place < spare % len(tall))
    return heights


def _scale_of(signal: RunSignal, curves: Sequence[tuple[Floats, Floats]], rows: int) -> AxisScale:
    """Return the scale of the drawn values, with the limits in view."""
    limits = [limit.value for limit in signal.limits]
    values = np.concatenate([part[np.isfinite(part)] for curve in curves for part in curve])
    if not len(values):
        values = np.array(limits or [0.0, 1.0])
    return fit_axis(float(values.min()), float(values.max()), limits, rows)


class TimelineDrawing:
    """The cells of overlaid timelines, without the cursor.

    ``signals`` are those of the first one, in their order. A ``stretch`` [s] limits the time.
    """

    # Drawn once and copied for each frame, because only the cursor moves in a replay.

    def __init__(
        self,
        timelines: Sequence[RunTimeline],
        signals: Sequence[RunSignal],
        columns: int,
        rows: int,
        stretch: TimeSpan | None = None,
    ) -> None:
        self.codes: Codes = np.full((rows, columns), ord(" "), dtype=np.int32)
        self.owners: Codes = np.full((rows, columns), -1, dtype=np.int32)
        # Two values need room beside each other.
        self.gutter = min(_GUTTER, columns * 3 // 8 if len(timelines) == 1 else columns // 2)
        self.ticks = _TICKS if self.gutter > 2 * _TICKS else 0
        whole = whole_span(timelines)
        self.span = PlottedSpan(*(stretch or whole), max(columns - self.gutter, 1))
        self.timelines, self.signals = timelines, signals
        with_doors = [timeline for timeline in timelines if timeline.doors is not None]
        most = max(1, 2 * rows // (_LANES * (1 + len(timelines))))
        doors = _door_lanes([timeline.doors or () for timeline in with_doors], most)
        room = max(rows - len(doors) * len(with_doors) - len(timelines) - 1, 0)
        self.heights = fit_heights(signals, room)
        row = 0
        for signal, height in zip(signals, self.heights, strict=False):
            self._draw(signal, self.others(signal), row, height)
            row += height
        row = room if row else 0
        for name, joints in doors:
            for timeline in with_doors:
                self._label(row, name if timeline is with_doors[0] else f"┊ {name}")
                self._door(row, timeline, joints)
                row += 1
        axis = row + len(timelines)
        self._axis(axis, None if stretch is None else whole[1])
        for timeline in timelines:
            self._label(row, "mission" if timeline is timelines[0] else "┊ mission")
            self._mission(row, timeline)
            for time in timeline.decided:
                self._bar(row if len(timelines) > 1 else axis, time, time, "✗", FAIL)
            row += 1

    @property
    def more(self) -> int:
        """The number of signals without room."""
        return len(self.signals) - len(self.heights)

    def moment(self, column: int) -> float:
        """Return the moment [s] of a column; that of the first ``✗`` in it, if any."""
        decided = (time for timeline in self.timelines for time in timeline.decided)
        span, place = self.span, column - self.gutter
        here = (t for t in decided if span.meets(t, t) and span.column(t) == place)
        return next(here, span.moment(place))

    def others(self, signal: RunSignal) -> list[RunSignal]:
        """Return the signals of that name in the other timelines."""
        return [s for one in self.timelines[1:] for s in one.signals if s.name == signal.name]

    def _draw(self, signal: RunSignal, others: Sequence[RunSignal], top: int, height: int) -> None:
        if signal.unit == "bool":
            self._flag(signal, others, top)
            return
        span, canvas = self.span, Canvas(self.span.columns, height, 3)
        both = [signal, *others[:1]]
        curves = [ranges(one, span.start, span.end, canvas.width) for one in both]
        scale = _scale_of(signal, curves, height)
        size = (canvas.height - 1) / (scale.high - scale.low)

        def dots(values: Floats) -> Floats:
            return (scale.high - values) * size

        for limit in signal.limits:
            at = dots(np.array(min(max(limit.value, scale.low), scale.high)))
            canvas.dotted_line(float(at), LIMIT)
        for (least, most), layer in zip(curves, (CURVE, OTHER), strict=False):
            x = np.flatnonzero(np.isfinite(least))
            x = x[::2] if layer == OTHER else x  # distinct without colours
            canvas.bars(x.astype(np.int32), dots(most[x]), dots(least[x]), layer)
        self._put(signal, top, *canvas.cells())
        if self.ticks:
            self._scale(signal, scale, top, height)

    def _scale(self, signal: RunSignal, scale: AxisScale, top: int, height: int) -> None:
        """Write round numbers and all limits beside the curve."""
        axis = self.gutter - 1
        self.codes[top : top + height, axis] = ord("│")
        self.owners[top : top + height, axis] = FAINT
        marks = [(value, tick_text(value, scale.step), FAINT) for value in scale.ticks]
        # Limits come last, because they are more important than a tick in the same row.
        for limit in signal.limits:
            text = format_quantity(limit.value, "")
            if not 0.0 <= scale.share(limit.value) <= 1.0:
                text = ("↑" if limit.value > scale.high else "↓") + text
            marks.append((min(max(limit.value, scale.low), scale.high), text, LIMIT))
        for value, text, owner in marks:
            dot = round((1.0 - scale.share(value)) * (4 * height - 1))
            row = top + dot // 4
            width = self.ticks - 1
            self._write(row, axis - width, f"{text[:width]:>{width}}┤", owner)

    def _flag(self, signal: RunSignal, others: Sequence[RunSignal], top: int) -> None:
        """Draw a Boolean signal as one row, with a block where it is true."""
        span = self.span
        _, high = ranges(signal, span.start, span.end, span.columns)
        codes = np.where(high > 0.5, ord("▆"), ord("▁")).astype(np.int32)
        owners = np.full(span.columns, CURVE, dtype=np.int32)
        codes[np.isnan(high)] = ord(" ")
        if others:
            _, theirs = ranges(others[0], span.start, span.end, span.columns)
            differ = np.isfinite(theirs) & ((theirs > 0.5) != (high > 0.5))
            codes[differ], owners[differ] = ord("▒"), OTHER
        self._put(signal, top, codes[None, :], owners[None, :])

    def _put(self, signal: RunSignal, top: int, codes: Codes, owners: Codes) -> None:
        """Put a signal in its place, and shade the times at which it contradicts an oracle."""
        for start, end in signal.against:
            if not self.span.meets(start, end):
                continue
            part = slice(self.span.column(start), self.span.column(end) + 1)
            # In empty cells, otherwise in the first row: without colours, both the shade and the
            # curve must stay visible.
            empty = np.isin(codes[:, part], [ord(" "), ord("▁")])
            codes[:, part][empty] = ord("░")
            codes[0, part][~empty.any(axis=0)] = ord("░")
            owners[:, part] = AGAINST
        self.codes[top : top + len(codes), self.gutter :] = codes
        self.owners[top : top + len(codes), self.gutter :] = owners

    def _write(self, row: int, column: int, text: str, owner: int) -> None:
        write_text(self.codes, self.owners, row, column, text, owner)

    def _label(self, row: int, text: str, owner: int = NAME) -> None:
        """Write words into the gutter, cut to its width."""
        self._write(row, 0, keep_start(text, self.gutter - 1), owner)

    def _bar(self, row: int, start: float, end: float, sign: str, owner: int) -> None:
        """Fill a row with a sign from one moment to another, within the drawn time."""
        if self.span.meets(start, end):
            first, last = self.span.column(start), self.span.column(end)
            self._write(row, self.gutter + first, sign * (last - first + 1), owner)

    def _door(self, row: int, timeline: RunTimeline, joints: frozenset[str]) -> None:
        """Draw a bar while any door of a lane stands open."""
        events = [event for event in timeline.doors or () if event.joint in joints]
        if not events:
            # The map shows whether they are open or shut.
            words = "does not move" if len(joints) == 1 else "none moves"
            self._write(row, self.gutter, words, FAINT)
            return
        self._bar(row, self.span.start, timeline.end, "·", FAINT)
        first = {event.joint: event.opens for event in reversed(events)}
        is_open = {name for name, opens in first.items() if not opens}
        times = [self.span.start, *(event.time for event in events), timeline.end]
        for event, (since, until) in zip((None, *events), itertools.pairwise(times), strict=True):
            if event is not None:
                is_open = is_open | {event.joint} if event.opens else is_open - {event.joint}
            if is_open:
                self._bar(row, since, until, "━", EVENT)

    def _mission(self, row: int, timeline: RunTimeline) -> None:
        """Draw the legs with number and name of their waypoint, and a diamond at their end."""
        span = self.span
        self._bar(row, timeline.start, timeline.end, "─", FAINT)
        begins = timeline.start
        ends = (*timeline.reached, timeline.end)
        for index, (name, time) in enumerate(zip(timeline.waypoints, ends, strict=False)):
            if span.meets(begins, time):
                done = index < len(timeline.reached) and time <= span.end
                last = span.column(time)
                room = last - span.column(begins) - done
                words = (f"{index + 1} {name}", str(index + 1))
                text = next((word for word in words if len(word) < room), "")
                # Leave a piece of the line before the diamond.
                right = last - 2 if done else last
                self._write(row, self.gutter + right + 1 - len(text), text, FAINT)
                if done:
                    self._bar(row, time, time, "◇", DONE)
            begins = time

    def _axis(self, row: int, whole: float | None) -> None:
        """Write the time below; beside it the drawn part of a run that lasts ``whole`` [s]."""
        span = self.span
        scale = mark_axis(span.start, span.end, span.columns - 1, _APART)
        for value in scale.ticks:
            column = span.column(value)
            text = f"┴{tick_text(value, scale.step)} s"
            if column + len(text) <= span.columns:
                self._write(row, self.gutter + column, text, FAINT)
        more = f"> {self.more} more" if self.more else ""
        if whole is None:
            self._label(row, more, FAINT)
            return
        start, end = (tick_text(time, scale.step / 10.0) for time in (span.start, span.end))
        stretch = f"{start}–{end} s of {whole:.1f} s"
        both = f"{stretch}  {more}"
        self._label(row, both if more and len(both) < self.gutter else stretch, CURSOR)


def _door_lanes(
    motions: Sequence[Sequence[DoorMotion]], most: int
) -> list[tuple[str, frozenset[str]]]:
    """Return the doors that moved in any run, by their first motion, each with its joints.

    If there are more than ``most``, the last ones share a lane.
    """
    events = sorted((event for run in motions for event in run), key=lambda event: event.time)
    names = list(dict.fromkeys(event.joint for event in events))
    own = names if len(names) <= most else names[: most - 1]
    lanes = [(name, frozenset({name})) for name in own]
    if rest := frozenset(names[len(own) :]):
        lanes.append((f"{len(rest)} more doors" if own else "doors", rest))
    short = [name.rpartition(".")[0] or name for name, _ in lanes]
    # A door has the name of its object, unless another part of that moves as well.
    return [
        (brief if short.count(brief) == 1 else name, joints)
        for brief, (name, joints) in zip(short, lanes, strict=True)
    ] or [("doors", frozenset())]
