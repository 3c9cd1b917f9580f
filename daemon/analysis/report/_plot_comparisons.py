"""Figures of two scenarios side by side: what the campaign compares, and one run of each (14)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from daemon.analysis.report._axes import Axes, Sheet
from daemon.analysis.report._plots import DOTTED, WIDTH, PlotLimits, draw_reference
from daemon.analysis.report._recorded import sampled_trace
from daemon.analysis.report._references import ReferenceMark
from daemon.analysis.report._svg import BAD, SERIES
from daemon.model.assessments import ComparisonVerdict
from daemon.trace import TraceError

_SAMPLES: Final = 360
"""Samples drawn of one run: two for each point of the page."""


def plot_comparisons(
    verdicts: Sequence[ComparisonVerdict],
    suts: Sequence[str],
    marks: Mapping[tuple[str, str], Sequence[ReferenceMark]],
) -> Sheet:
    """Return what comparisons of one unit found: left minus right, SUTs side by side.

    Dots are pairs of runs, lines the 95 % interval of the mean, the short line the mean; dashed is
    the limit, diamonds are reference values.
    """
    names = tuple(dict.fromkeys(verdict.comparison for verdict in verdicts))
    sheet = Sheet(WIDTH, 2.4)
    (axes,) = sheet.axes
    width = 0.8 / max(len(suts), 1)
    labelled = sum(map(len, marks.values())) <= 6
    for verdict in verdicts:
        place, index = names.index(verdict.comparison), list(suts).index(verdict.sut)
        colour = SERIES[index % len(SERIES)]
        x = place + (index - (len(suts) - 1) / 2.0) * width
        _draw_bounds(axes, x, verdict, 0.3 * width, colour)
        for found in marks.get((verdict.comparison, verdict.sut), ()):
            # One line for each system, or the words of neighbours would lie on each other.
            rise = len(suts) - 1 - index
            draw_reference(axes, x, found, label="end" if labelled else "", rise=rise)
    for place, name in enumerate(names):
        limit = next(v.limit for v in verdicts if v.comparison == name)
        axes.line([place - 0.45, place + 0.45], [limit, limit], BAD, 0.9, dashes="4 3")
    axes.x_names = names
    axes.x_limits = (-0.6, len(names) - 0.4)
    axes.title = f"left minus right [{verdicts[0].unit}]"
    return sheet


def _draw_bounds(
    axes: Axes, x: float, verdict: ComparisonVerdict, half: float, colour: str
) -> None:
    if verdict.interval is not None:
        axes.line([x, x], verdict.interval, colour, 0.8)
    if verdict.mean is not None:
        axes.line([x - half, x + half], [verdict.mean, verdict.mean], colour, 1.4)
    dots = verdict.differences
    axes.dots(np.full(len(dots), x), np.asarray(dots, dtype=np.float64), colour, 2.2, alpha=0.8)


def plot_run_pair(
    runs: Sequence[tuple[str, Path, Sequence[float]]], frame: PlotLimits
) -> Sheet | None:
    """Return speed and turning speed of two runs from start to end (figure 14).

    Of each its scenario, its trace, and when triggers fired [s] in it, dotted. ``None`` if a trace
    cannot be read any more.
    """
    sheet = Sheet(2.0 * WIDTH, 2.9, 2)
    above, below = sheet.axes
    end = 0.0
    for number, (name, path, fired) in enumerate(runs):
        try:
            truth = sampled_trace(path).trace.ground_truth
        except TraceError:
            return None
        colour = SERIES[number % len(SERIES)]
        speed, turning = np.hypot(truth.vx, truth.vy), np.asarray(truth.wz)
        above.line(*_binned(truth.time, speed), colour, 0.8, alpha=0.85, label=name)
        below.line(*_binned(truth.time, turning), colour, 0.8, alpha=0.85)
        for time in fired:
            above.upright(time, colour, 0.9, dashes=DOTTED)
            below.upright(time, colour, 0.9, dashes=DOTTED)
        end = max(end, float(truth.time[-1]))
    above.x_limits = below.x_limits = (0.0, end)
    above.y_limits, below.y_limits = (0.0, frame.speed), (-frame.turning, frame.turning)
    above.title, below.title, below.x_label = "speed [m/s]", "turning [rad/s]", "time [s]"
    return sheet


def _binned(time: Any, values: Any) -> tuple[Any, Any]:
    """Return means over equal spans of time, about as many as a page can show."""
    count = min(_SAMPLES, len(time))
    edges = np.linspace(0, len(time), count + 1).astype(np.int64)[:-1]
    sizes = np.diff(np.append(edges, len(time)))
    return np.add.reduceat(time, edges) / sizes, np.add.reduceat(values, edges) / sizes
