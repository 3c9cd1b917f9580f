"""Charts of a search: margins over its runs, and failures over its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any, Final

from daemon.analysis.charts import (
    BAD,
    DASHED,
    INK,
    LINE,
    NEAR,
    SECOND,
    SOFT,
    Chart,
    Table,
    columns_of,
    layer,
    legend,
    legend_opacity,
    quantity,
    tooltip,
)
from daemon.model.search import Point, PointValue, SearchTask
from daemon.model.trials import Trial, smallest_so_far
from daemon.search.answers.sentences import margin_words, point_words
from daemon.search.points import written_point

_MOST_PAIRED: Final = 4
"""Most parameters with a figure for every pair; more stand side by side."""
_RAMP: Final = ("#b2182b", "#d6604d", "#f4a582", "#92c5de", "#4393c3", "#2166ac")
"""Colours from failing to passing: ColorBrewer's RdBu, safe for colour-blind readers (Brewer and
Harrower, 2003). Half of it is below zero."""
_WIDTH: Final = 620
"""Width of a chart over the whole page [px]."""
_CROSS: Final = "M-.9,-.9L.9,.9M-.9,.9L.9,-.9"
_TOOLTIP: Final = tooltip({"run": "run", "words": "margin", "point": "point"})
"""Words of a run under the pointer: its number, its margin, its point."""


def margins_chart(task: SearchTask, trials: Sequence[Trial]) -> Chart:
    """Return the margin of every run, and the smallest so far.

    A second line compares a guided search with its own unguided runs.
    """
    unguided = f"{task.drawn_word} runs alone"
    series = {
        unguided: [trial for trial in trials if not trial.proposal.guided],
        "smallest so far": trials,
    }
    courses = [
        (trial.number, name, smallest)
        for name, of_name in series.items()
        for trial, smallest in zip(
            of_name, smallest_so_far(one.compared for one in of_name), strict=True
        )
    ]
    title = _margin_title(task)
    smallest = {
        "y": quantity("smallest", title),
        "color": _scale("of", {"smallest so far": INK, unguided: SECOND}),
    }
    course = columns_of(("run", "of", "smallest"), courses)
    line = layer("line", course, smallest, interpolate="step-after", strokeWidth=1.4)
    kinds = [
        "fails" if one.fails else "guided" if one.proposal.guided else task.drawn_word
        for one in trials
    ]
    colours = _scale("kind", {task.drawn_word: SOFT, "guided": LINE, "fails": BAD})
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
    last = max(trial.number for trial in trials)
    return {
        "params": legend("kind", "runs"),
        "width": _WIDTH,
        "height": 190,
        "encoding": {"x": quantity("run", "run", domain=[-0.5, last + 0.5])},
        "layer": [_zero(), line, dots],
    }


def space_charts(
    task: SearchTask, trials: Sequence[Trial], steps: Sequence[Trial], nearest: Point | None
) -> Iterator[tuple[str, Chart]]:
    """Yield charts of failures over parameters, each with its caption.

    A few parameters have a chart for every pair; a single one, and each of many, has a chart of the
    margins over its values. ``steps`` are the trials on the way to the ``nearest`` failure.
    """
    count = len(task.parameters)
    # With one or two parameters the charts show all of them, so these steps fit in too.
    judged = [one for one in (*trials, *(steps if count <= 2 else ())) if one.value is not None]
    if not judged:
        return
    names = [task.short_name(parameter.name) for parameter in task.parameters]
    if 1 < count <= _MOST_PAIRED:
        for x, y in combinations(range(count), 2):
            caption = "" if count == 2 else f"{names[y]} over {names[x]}"
            yield caption, _space_chart(task, judged, nearest, x, y)
    else:
        for x, name in enumerate(names):
            yield "" if count == 1 else name, _space_chart(task, judged, nearest, x)


def _space_chart(
    task: SearchTask,
    trials: Sequence[Trial],
    nearest: Point | None,
    across: int,
    up: int | None = None,
) -> Chart:
    """Return the trials over a parameter ``across``: their margins, or another parameter ``up``.

    Crosses fail, colours are margins, a click on the legend shows failing or passing runs alone.
    """
    margins = quantity("margin", _margin_title(task))
    axes = {"x": _axis(task, across, "x"), "y": margins if up is None else _axis(task, up, "y")}

    def places(points: Sequence[Point]) -> Table:
        columns = {"x": [_place(task, across, point) for point in points]}
        return columns if up is None else columns | {"y": [_place(task, up, one) for one in points]}

    colours = _margin_colour(task, trials)
    grey = {"symbolStrokeColor": SOFT, "symbolFillColor": SOFT}
    encoding: Chart = {
        **axes,
        "fill": colours,
        "stroke": {**colours, "legend": None},
        "shape": {**_scale("outcome", {"passes": "circle", "fails": _CROSS}), "legend": grey},
        "opacity": legend_opacity(1.0),
        "tooltip": _TOOLTIP,
    }
    columns = {**_columns(task, trials), **places([one.point for one in trials])}
    dots = layer("point", columns, encoding, name="runs", size=36, strokeWidth=1.8)
    diamond: Chart = {"shape": "diamond", "size": 90, "filled": True, "stroke": "var(--paper)"}
    marks = [
        layer("rule", places([point]), {"x": axes["x"]}, color=colour, strokeDash=DASHED)
        if up is None
        else layer("point", places([point]), axes, color=colour, tooltip=about, **diamond)
        for point, colour, about in _marked_points(task, nearest)
    ]
    width, height = {1: (_WIDTH, 200), 2: (420, 300)}.get(len(task.parameters), (260, 200))
    layers = [_zero(), *marks, dots] if up is None else [dots, *marks]
    return {"params": legend("outcome", "runs"), "width": width, "height": height, "layer": layers}


def _columns(task: SearchTask, trials: Sequence[Trial]) -> dict[str, list[Any]]:
    """Return the columns of every chart of trials: margins, and words for the tooltip."""
    return {
        "run": [one.number for one in trials],
        "margin": [one.compared for one in trials],
        "outcome": ["fails" if one.fails else "passes" for one in trials],
        "words": [margin_words(one) for one in trials],
        "point": [point_words(task, one.point, 12) for one in trials],
    }


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
        "range": list(_RAMP),
    }  # fmt: skip
    look = {"titleColor": SOFT, "titleFontSize": 9, "titleFontWeight": "normal"}
    # Small charts side by side have no room for a legend.
    steps = None if len(task.parameters) > 2 else {"columns": 6, **look}
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
