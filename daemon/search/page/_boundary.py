"""Where it starts to fail: the margin over one parameter, or over two."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from daemon.analysis.report import Axes, Sheet
from daemon.model.search import Point, SearchTask
from daemon.search.answers.wording import short_name
from daemon.search.page._points import (
    DrawnPoint,
    axis_title,
    coordinate,
    margin_title,
)
from daemon.search.page._spaces import draw_marks, frame_axes
from daemon.search.points import written_point
from grammars.model.geometry import Floats

RAMP: Final = (
    "#b2182b", "#d6604d", "#f4a582", "#fddbc7", "#d1e5f0", "#92c5de", "#4393c3", "#2166ac",
)  # fmt: skip
"""From failing to passing: ColorBrewer's RdBu, which colour-blind readers tell apart (Brewer and
Harrower, 2003). Half of it is below zero."""
_APART: Final = 0.25
"""Least distance from zero of what passes and of what fails, as a share of the largest."""
_HALF: Final = len(RAMP) // 2


def plot_boundary(
    task: SearchTask, points: Sequence[DrawnPoint], nearest: Point | None
) -> Sheet | None:
    """Return the picture of a search over one or two parameters; ``None`` without a margin."""
    known = [p for p in points if math.isfinite(p.value)]
    if not known or len(task.parameters) > 2:
        return None
    if len(task.parameters) == 1:
        return _over_one(task, known, nearest)
    return _over_two(task, known, nearest)


def _over_one(task: SearchTask, points: Sequence[DrawnPoint], nearest: Point | None) -> Sheet:
    (parameter,) = task.parameters
    sheet = Sheet(7.0, 3.0)
    (axes,) = sheet.axes
    ordered = sorted(points, key=lambda p: coordinate(parameter, p.result.values[0]))
    xs = [coordinate(parameter, p.result.values[0]) for p in ordered]
    if not parameter.choices:
        axes.line(xs, [p.value for p in ordered], "soft", 0.8)
    draw_marks(axes, ordered, xs, [p.value for p in ordered])
    axes.across(0.0, "bad", 0.9)
    for value, colour in (
        (parameter.written, "ink"),
        (nearest[0] if nearest is not None else None, "near"),
    ):
        at = coordinate(parameter, value)
        if math.isfinite(at):
            axes.upright(at, colour, 1.1, dashes="5 3")
    axes.x_names = [parameter.shown(choice) for choice in parameter.choices] or None
    axes.title, axes.x_label = (
        margin_title(task),
        axis_title(short_name(task, parameter), parameter),
    )
    return sheet


def _over_two(task: SearchTask, points: Sequence[DrawnPoint], nearest: Point | None) -> Sheet:
    x, y = task.parameters
    sheet = Sheet(6.0, 4.6)
    (axes,) = sheet.axes
    frame_axes(axes, task, x, y)
    xs = [coordinate(x, p.result.values[0]) for p in points]
    ys = [coordinate(y, p.result.values[1]) for p in points]
    _draw_margins(axes, points, xs, ys)
    for point, colour, about in (
        (written_point(task), "ink", "as written"), (nearest, "near", "nearest failure"),
    ):  # fmt: skip
        if point is not None:
            at = coordinate(x, point[0]), coordinate(y, point[1])
            axes.diamonds([at[0]], [at[1]], colour, 8.0, about=about)
    return sheet


def _draw_margins(
    axes: Axes, points: Sequence[DrawnPoint], x: Sequence[float], y: Sequence[float]
) -> None:
    """Draw points as dots, failures as crosses, each in the colour of its margin."""
    levels = ramp_levels(balanced(np.array([point.value for point in points])))
    fails = np.array([point.result.fails for point in points], bool)
    xs, ys = np.array(x, float), np.array(y, float)
    for level, colour in enumerate(RAMP):
        passing, failing = (levels == level) & ~fails, (levels == level) & fails
        if passing.any():
            axes.dots(xs[passing], ys[passing], colour, 4.6)
        if failing.any():
            axes.crosses(xs[failing], ys[failing], colour, 5.0)


def balanced(margins: Floats) -> Floats:
    """Return margins (n,) from -1, the deepest failure, to 1, the widest pass, apart at zero.

    A fall from far above the limit to just below it is common: half of the colours are for each
    side, and the least failure is as far from zero as the least pass.
    """
    deepest, widest = max(-float(margins.min()), 0.0), max(float(margins.max()), 0.0)
    below = -_APART + (1.0 - _APART) * margins / (deepest or 1.0)
    above = _APART + (1.0 - _APART) * margins / (widest or 1.0)
    found: Floats = np.where(margins < 0.0, below, above)
    return found


def ramp_levels(values: Floats) -> Any:
    """Return the place in the ramp of values from -1 to 1: the lower half of it is below zero."""
    levels = np.floor(_HALF * (1.0 + values)).astype(int)
    return np.clip(levels, 0, len(RAMP) - 1)
