"""Signals over time as cells: curves on scales of their own, limits, doors, mission, time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from rich.style import Style

from daemon.model.live_judgement import DoorMotion
from grammars.model.geometry import Floats
from grammars.text.words import format_quantity
from scenario_tui.dashboard.signal_strips import RunTimeline, SignalStrip
from scenario_tui.dashboard.widgets.cell_view import Canvas, Codes, write_text
from scenario_tui.text.formatting import BAD, BUSY, FACT, GOOD, QUIET, UNSURE, keep_start
from scenario_tui.text.scale import AxisScale, fit_axis, mark_axis, tick_text

LIMIT, OTHER, CURVE = range(3)
AGAINST, EVENT, DONE, FAIL, FAINT, NAME, CURSOR, HIT, WRONG = range(3, 12)
_FORBIDDEN: Final = "#8a5a5a"
STYLES: Final = (
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
    Style(color=_FORBIDDEN),
)
_GUTTER: Final = 27
"""Columns for what a signal is called, its value at the cursor, and its scale."""
_TICKS: Final = 7
"""Columns of these that the scale takes, where there is room for all of the gutter."""
_LANES: Final = 6
"""Rows of the whole drawing for each that a door may take."""
_LEAST: Final = 3
"""Rows of a signal at least; what is true or false takes one."""
_LITTLE: Final = 9
"""Of so few rows a signal takes two."""
_APART: Final = 12
"""Columns from one mark of the time to the next at least."""
LEGEND: Final = "╱ beyond limit  ░ against oracle  ━ door open  ◇ waypoint  ✗ decided"


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
    time, least = strip.time[known], strip.values[known]
    most = least if strip.most is None else strip.most[known]
    if not len(time):
        return low, high
    # From the last sample at or before an edge: values hold until the next one is written.
    edges = np.linspace(start, end, count + 1)
    first = np.maximum(np.searchsorted(time, edges[:-1] + 1e-9, side="right") - 1, 0)
    last = np.searchsorted(time, edges[1:] + 1e-9, side="right")
    # What ends before it begins reduces to its first value, and is left out; the value put behind
    # the last one is never part of a stretch.
    stretches = np.column_stack([first, last]).ravel()
    filled = (last > first) & (edges[:-1] <= strip.end)
    low[filled] = np.minimum.reduceat(np.append(least, np.inf), stretches)[::2][filled]
    high[filled] = np.maximum.reduceat(np.append(most, -np.inf), stretches)[::2][filled]
    return low, high


def fit_heights(strips: Sequence[SignalStrip], rows: int) -> list[int]:
    """Return how many rows each signal gets, for as many of the first ones as ``rows`` hold."""
    heights: list[int] = []
    smallest = 2 if rows < _LITTLE else _LEAST
    for strip in strips:
        least = 1 if strip.unit == "bool" else smallest
        if sum(heights) + least > rows:
            break
        heights.append(least)
    tall = [i for i, _ in enumerate(heights) if strips[i].unit != "bool"]
    left = rows - sum(heights)
    for place, index in enumerate(tall):
        # All grow evenly, those above first.
        heights[index] += left // len(tall) + (place < left % len(tall))
    return heights


def scale_of(strip: SignalStrip, curves: Sequence[tuple[Floats, Floats]], rows: int) -> AxisScale:
    """Return the scale of the values that are drawn, with the limits in view."""
    known = np.concatenate([part[np.isfinite(part)] for curve in curves for part in curve])
    if not len(known):
        return fit_axis(*_ends(strip.limits), (), rows)
    return fit_axis(float(known.min()), float(known.max()), strip.limits, rows, strip.sides)


def _ends(limits: Sequence[float]) -> tuple[float, float]:
    return (min(limits), max(limits)) if limits else (0.0, 1.0)


class TimelineDrawing:
    """The cells of timelines drawn one over the other, without the cursor.

    ``strips`` are the signals of the first one, in their order.
    """

    # The cursor alone moves while a run is played: this is drawn once and copied for each frame.

    def __init__(
        self,
        timelines: Sequence[RunTimeline],
        strips: Sequence[SignalStrip],
        columns: int,
        rows: int,
    ) -> None:
        self.codes: Codes = np.full((rows, columns), ord(" "), dtype=np.int32)
        self.owners: Codes = np.full((rows, columns), -1, dtype=np.int32)
        # Two values need room beside each other.
        self.gutter = min(_GUTTER, columns * 3 // 8 if len(timelines) == 1 else columns // 2)
        self.ticks = _TICKS if self.gutter > 2 * _TICKS else 0
        ends = max(max(c.end, c.horizon or c.end) for c in timelines)
        self.span = _Span(min(c.start for c in timelines), ends, max(columns - self.gutter, 1))
        self.strips = strips
        # What nothing is known of has no lane.
        self._told = [timeline for timeline in timelines if timeline.doors is not None]
        most = max(1, 2 * rows // (_LANES * (1 + len(timelines))))
        self.doors = _door_lanes([timeline.doors or () for timeline in self._told], most)
        below = len(self.doors) * len(self._told) + len(timelines) + 1
        self.heights = fit_heights(self.strips, max(rows - below, 0))
        self.more = len(self.strips) - len(self.heights)
        row = 0
        for strip, height in zip(self.strips, self.heights, strict=False):
            others = [s for c in timelines[1:] for s in c.strips if s.name == strip.name]
            self._draw(strip, others, row, height)
            row += height
        self._events(timelines, max(rows - below, 0) if row else 0)

    def _draw(
        self, strip: SignalStrip, others: Sequence[SignalStrip], top: int, height: int
    ) -> None:
        if strip.unit == "bool":
            self._flag(strip, others, top)
            return
        span, canvas = self.span, Canvas(self.span.columns, height, 3)
        drawn = [strip, *others[:1]]
        curves = [ranges(s, span.start, span.end, canvas.width) for s in drawn]
        scale = scale_of(strip, curves, height)
        size = (canvas.height - 1) / (scale.high - scale.low)

        def dots(values: Floats) -> Floats:
            return (scale.high - values) * size

        for limit in strip.limits:
            x = np.arange(0.0, canvas.width, 4)  # dotted: told from the curve without colour
            at = dots(np.array(min(max(limit, scale.low), scale.high)))
            canvas.points(np.column_stack([x, np.full(len(x), at)]), LIMIT)
        for (least, most), layer in zip(curves, (CURVE, OTHER), strict=False):
            x = np.flatnonzero(np.isfinite(least))
            x = x[::2] if layer == OTHER else x  # told from the other one without colour
            canvas.bars(x.astype(np.int32), dots(most[x]), dots(least[x]), layer)
        codes, owners = canvas.cells()
        self._forbid(strip, scale, codes, owners)
        self._shade(strip, codes, owners)
        self._put(top, codes, owners)
        if self.ticks:
            self._scale(strip, scale, top, height)

    def _forbid(self, strip: SignalStrip, scale: AxisScale, codes: Codes, owners: Codes) -> None:
        """Hatch what lies wholly beyond a limit."""
        rows = len(codes)
        upper = (1.0 - np.arange(rows) / rows)[:, None]
        lower = (1.0 - np.arange(1, rows + 1) / rows)[:, None]
        for limit, side in zip(strip.limits, strip.sides, strict=False):
            share = scale.share(limit)
            beyond = lower >= share if side > 0 else upper <= share
            hatched = (codes == ord(" ")) & beyond
            if side:
                codes[hatched], owners[hatched] = ord("╱"), WRONG

    def _scale(self, strip: SignalStrip, scale: AxisScale, top: int, height: int) -> None:
        """Write round numbers beside the curve, and every limit where it is."""
        axis = self.gutter - 1
        self.codes[top : top + height, axis] = ord("│")
        self.owners[top : top + height, axis] = FAINT
        marks = [(value, tick_text(value, scale.step), FAINT) for value in scale.ticks]
        # Last: where a tick and a limit share a row the limit is what one looks for.
        for limit in strip.limits:
            said = format_quantity(limit, "")
            if not 0.0 <= scale.share(limit) <= 1.0:
                said = ("↑" if limit > scale.high else "↓") + said
            marks.append((min(max(limit, scale.low), scale.high), said, LIMIT))
        for value, said, owner in marks:
            dot = round((1.0 - scale.share(value)) * (4 * height - 1))
            row = top + dot // 4
            width = self.ticks - 1
            self.write(row, axis - width, f"{said[:width]:>{width}}┤", owner)

    def _flag(self, strip: SignalStrip, others: Sequence[SignalStrip], top: int) -> None:
        """Draw what is true or false as one row: a block where it is true."""
        span = self.span
        _, high = ranges(strip, span.start, span.end, span.columns)
        codes = np.where(high > 0.5, ord("▆"), ord("▁")).astype(np.int32)
        owners = np.full(span.columns, CURVE, dtype=np.int32)
        codes[np.isnan(high)] = ord(" ")
        if others:
            _, theirs = ranges(others[0], span.start, span.end, span.columns)
            differ = np.isfinite(theirs) & ((theirs > 0.5) != (high > 0.5))
            codes[differ], owners[differ] = ord("▒"), OTHER
        codes, owners = codes[None, :], owners[None, :]
        self._shade(strip, codes, owners)
        self._put(top, codes, owners)

    def _shade(self, strip: SignalStrip, codes: Codes, owners: Codes) -> None:
        """Mark the stretches the run spoke against an oracle, by glyph and by colour."""
        for start, end in strip.against:
            part = slice(self.span.column(start), self.span.column(end) + 1)
            # Beside the curve where there is room, or else over its first row: without colour the
            # stretch must be seen, and so must the curve.
            empty = np.isin(codes[:, part], [ord(" "), ord("▁"), ord("╱")])
            codes[:, part][empty] = ord("░")
            codes[0, part][~empty.any(axis=0)] = ord("░")
            owners[:, part] = AGAINST

    def _put(self, top: int, codes: Codes, owners: Codes) -> None:
        rows = min(len(codes), len(self.codes) - top)
        self.codes[top : top + rows, self.gutter :] = codes[:rows]
        self.owners[top : top + rows, self.gutter :] = owners[:rows]

    def write(self, row: int, column: int, text: str, owner: int) -> None:
        """Write words into a row, as far as it goes."""
        write_text(self.codes, self.owners, row, column, text, owner)

    def label(self, row: int, text: str, owner: int = NAME) -> None:
        """Write words into the gutter, cut to it."""
        self.write(row, 0, keep_start(text, self.gutter - 1), owner)

    def _events(self, timelines: Sequence[RunTimeline], row: int) -> None:
        """Draw doors and mission of every run, and the axis of time."""
        for name, joints in self.doors:
            for timeline in self._told:
                self.label(row, name if timeline is self._told[0] else f"┊ {name}")
                self._door(row, timeline, joints)
                row += 1
        missions = range(row, row + len(timelines))
        for place, timeline in zip(missions, timelines, strict=True):
            self.label(place, "mission" if timeline is timelines[0] else "┊ mission")
            self._mission(place, timeline)
        axis = missions.stop
        self._axis(axis)
        for place, timeline in zip(
            missions if len(timelines) > 1 else (axis,), timelines, strict=True
        ):
            for time in timeline.decided:
                self.write(place, self.gutter + self.span.column(time), "✗", FAIL)

    def _door(self, row: int, timeline: RunTimeline, joints: frozenset[str]) -> None:
        """Draw a bar while any door of a lane stands open."""
        at, span = self.gutter, self.span
        ends = span.column(timeline.end)
        events = [event for event in timeline.doors or () if event.joint in joints]
        if not events:
            self.write(row, at, _STILL if len(joints) == 1 else _NONE_MOVES, FAINT)
            return
        self.write(row, at, "·" * (ends + 1), FAINT)
        first = {event.joint: event.opens for event in reversed(events)}
        is_open = {name for name, opens in first.items() if not opens}
        since = span.start
        for event in (*events, None):
            if is_open:
                begins = span.column(since)
                until = span.column(event.time) if event else ends
                self.write(row, at + begins, "━" * (until - begins + 1), EVENT)
            if event is not None:
                since = event.time
                is_open ^= {event.joint} if event.opens is not (event.joint in is_open) else set()

    def _mission(self, row: int, timeline: RunTimeline) -> None:
        """Draw the legs: where each leads, by number and name, and a diamond where it ends."""
        at, span = self.gutter, self.span
        begins, ends = span.column(timeline.start), span.column(timeline.end)
        self.write(row, at + begins, "─" * (ends - begins + 1), FAINT)
        moments = [*timeline.reached, timeline.end][: timeline.waypoints]
        for index, time in enumerate(moments):
            column, done = span.column(time), index < len(timeline.reached)
            room = column - begins - (1 if done else 0)
            name = timeline.names[index] if index < len(timeline.names) else ""
            words = (f"{index + 1} {name}", str(index + 1)) if name else (str(index + 1),)
            said = next((word for word in words if len(word) < room), "")
            self.write(row, at + column - len(said) - (1 if said and done else 0) + (not done),
                       said, FAINT)  # fmt: skip
            if done:
                self.write(row, at + column, "◇", DONE)
            begins = column

    def _axis(self, row: int) -> None:
        span, at = self.span, self.gutter
        scale = mark_axis(span.start, span.end, span.columns - 1, _APART)
        for value in scale.ticks:
            column = span.column(value)
            text = f"┴{tick_text(value, scale.step)} s"
            if column + len(text) <= span.columns:
                self.write(row, at + column, text, FAINT)


_STILL: Final = "does not move"
_NONE_MOVES: Final = "none moves"
"""Of doors: whether they stand open or shut the map shows."""


def _door_lanes(
    motions: Sequence[Sequence[DoorMotion]], most: int
) -> list[tuple[str, frozenset[str]]]:
    """Return doors that moved in any run, by when they first did, each with its joints.

    Of more than ``most`` of them the last ones share a lane.
    """
    if not motions:
        return []
    events = sorted((event for run in motions for event in run), key=lambda event: event.time)
    names = list(dict.fromkeys(event.joint for event in events))
    own = names if len(names) <= most else names[: most - 1]
    lanes = [(name, frozenset({name})) for name in own]
    if rest := frozenset(names[len(own) :]):
        lanes.append((f"{len(rest)} more doors" if own else "doors", rest))
    short = [name.rpartition(".")[0] or name for name, _ in lanes]
    # A door is called like its object unless another part of it moves, too.
    return [
        (brief if short.count(brief) == 1 else name, joints)
        for brief, (name, joints) in zip(short, lanes, strict=True)
    ] or [("doors", frozenset())]
