"""Where in its space a search failed: many parameters side by side, or every two of a few."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Final

import numpy as np

from daemon.analysis.report import Axes, Sheet
from daemon.model.search import Point, SearchParameter, SearchTask
from daemon.search.answers.wording import minus, short_name
from daemon.search.page._curves import FULL
from daemon.search.page._points import (
    DrawnPoint,
    axis_title,
    coordinate,
)
from daemon.search.points import position_in_range, written_point

MOST_LINES: Final = 400
"""Points that pass and are drawn as lines at most; of more, some evenly over the search."""
_LETTER: Final = 3.1
"""Width of a letter of a name [points]."""
_OUTSIDE: Final = 0.06
"""How far beyond its range a written value is drawn, as a share of the range."""


def plot_parallel(task: SearchTask, points: Sequence[DrawnPoint], nearest: Point | None) -> Sheet:
    """Return every point as a line over upright axes, one a parameter."""
    count = len(task.parameters)
    names = [short_name(task, parameter) for parameter in task.parameters]
    room = 72.0 * FULL / (count + 0.2)
    rows = max(1, math.ceil(max(map(len, names)) * _LETTER / room))
    sheet = Sheet(FULL, 3.1 + 0.13 * rows, bare=True)
    (axes,) = sheet.axes
    step = 0.055
    axes.x_limits = (-0.6, count - 0.4)
    axes.y_limits = (-0.14 - step * rows, 1.12)
    passing = [p for p in points if not p.result.fails]
    passing = passing[:: max(1, math.ceil(len(passing) / MOST_LINES))]
    _lines(axes, task, [p.result.values for p in passing], "line", 0.5, 0.35)
    failing = [p.result.values for p in points if p.result.fails]
    _lines(axes, task, failing, "bad", 0.9, 0.8)
    for index, parameter in enumerate(task.parameters):
        axes.line([index, index], [0.0, 1.0], "soft", 0.7)
        low, high = _ends(parameter)
        for words, y in ((high, 1.05), (low, -0.08)):
            _centred(axes, index, y, words, room)
        _centred(axes, index, -0.13 - step * (index % rows + 0.4), names[index], room, "ink")
    written = written_point(task)
    if written is not None:
        _lines(axes, task, [written], "ink", 1.4, 1.0, dashes="5 3")
    if nearest is not None:
        _lines(axes, task, [nearest], "near", 2.2, 1.0)
        places = _heights(task, nearest)
        axes.diamonds(range(count), places, "near", 5.0, about="nearest failure")
    return sheet


def _ends(parameter: SearchParameter) -> tuple[str, str]:
    if parameter.choices:
        return parameter.shown(parameter.choices[0]), parameter.shown(parameter.choices[-1])
    return minus(f"{parameter.low:.6g}"), parameter.shown(float(f"{parameter.high:.6g}"))


def _centred(axes: Axes, x: float, y: float, words: str, room: float, colour: str = "soft") -> None:
    """Write around a point; Axes write from one on, so it is moved by half of the words' width."""
    width = len(words) * _LETTER
    # The outermost names stay on the page.
    shift = min(-0.5 * width, 0.0)
    axes.words(x, y, words, 6.5, colour=colour, shift=(max(shift, -0.6 * room - 40.0), 0.0))


def _heights(task: SearchTask, values: Point) -> list[float]:
    found = [position_in_range(p, v) for p, v in zip(task.parameters, values, strict=True)]
    return [min(1.0 + _OUTSIDE, max(-_OUTSIDE, at)) if not math.isnan(at) else at for at in found]


def _lines(
    axes: Axes, task: SearchTask, points: Sequence[Point], colour: str, width: float, alpha: float,
    *, dashes: str = "",
) -> None:  # fmt: skip
    """Draw points as one line with gaps, so that hundreds are one path of the page."""
    if not points:
        return
    heights = np.array([[*_heights(task, values), math.nan] for values in points])
    places = np.tile(np.append(np.arange(len(task.parameters), dtype=float), math.nan), len(points))
    axes.line(places, heights.ravel(), colour, width, alpha=alpha, dashes=dashes)


def plot_pairs(
    task: SearchTask, points: Sequence[DrawnPoint], nearest: Point | None
) -> dict[str, Sheet]:
    """Return a figure for every two parameters, by the names of both."""
    written = written_point(task)
    found: dict[str, Sheet] = {}
    for first, second in combinations(range(len(task.parameters)), 2):
        x, y = task.parameters[first], task.parameters[second]
        sheet = Sheet(3.5, 2.9)
        (axes,) = sheet.axes
        frame_axes(axes, task, x, y)
        xs = [coordinate(x, p.result.values[first]) for p in points]
        ys = [coordinate(y, p.result.values[second]) for p in points]
        draw_marks(axes, points, xs, ys)
        for point, colour, about in ((written, "ink", "as written"), (nearest, "near", "nearest")):
            if point is not None:
                at = coordinate(x, point[first]), coordinate(y, point[second])
                axes.diamonds([at[0]], [at[1]], colour, 6.0, about=about)
        found[f"{short_name(task, y)} over {short_name(task, x)}"] = sheet
    return found


def frame_axes(axes: Axes, task: SearchTask, x: SearchParameter, y: SearchParameter) -> None:
    """Set limits and words of axes that have a parameter each."""
    axes.x_limits, axes.y_limits = _limits(x), _limits(y)
    axes.x_names = [x.shown(choice) for choice in x.choices] or None
    axes.y_names = [y.shown(choice) for choice in y.choices] or None
    axes.x_label = axis_title(short_name(task, x), x)
    axes.title = axis_title(short_name(task, y), y)


def _limits(parameter: SearchParameter) -> tuple[float, float]:
    if parameter.choices:
        return -0.5, len(parameter.choices) - 0.5
    room = 0.03 * (parameter.high - parameter.low)
    return parameter.low - room, parameter.high + room


def draw_marks(
    axes: Axes,
    points: Sequence[DrawnPoint],
    x: Sequence[float],
    y: Sequence[float],
) -> None:
    """Draw points that pass as dots and those that fail as crosses, each at its ``x`` and ``y``."""
    fails = np.array([point.result.fails for point in points], bool)
    xs, ys = np.array(x, float), np.array(y, float)
    if not fails.all():
        axes.dots(xs[~fails], ys[~fails], "line", 3.2, alpha=0.8, label="passes")
    if fails.any():
        axes.crosses(xs[fails], ys[fails], "bad", 4.4, label="fails")
