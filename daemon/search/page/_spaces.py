"""Where in its space a search fails: over one parameter, over every two, or side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from daemon.analysis.report import Axes, Sheet
from daemon.model.search import Point, PointValue, SearchParameter, SearchTask
from daemon.model.trials import Trial
from daemon.search.answers.sentences import minus
from daemon.search.points import position_in_range, written_point
from grammars.model.geometry import Floats

FULL: Final = 7.0
"""Width of a figure over the whole page [inches]."""
MOST_LINES: Final = 400
"""Points that pass and are drawn as lines at most; of more, some evenly over the search."""
RAMP: Final = (
    "#b2182b", "#d6604d", "#f4a582", "#fddbc7", "#d1e5f0", "#92c5de", "#4393c3", "#2166ac",
)  # fmt: skip
"""From failing to passing: ColorBrewer's RdBu, which colour-blind readers tell apart (Brewer and
Harrower, 2003). Half of it is below zero."""
_APART: Final = 0.25
"""Least distance from zero of what passes and of what fails, as a share of the largest."""
_LETTER: Final = 3.1
"""Width of a letter of a name [points]."""
_OUTSIDE: Final = 0.06
"""How far beyond its range a written value is drawn, as a share of the range."""


def margin_title(task: SearchTask) -> str:
    """Return what the values of a search are, with their unit."""
    if len(task.scales) > 1:
        return "smallest margin, as a share of its scale"
    unit = task.scales[0].unit
    return f"margin of {task.minimise} [{unit}]" if unit not in ("", "1") else task.minimise


def plot_range(task: SearchTask, trials: Sequence[Trial], nearest: Point | None) -> Sheet:
    """Return the margin over the only parameter, of trials that have one."""
    (parameter,) = task.parameters
    sheet = Sheet(FULL, 3.0)
    (axes,) = sheet.axes
    ordered = sorted(trials, key=lambda one: _coordinate(parameter, one.point[0]))
    xs = np.array([_coordinate(parameter, one.point[0]) for one in ordered])
    ys = np.array([one.compared for one in ordered])
    if not parameter.choices:
        axes.line(xs, ys, "soft", 0.8)
    fails = np.array([one.fails for one in ordered])
    if not fails.all():
        axes.dots(xs[~fails], ys[~fails], "line", 3.2, alpha=0.8, label="passes")
    if fails.any():
        axes.crosses(xs[fails], ys[fails], "bad", 4.4, label="fails")
    axes.across(0.0, "bad", 0.9)
    for value, colour in ((parameter.written, "ink"), (nearest[0] if nearest else None, "near")):
        at = _coordinate(parameter, value)
        if math.isfinite(at):
            axes.upright(at, colour, 1.1, dashes="5 3")
    axes.x_names = [parameter.shown(choice) for choice in parameter.choices] or None
    axes.title, axes.x_label = margin_title(task), _axis_title(task, parameter)
    return sheet


def plot_pair(
    task: SearchTask, trials: Sequence[Trial], nearest: Point | None, pair: tuple[int, int]
) -> Sheet:
    """Return the trials that have a margin over two parameters, in the colours of their margins.

    Dots pass and crosses fail.
    """
    first, second = pair
    x, y = task.parameters[first], task.parameters[second]
    sheet = Sheet(6.0, 4.6) if len(task.parameters) == 2 else Sheet(3.5, 2.9)
    (axes,) = sheet.axes
    axes.x_limits, axes.y_limits = _limits(x), _limits(y)
    axes.x_names = [x.shown(choice) for choice in x.choices] or None
    axes.y_names = [y.shown(choice) for choice in y.choices] or None
    axes.x_label, axes.title = _axis_title(task, x), _axis_title(task, y)
    xs = np.array([_coordinate(x, one.point[first]) for one in trials])
    ys = np.array([_coordinate(y, one.point[second]) for one in trials])
    levels = ramp_levels(np.array([one.compared for one in trials]))
    fails = np.array([one.fails for one in trials])
    for level, colour in enumerate(RAMP):
        for those, draw in (((levels == level) & ~fails, axes.dots),
                            ((levels == level) & fails, axes.crosses)):  # fmt: skip
            if those.any():
                draw(xs[those], ys[those], colour, 4.6)
    marks = ((written_point(task), "ink", "as written"), (nearest, "near", "nearest failure"))
    for point, colour, about in marks:
        if point is not None:
            place = [_coordinate(x, point[first])], [_coordinate(y, point[second])]
            axes.diamonds(*place, colour, 7.0, about=about)
    return sheet


def ramp_levels(margins: Floats) -> Any:
    """Return the places in the ramp of margins (n,), each half a share of its largest.

    A fall from far above the limit to just below it is common: half of the colours are for each
    side, and the least failure is as far from zero as the least pass.
    """
    deepest, widest = max(-float(margins.min()), 0.0), max(float(margins.max()), 0.0)
    below = -_APART + (1.0 - _APART) * margins / (deepest or 1.0)
    above = _APART + (1.0 - _APART) * margins / (widest or 1.0)
    shares = np.where(margins < 0.0, below, above)
    levels = np.floor(0.5 * len(RAMP) * (1.0 + shares)).astype(int)
    return np.clip(levels, 0, len(RAMP) - 1)


def _coordinate(parameter: SearchParameter, value: PointValue | None) -> float:
    """Return a value as it stands beside an axis: a number, or the place of a choice."""
    if parameter.choices:
        return float(parameter.choices.index(value)) if value in parameter.choices else math.nan
    return float(value) if isinstance(value, float | int) else math.nan


def _axis_title(task: SearchTask, parameter: SearchParameter) -> str:
    name = task.short_name(parameter.name)
    return f"{name} [{parameter.unit}]" if parameter.unit else name


def _limits(parameter: SearchParameter) -> tuple[float, float]:
    if parameter.choices:
        return -0.5, len(parameter.choices) - 0.5
    room = 0.03 * (parameter.high - parameter.low)
    return parameter.low - room, parameter.high + room


def plot_parallel(task: SearchTask, trials: Sequence[Trial], nearest: Point | None) -> Sheet:
    """Return every trial as a line over upright axes, one a parameter."""
    count = len(task.parameters)
    names = [task.short_name(parameter.name) for parameter in task.parameters]
    room = 72.0 * FULL / (count + 0.2)
    rows = max(1, math.ceil(max(map(len, names)) * _LETTER / room))
    sheet = Sheet(FULL, 3.1 + 0.13 * rows, bare=True)
    (axes,) = sheet.axes
    step = 0.055
    axes.x_limits = (-0.6, count - 0.4)
    axes.y_limits = (-0.14 - step * rows, 1.12)
    passing = [one.point for one in trials if not one.fails]
    passing = passing[:: max(1, math.ceil(len(passing) / MOST_LINES))]
    _lines(axes, task, passing, "line", 0.5, 0.35)
    _lines(axes, task, [one.point for one in trials if one.fails], "bad", 0.9, 0.8)
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


def _heights(task: SearchTask, point: Point) -> list[float]:
    heights = [position_in_range(p, value) for p, value in zip(task.parameters, point, strict=True)]
    return [at if math.isnan(at) else min(1.0 + _OUTSIDE, max(-_OUTSIDE, at)) for at in heights]


def _lines(
    axes: Axes, task: SearchTask, points: Sequence[Point], colour: str, width: float, alpha: float,
    *, dashes: str = "",
) -> None:  # fmt: skip
    """Draw points as one line with gaps, so that hundreds are one path of the page."""
    if not points:
        return
    heights = np.array([[*_heights(task, point), math.nan] for point in points])
    places = np.tile(np.append(np.arange(len(task.parameters), dtype=float), math.nan), len(points))
    axes.line(places, heights.ravel(), colour, width, alpha=alpha, dashes=dashes)
