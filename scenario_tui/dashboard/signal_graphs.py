"""Signals of a recorded run as lines of text: what the dashboard draws, for the command line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from rich.style import Style
from rich.text import Text

from daemon.judging.live import reached_moments
from daemon.trace import Trace
from grammars.oracle import ComparedLimit
from scenario_tui.dashboard.signal_strips import RunTimeline, SignalStrip, limits_of, with_limits
from scenario_tui.dashboard.widgets.cell_view import Codes, segments
from scenario_tui.dashboard.widgets.timeline import label_signals
from scenario_tui.dashboard.widgets.timeline_drawing import FAIL, STYLES, TimelineDrawing
from scenario_tui.library.trace import Signal

_COLOURS: Final = (
    "yellow", "bold yellow", "cyan", "red", "cyan", "green", "bold red", "dim", "bold", "bold",
    "reverse", "dim red",
)  # fmt: skip
"""The terminal's own colours, in the order of the dashboard's: its background is not known here."""
LEAST_ROWS: Final = 4
"""Rows of a signal at least; what is true or false takes one."""
AXES: Final = 2
"""Rows below the signals: mission and time."""


def draw_signals(
    trace: Trace, signals: Sequence[Signal], width: int, rows: int, *, marks: Sequence[float] = ()
) -> list[Text]:
    """Return signals one above the other, with upright lines at ``marks`` [s].

    They take ``rows``, or as many as are needed. The value beside each is that at its end.
    """
    start, end = float(trace.ground_truth.time[0]), float(trace.ground_truth.time[-1])
    waypoints = trace.spec.mission.waypoints
    limits = limits_of(trace.spec.oracles)
    timeline = RunTimeline(
        start, end, tuple(_strip(signal, limits) for signal in signals), None,
        reached_moments(trace), len(waypoints), tuple(marks), tuple(w.id for w in waypoints),
    )  # fmt: skip
    timeline = with_limits(timeline, limits)
    least = sum(1 if signal.unit == "bool" else LEAST_ROWS for signal in signals)
    drawing = TimelineDrawing((timeline,), timeline.strips, width, max(rows, least + AXES))
    codes, owners = drawing.codes, drawing.owners
    for mark in marks:
        column = drawing.gutter + drawing.span.column(mark)
        empty = np.isin(codes[: sum(drawing.heights), column], [ord(" "), ord("╱")])
        codes[: len(empty), column][empty] = ord("│")
        owners[: len(empty), column][empty] = FAIL
    label_signals(drawing, (timeline,), end, codes, owners)
    styles = [Style.parse(colour) for colour in _COLOURS]
    assert len(styles) == len(STYLES)
    return [_text(codes[row], owners[row], styles) for row in range(len(codes))]


def _strip(signal: Signal, limits: Sequence[ComparedLimit]) -> SignalStrip:
    asked = sorted({limit.value for limit in limits if limit.signal == signal.name})
    return SignalStrip(signal.name, signal.unit, signal.time, signal.value, tuple(asked))


def _text(codes: Codes, owners: Codes, styles: Sequence[Style]) -> Text:
    parts = segments(codes, owners, styles, Style())
    text = Text.assemble(*((part.text, part.style or "") for part in parts))
    text.rstrip()
    return text
