"""Signals of a recorded run as lines of text, drawn as in the dashboard, for the command line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rich.style import Style
from rich.text import Text

from daemon.judging.live import reached_moments
from daemon.judging.signals import RunSignal
from daemon.trace import Trace
from scenario_tui.dashboard.run_timeline import RunTimeline, waypoint_names
from scenario_tui.dashboard.widgets.cell_view import text_lines
from scenario_tui.dashboard.widgets.timeline import draw_frame
from scenario_tui.dashboard.widgets.timeline_drawing import FAIL, TimelineDrawing

_COLOURS: Final = (
    "yellow", "bold yellow", "cyan", "red", "cyan", "green", "bold red", "dim", "bold", "bold",
)  # fmt: skip
"""The terminal's own colours in the dashboard's order, because the background is unknown here."""
LEAST_ROWS: Final = 4
"""Least rows of a signal; a Boolean one takes one row."""
AXES: Final = 2
"""Rows below the signals: mission and time."""


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
