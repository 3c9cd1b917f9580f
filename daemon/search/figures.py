"""Charts of a search: margins over its runs, and failures over its parameters."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate, combinations
from typing import Any, Final

from daemon.analysis.charts import (
    BAD,
    INK,
    LINE,
    NEAR,
    SECOND,
    SOFT,
    Chart,
    Table,
    layer,
    legend,
    legend_opacity,
    quantity,
    table,
    tooltip,
)
from daemon.model.search import Point, PointValue, SearchParameter, SearchTask
from daemon.model.trials import Trial, smallest_so_far
from daemon.search.answers.sentences import margin_words, point_words
from daemon.search.points import position_in_range, range_text, written_point

MOST_PAIRED: Final = 4
"""Most parameters with a figure for every pair; more stand side by side."""
MOST_LINES: Final = 400
"""Most passing points drawn as lines; of more, a subset evenly over the search."""
RAMP: Final = ("#b2182b", "#d6604d", "#f4a582", "#92c5de", "#4393c3", "#2166ac")
"""Colours from failing to passing: ColorBrewer's RdBu, safe for colour-blind readers (Brewer and
Harrower, 2003). Half of it is below zero."""
_WIDTH: Final = 620
"""Width of a chart over the whole page [px]."""
_CROSS: Final = "M-.9,-.9L.9,.9M-.9,.9L.9,-.9"
_OUTSIDE: Final = 0.06
"""Distance at which a written value outside its range is drawn, as a share of the range."""
_TOOLTIP: Final = tooltip({"run": "run", "words": "margin", "point": "point"})
"""Words of a run under the pointer: its number, its margin, its point."""


def margins_chart(task: SearchTask, trials: Sequence[Trial]) -> Chart:
    """Return the margin of every run and the smallest so far, and below the number of failures.

    The chart compares a guided search with its own unguided runs.
    """
    unguided = [trial for trial in trials if not trial.proposal.guided]
    name = f"{task.drawn_word} runs alone"
    kinds = [
        "fails" if one.fails else "guided" if one.proposal.guided else task.drawn_word
        for one in trials
    ]
    colours = _scale("kind", {task.drawn_word: SOFT, "guided": LINE, "fails": BAD})
    title = _margin_title(task)
    encoding = {
        "y": quantity("margin", title),
        "stroke": colours,
        "fill": colours,
        "shape": _scale("kind", {task.drawn_word: "circle", "guided": "circle", "fails": _CROSS}),
        "opacity": legend_opacity(0.9),
        "tooltip": _TOOLTIP,
    }
    columns = {**_columns(task, trials), "kind": kinds}
    dots = layer("point", columns, encoding, name="runs", size=22, strokeWidth=1.3)
    last = max(one.number + 1 for one in (*trials, *unguided))
    runs = quantity("run", domain=[-0.5, last])
    courses = _courses({name: unguided, "smallest so far": trials}, last)
    line: Chart = {"interpolate": "step-after", "strokeWidth": 1.4}
    colour = _scale("of", {"smallest so far": INK, name: SECOND})
    smallest = {"y": quantity("smallest", title), "color": colour}
    above = {
        "width": _WIDTH,
        "height": 190,
        "encoding": {"x": {**runs, "axis": {"labels": False, "title": None}}},
        "layer": [_zero(), layer("line", courses, smallest, **line), dots],
    }
    top = max(1, sum(one.fails for one in trials))
    failures = {
        "x": {**runs, "title": "run"},
        "y": quantity("failures", "failures", axis={"values": [0, top]}),
        "color": {**colour, "legend": None},
    }
    below = {"width": _WIDTH, "height": 70, **layer("line", courses, failures, **line)}
    # Otherwise the lower panel, which has no legend, would remove that of the upper one.
    own = {"legend": {"color": "independent"}}
    panels = {"vconcat": [above, below], "spacing": 6, "resolve": own}
    return {"params": legend("kind", "runs"), **panels}


def _courses(series: Mapping[str, Sequence[Trial]], last: int) -> Table:
    """Return the smallest margin and the number of failures after each run, up to ``last``."""
    rows: list[tuple[int, str, float, int]] = []
    for name, trials in series.items():
        smallest = smallest_so_far(one.compared for one in trials)
        failures = accumulate(int(one.fails) for one in trials)
        pairs = zip(trials, smallest, failures, strict=True)
        rows += [(one.number, name, margin, failed) for one, margin, failed in pairs]
        if trials:
            rows.append((last, *rows[-1][1:]))
    columns = zip(*rows, strict=True)
    return dict(zip(("run", "of", "smallest", "failures"), columns, strict=True))


def space_charts(
    task: SearchTask, trials: Sequence[Trial], steps: Sequence[Trial], nearest: Point | None
) -> Iterator[tuple[str, Chart]]:
    """Yield charts of failures over parameters, each with its caption.

    One parameter has a chart of its margins, few have a chart for every pair, and many stand side
    by side. ``steps`` are the trials on the way to the ``nearest`` failure.
    """
    count = len(task.parameters)
    # With one or two parameters the charts show all of them, so these steps fit in too.
    judged = [one for one in (*trials, *(steps if count <= 2 else ())) if one.value is not None]
    if not judged:
        return
    if count == 1:
        yield "", _range_chart(task, judged, nearest)
    elif count > MOST_PAIRED:
        yield "", _parallel_chart(task, judged, nearest)
    else:
        names = [task.short_name(parameter.name) for parameter in task.parameters]
        for x, y in combinations(range(count), 2):
            caption = "" if count == 2 else f"{names[y]} over {names[x]}"
            yield caption, _pair_chart(task, judged, nearest, (x, y))


def _range_chart(task: SearchTask, trials: Sequence[Trial], nearest: Point | None) -> Chart:
    axes = {"x": _axis(task, 0, "x"), "y": quantity("margin", _margin_title(task))}
    uprights = [
        layer("rule", {}, {"x": {"datum": _place(task, 0, point)}}, color=colour, strokeDash=[5, 3])
        for point, colour, _ in _marked_points(task, nearest)
    ]
    dots = _dots(task, trials, axes, {"x": [_place(task, 0, one.point) for one in trials]})
    return _answering({"width": _WIDTH, "height": 200, "layer": [_zero(), *uprights, dots]})


def _pair_chart(
    task: SearchTask, trials: Sequence[Trial], nearest: Point | None, pair: tuple[int, int]
) -> Chart:
    """Return the trials over two parameters in the colours of their margins; crosses fail."""
    across, up = pair
    axes = {"x": _axis(task, across, "x"), "y": _axis(task, up, "y")}

    def places(points: Sequence[Point]) -> Table:
        return {
            "x": [_place(task, across, point) for point in points],
            "y": [_place(task, up, point) for point in points],
        }

    look: Chart = {"shape": "diamond", "size": 90, "filled": True, "stroke": "var(--paper)"}
    diamonds = [
        layer("point", places([point]), axes, color=colour, tooltip=about, **look)
        for point, colour, about in _marked_points(task, nearest)
    ]
    dots = _dots(task, trials, axes, places([one.point for one in trials]))
    width, height = (420, 300) if len(task.parameters) == 2 else (260, 200)
    return _answering({"width": width, "height": height, "layer": [dots, *diamonds]})


def _parallel_chart(task: SearchTask, trials: Sequence[Trial], nearest: Point | None) -> Chart:
    """Return every trial as a line over upright axes, one for each parameter.

    A brushed area keeps the trials that lie in it on every axis that it touches.
    """
    passing = [one for one in trials if not one.fails]
    passing = passing[:: max(1, math.ceil(len(passing) / MOST_LINES))]
    lines = [*passing, *(one for one in trials if one.fails)]
    count = len(task.parameters)
    in_brush = " && ".join(
        f"(brush.axis[0] > {i} || brush.axis[1] < {i} || inrange(datum.p{i}, brush.share))"
        for i in range(count)
    )
    opacity = {"test": f"!isValid(brush.axis) || ({in_brush})", "value": 0.6}
    heights = _heights(task, [one.point for one in lines])
    ways = {
        "data": table({**_columns(task, lines), **heights}, 3),
        "transform": _folded(count),
        "params": [{"name": "brush", "select": "interval"}],
        "mark": "line",
        "encoding": {
            "detail": {"field": "run"},
            "color": _margin_colour(task, trials),
            "opacity": {"condition": opacity, "value": 0.03},
            "strokeWidth": {"condition": {"test": "datum.margin < 0", "value": 1.6}, "value": 0.7},
            "tooltip": _TOOLTIP,
        },
    }
    looks: dict[str, Chart] = {
        INK: {"strokeDash": [5, 3]},
        NEAR: {"strokeWidth": 2.6, "point": {"color": NEAR}},
    }
    marked = [
        {
            "data": table(_heights(task, [point])),
            "transform": _folded(count),
            "mark": {"type": "line", "color": colour, "tooltip": about} | looks[colour],
        }
        for point, colour, about in _marked_points(task, nearest)
    ]
    names = json.dumps([[task.short_name(one.name), range_text(one)] for one in task.parameters])
    axis = {
        "values": list(range(count)), "labelExpr": f"{names}[datum.value]", "title": None,
        "labelAngle": -28, "labelLimit": 130, "labelOverlap": False, "labelColor": INK,
        "grid": True, "gridWidth": 1, "domain": False,
    }  # fmt: skip
    across = {
        "x": quantity("axis", domain=[-0.4, count - 0.6], axis=axis),
        "y": quantity("share", domain=[-0.08, 1.08], axis=None),
    }
    return {"width": _WIDTH, "height": 240, "encoding": across, "layer": [ways, *marked]}


def _columns(task: SearchTask, trials: Sequence[Trial]) -> dict[str, list[Any]]:
    """Return the columns of every chart of trials: margins, and words for the tooltip."""
    return {
        "run": [one.number for one in trials],
        "margin": [one.compared for one in trials],
        "outcome": ["fails" if one.fails else "passes" for one in trials],
        "words": [margin_words(one) for one in trials],
        "point": [point_words(task, one.point, 12) for one in trials],
    }


def _dots(
    task: SearchTask, trials: Sequence[Trial], axes: Mapping[str, Any], places: Table
) -> Chart:
    colours = _margin_colour(task, trials)
    grey = {"symbolStrokeColor": SOFT, "symbolFillColor": SOFT}
    encoding = {
        **axes,
        "fill": colours,
        "stroke": {**colours, "legend": None},
        "shape": {**_scale("outcome", {"passes": "circle", "fails": _CROSS}), "legend": grey},
        "opacity": legend_opacity(1.0),
        "tooltip": _TOOLTIP,
    }
    columns = {**_columns(task, trials), **places}
    return layer("point", columns, encoding, name="runs", size=36, strokeWidth=1.8)


def _answering(chart: Chart) -> Chart:
    """Return a chart whose legend selects failing or passing runs."""
    return {"params": legend("outcome", "runs"), **chart}


def _margin_title(task: SearchTask) -> str:
    """Return the title of a search's values, with their unit."""
    if len(task.scales) > 1:
        return "smallest margin, as a share of its scale"
    unit = task.scales[0].unit
    return f"margin of {task.minimise} [{unit}]" if unit not in ("", "1") else task.minimise


