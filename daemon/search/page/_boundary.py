"""Where it starts to fail: the margin over one parameter, or over two."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np

from daemon.analysis.report import Axes, Sheet
from daemon.model.search import Point, SearchParameter, SearchTask
from daemon.search.answers.wording import short_name
from daemon.search.page._points import (
    DrawnPoint,
    axis_title,
    coordinate,
    margin_title,
)
from daemon.search.page._spaces import draw_marks, frame_axes
from daemon.search.points import position_in_range, written_point
from grammars.model.geometry import Floats

RAMP: Final = (
    "#b2182b", "#d6604d", "#f4a582", "#fddbc7", "#d1e5f0", "#92c5de", "#4393c3", "#2166ac",
)  # fmt: skip
"""From failing to passing: ColorBrewer's RdBu, which colour-blind readers tell apart (Brewer and
Harrower, 2003). Half of it is below zero."""
_CELLS: Final = 48
"""Cells along each axis between which margins are estimated."""
CELL_ENDS: Final[Floats] = np.linspace(0.0, 1.0, _CELLS + 1)
"""Where they begin and end, as places in a range."""
_POWER: Final = 4.0
_APART: Final = 0.25
"""Least distance from zero of what passes and of what fails, as a share of the largest."""
_MARKS: Final = "#000000"
"""Colour of what stands on the ramp, whose colours are the same in light and dark."""
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
    # Between choices there is nothing.
    if not x.choices and not y.choices and len(points) > 3:
        _draw_margins(axes, points, x, y)
    xs = [coordinate(x, p.result.values[0]) for p in points]
    ys = [coordinate(y, p.result.values[1]) for p in points]
    draw_marks(axes, points, xs, ys, passing=_MARKS, failing=_MARKS)
    for point, colour, about in (
        (written_point(task), _MARKS, "as written"), (nearest, "near", "nearest failure"),
    ):  # fmt: skip
        if point is not None:
            at = coordinate(x, point[0]), coordinate(y, point[1])
            axes.diamonds([at[0]], [at[1]], colour, 8.0, about=about)
    return sheet


def _draw_margins(
    axes: Axes, points: Sequence[DrawnPoint], x: SearchParameter, y: SearchParameter
) -> None:
    """Fill cells with the colour of their margin, and draw the line where it is zero."""
    runs = np.array(
        [
            [position_in_range(p, v) for p, v in zip((x, y), point.result.values, strict=True)]
            for point in points
        ]
    )
    values = balanced(np.array([point.value for point in points]))
    across, up = (_values_at(p, CELL_ENDS) for p in (x, y))
    for colour, cells in coloured_cells(runs, values):
        rings = [
            [(across[a], up[j]), (across[b], up[j]), (across[b], up[j + 1]), (across[a], up[j + 1])]
            for a, b, j in cells
        ]
        # Half a hair over its edge: else the page shines through between neighbours.
        axes.shapes(rings, fill=colour, edge=colour, width=0.1)
    line = line_of_zero(runs, values)
    if len(line):
        axes.line(_values_at(x, line[:, 0]), _values_at(y, line[:, 1]), _MARKS, 1.6)


def coloured_cells(
    runs: Floats, values: Floats
) -> Iterator[tuple[str, list[tuple[int, int, int]]]]:
    """Yield each colour with its cells ``(a, b, j)``: row ``j`` from cell ``a`` to before ``b``.

    ``runs`` (n, 2) are places in the ranges of two parameters, ``values`` (n,) their balanced
    margins; :data:`CELL_ENDS` are where cells begin and end.
    """
    middles = 0.5 * (CELL_ENDS[:-1] + CELL_ENDS[1:])
    levels = ramp_levels(estimate(runs, values, _grid(middles)).reshape(_CELLS, _CELLS))
    for level, colour in enumerate(RAMP):
        cells = [(a, b, j) for j in range(_CELLS) for a, b in stretches(levels[:, j] == level)]
        if cells:
            yield colour, cells


def line_of_zero(runs: Floats, values: Floats) -> Floats:
    """Return places (m, 2) of one line along which margins are zero, with gaps of NaN."""
    at_corners = estimate(runs, values, _grid(CELL_ENDS)).reshape(_CELLS + 1, _CELLS + 1)
    lines = zero_lines(at_corners)
    gaps = np.full((len(lines), 1, 2), math.nan)
    found: Floats = np.concatenate((lines, gaps), axis=1).reshape(-1, 2) / _CELLS
    return found


def _grid(places: Floats) -> Floats:
    """Return every pair of places (n,) as (n * n, 2)."""
    return np.stack(np.meshgrid(places, places, indexing="ij"), axis=-1).reshape(-1, 2)


def _values_at(parameter: SearchParameter, places: Floats) -> Floats:
    """Return the values at places (n,) in a range."""
    low, high = parameter.low, parameter.high
    if parameter.log:
        found: Floats = low * (high / low) ** places
        return found
    linear: Floats = low + (high - low) * places
    return linear


def estimate(runs: Floats, values: Floats, places: Floats) -> Floats:
    """Return margins at ``places`` (k, 2) from those of ``runs`` (n, 2): ``values`` (n,).

    Means weighted by the inverse of distances to the fourth power (Shepard 1968): at a run it is
    the run's own margin, beside it that of the nearest runs. No value is outside of those seen.
    """
    apart = ((places[:, None, :] - runs[None, :, :]) ** 2).sum(axis=-1)
    weights = 1.0 / np.maximum(apart, 1e-12) ** (0.5 * _POWER)
    found: Floats = (weights @ values) / weights.sum(axis=1)
    return found


def balanced(margins: Floats) -> Floats:
    """Return margins (n,) from -1, the deepest failure, to 1, the widest pass, apart at zero.

    A fall from far above the limit to just below it is common: half of the colours are for each
    side, and the least failure is as far from zero as the least pass, so that the line between them
    runs where it is not known on which side it is.
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


def stretches(held: Any) -> list[tuple[int, int]]:
    """Return where a row (n,) holds without a gap: first and behind the last."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], held, [False])).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def zero_lines(values: Floats) -> Floats:
    """Return where values at the corners of cells (n, m) are zero: pieces (k, 2, 2) in cells.

    Marching squares: each side of a cell whose ends differ in sign is crossed where a straight line
    between its ends is zero. Where all four sides are, crossings next to each other are joined.
    """
    pieces: list[tuple[tuple[float, float], tuple[float, float]]] = []
    below = values < 0.0
    mixed = below[:-1, :-1] + 0 + below[1:, :-1] + below[:-1, 1:] + below[1:, 1:]
    for i, j in np.argwhere((mixed > 0) & (mixed < 4)).tolist():
        corners = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
        crossed = []
        for k, start in enumerate(corners):
            end = corners[(k + 1) % 4]
            a, b = float(values[start]), float(values[end])
            if (a < 0.0) != (b < 0.0):
                share = a / (a - b)
                crossed.append(
                    (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
                )
        pieces += list(zip(crossed[::2], crossed[1::2], strict=True))
    return np.array(pieces, float).reshape(-1, 2, 2)