def _margin_colour(task: SearchTask, trials: Sequence[Trial]) -> dict[str, Any]:
    """Return the colours of margins, which change at zero.

    Margins often fall from far above the limit to just below it, so each side has its own scale.
    """
    margins = [one.compared for one in trials]
    above = max(0.0, *margins) or 1.0
    below = -min(0.0, *margins) or above
    edges = [-below * 2 / 3, -below / 3, 0.0, above / 3, above * 2 / 3]
    scale = {
        "type": "threshold", "domain": [float(f"{edge:.2g}") for edge in edges],
        "range": list(RAMP),
    }  # fmt: skip
    look = {"titleColor": SOFT, "titleFontSize": 9, "titleFontWeight": "normal"}
    # Small charts side by side have no room for a legend.
    steps = None if 2 < len(task.parameters) <= MOST_PAIRED else {"columns": 6, **look}
    return quantity("margin", _margin_title(task), scale=scale, legend=steps)


def _axis(task: SearchTask, index: int, field: str) -> dict[str, Any]:
    """Return the axis of a parameter: its range, or its choices in their order.

    It includes the written value, from which the search starts.
    """
    parameter, origin = task.parameters[index], task.parameters[index].written
    title = task.short_name(parameter.name)
    values = parameter.choices or (parameter.low, parameter.high)
    values = values if origin is None or origin in values else (*values, origin)
    if parameter.choices:
        scale = {"domain": [parameter.shown(choice) for choice in values]}
        axis = {"labelAngle": 0}
        return {"field": field, "type": "ordinal", "scale": scale, "axis": axis, "title": title}
    title += f" [{parameter.unit}]" if parameter.unit else ""
    ends = [value for value in values if not isinstance(value, str)]
    low, high = min(ends), max(ends)
    if parameter.log and low > 0.0:
        log = {"type": "log", "domain": [low, high], "nice": False}
        return quantity(field, title, scale=log)
    room = 0.03 * (high - low)
    return quantity(field, title, domain=[low - room, high + room])


def _place(task: SearchTask, index: int, point: Point) -> PointValue:
    """Return the place of a point on the axis of a parameter."""
    parameter = task.parameters[index]
    return parameter.shown(point[index]) if parameter.choices else point[index]


def _heights(task: SearchTask, points: Sequence[Point]) -> dict[str, list[float]]:
    """Return the positions of points in the range of each parameter, as columns."""
    return {
        f"p{index}": [_height(parameter, point[index]) for point in points]
        for index, parameter in enumerate(task.parameters)
    }


def _height(parameter: SearchParameter, value: PointValue) -> float:
    at = position_in_range(parameter, value)
    return at if math.isnan(at) else min(1.0 + _OUTSIDE, max(-_OUTSIDE, at))


def _folded(count: int) -> list[dict[str, Any]]:
    """Return the transform that turns a row with all axes into a row for each axis."""
    return [
        {"fold": [f"p{index}" for index in range(count)], "as": ["axis", "share"]},
        {"calculate": "toNumber(slice(datum.axis, 1))", "as": "axis"},
    ]


def _marked_points(task: SearchTask, nearest: Point | None) -> Iterator[tuple[Point, str, str]]:
    """Yield the scenario as written and the nearest failure, each with its colour and its name."""
    if (point := written_point(task)) is not None:
        yield point, INK, "as written"
    if nearest is not None:
        yield nearest, NEAR, "nearest failure"


def _scale(field: str, looks: Mapping[str, Any]) -> dict[str, Any]:
    """Return the encoding that gives each value of a field its look."""
    scale = {"domain": list(looks), "range": list(looks.values())}
    return {"field": field, "scale": scale, "title": None}


def _zero() -> Chart:
    """Return the line at a margin of zero; runs below it fail."""
    across = {"x": {"value": 0}, "x2": {"value": "width"}, "y": {"datum": 0}}
    return layer("rule", {}, across, color=BAD)
