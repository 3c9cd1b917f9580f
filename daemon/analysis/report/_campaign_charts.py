"""Charts of a campaign: measures (figure 13 of the paper), comparisons, triggers (figure 14)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, TypeAlias

import numpy as np

from daemon.analysis.charts import (
    AXIS,
    BAD,
    DASHED,
    DOTTED,
    INK,
    SERIES,
    WIDTH,
    Chart,
    Table,
    colours_of,
    columns_of,
    hover_layer,
    layer,
    legend,
    legend_opacity,
    quantity,
    table,
    tooltip,
)
from daemon.analysis.report._cell_charts import ValueLimits
from daemon.analysis.report._data import ReferenceMark
from daemon.analysis.report._tracks import AFTER, BEFORE, TriggerEncounter
from daemon.model.assessments import ComparisonVerdict

_Marks: TypeAlias = Mapping[tuple[str, str], Sequence[ReferenceMark]]

_Row: TypeAlias = tuple[str, str, int, float]
"""Scenario or comparison, SUT, repeat, value."""

_STEP: Final = 0.2
"""Seconds between two values of a mean around a trigger."""
_LABELLED: Final = 6
"""Most reference values that a chart names; the page has a table for more."""


def box_chart(rows: Sequence[_Row], systems: Sequence[str], axis: str, marks: _Marks) -> Chart:
    """Return boxplots of one measure by scenario, SUTs side by side (figure 13).

    ``systems`` are all SUTs, in the order of their colours. Boxes show the quartiles, whiskers
    everything, dots each repeat, diamonds reference values.
    """
    half, dark = {"fillOpacity": 0.3}, {"color": INK}
    boxes = layer("boxplot", None, {}, extent="min-max", box=half, median=dark, rule=dark)
    # Begin at 0, unless that would hide a line at 0.
    zero = min(row[3] for row in rows) > 0.0
    return _groups("scenario", rows, systems, axis, [boxes], marks, zero=zero)


def comparison_chart(
    verdicts: Sequence[ComparisonVerdict], systems: Sequence[str], marks: _Marks
) -> Chart:
    """Return the differences of comparisons of one unit: left minus right, by SUT.

    Dots are pairs of runs, upright lines the 95 % interval of the mean, the short line the mean.
    The dashed line is the limit, diamonds are reference values.
    """
    rows = [
        (verdict.comparison, verdict.sut, number, value)
        for verdict in verdicts
        for number, value in enumerate(verdict.differences)
    ]
    intervals = [verdict.interval or (None, None) for verdict in verdicts]
    columns: Table = {
        "comparison": [verdict.comparison for verdict in verdicts],
        "SUT": [verdict.sut for verdict in verdicts],
        "mean": [verdict.mean for verdict in verdicts],
        "low": [low for low, _ in intervals],
        "high": [high for _, high in intervals],
        "limit": [verdict.limit for verdict in verdicts],
    }
    interval = {"y": quantity("low"), "y2": {"field": "high"}}
    limit = {
        "x": {"field": "comparison", "bandPosition": 0},
        "x2": {"field": "comparison", "bandPosition": 1},
        "xOffset": {"value": 0},
        "y": quantity("limit"),
        "color": {"value": BAD},
        "opacity": {"value": 1},
    }
    bounds = [
        layer("rule", columns, interval),
        layer("tick", columns, {"y": quantity("mean")}, orient="horizontal", thickness=1.4),
        layer("rule", columns, limit, strokeDash=DASHED),
    ]
    title = f"left minus right [{verdicts[0].unit}]"
    return _groups("comparison", rows, systems, title, bounds, marks, zero=False)


def _groups(
    group: str,
    rows: Sequence[_Row],
    systems: Sequence[str],
    title: str,
    layers: Sequence[Chart],
    marks: _Marks,
    *,
    zero: bool,
) -> Chart:
    """Return dots of ``rows``, SUTs side by side within each group, on top of ``layers``."""
    columns = columns_of((group, "SUT", "repeat", "value"), rows)
    names = list(dict.fromkeys(columns[group]))
    is_long = max(map(len, names)) * len(names) > 48
    axis = {"labelAngle": -25 if is_long else 0, "title": None}
    about = {group: group, "SUT": "SUT", "repeat": "repeat", "value": title}
    dots = layer("circle", None, {"tooltip": tooltip(about)}, name="dots", size=7)
    return {
        "title": title,
        "width": WIDTH,
        "height": 125,
        "params": legend("SUT", "dots"),
        "data": table(columns),
        "encoding": {
            "x": {"field": group, "type": "nominal", "sort": names, "axis": axis},
            "xOffset": {"field": "SUT", "type": "nominal", "sort": systems},
            "y": quantity("value", axis=AXIS, scale={"zero": zero, "nice": True}),
            "color": colours_of("SUT", systems, SERIES),
            "opacity": legend_opacity(1.0),
        },
        "layer": [*layers, dots, *_diamonds(group, names, max(columns["value"]), marks)],
    }


def _diamonds(group: str, names: Sequence[str], top: float, marks: _Marks) -> Iterator[Chart]:
    """Yield the reference values of ``names`` with deviation or range, and labels if few."""
    entries = [(*cell, m) for cell, of_cell in marks.items() for m in of_cell if cell[0] in names]
    if not entries:
        return
    columns: Table = {
        group: [name for name, _, _ in entries],
        "SUT": [sut for _, sut, _ in entries],
        "reference": [mark.value for _, _, mark in entries],
        "low": [mark.value if mark.low is None else mark.low for _, _, mark in entries],
        "high": [mark.value if mark.high is None else mark.high for _, _, mark in entries],
        "label": [mark.label for _, _, mark in entries],
        "source": [mark.source for _, _, mark in entries],
        # Labels go towards the middle, and below the highest mark, to stay in the chart. Those of
        # one group stand on lines of their own.
        "rise": [
            (-7 - 9 * lines if mark.value <= 0.9 * top else 10 + 9 * lines)
            for number, (name, _, mark) in enumerate(entries)
            for lines in [sum(other[0] == name for other in entries[number + 1 :])]
        ],
        "side": [
            "left" if 2 * names.index(name) < len(names) else "right" for name, _, _ in entries
        ],
    }
    black = {"color": {"value": INK}, "y": quantity("reference")}
    yield layer("rule", columns, {**black, "y": quantity("low"), "y2": {"field": "high"}})
    about = {**black, "tooltip": tooltip({"label": "reference", "source": "source"})}
    diamond = layer("point", columns, about, shape="diamond", filled=True, size=45)
    diamond["mark"] |= {"stroke": "var(--paper)", "strokeWidth": 0.8}
    yield diamond
    if len(entries) <= _LABELLED:
        place = {"align": {"expr": "datum.side"}, "dy": {"expr": "datum.rise"}}
        words = layer("text", columns, {**black, "text": {"field": "label"}})
        words["mark"] |= place
        yield words


def trigger_chart(
    scenarios: Mapping[str, Sequence[TriggerEncounter]], names: Sequence[str], limits: ValueLimits
) -> Chart:
    """Return speed and turning speed around one trigger with one SUT (figure 14).

    ``scenarios`` are the encounters of each, ``names`` all scenarios in the order of their colours.
    Lines are means over the repeats, bands go from the least to the greatest value. Lines are
    dashed if the door does not move.
    """
    turning = (-limits.turning, limits.turning)
    return {
        "vconcat": [
            _trigger_panel("speed", "speed [m/s]", scenarios, names, (0.0, limits.speed)),
            _trigger_panel("turning", "turning [rad/s]", scenarios, names, turning),
        ],
        "spacing": 6,
        "params": legend("scenario", "speed [m/s]", "turning [rad/s]"),
    }


def _trigger_panel(
    track: str,
    title: str,
    scenarios: Mapping[str, Sequence[TriggerEncounter]],
    names: Sequence[str],
    values: tuple[float, float],
) -> Chart:
    grid = np.arange(-BEFORE, AFTER + 0.5 * _STEP, _STEP)
    rows: list[tuple[Any, ...]] = []
    for name, encounters in scenarios.items():
        lines = np.stack([
            np.interp(grid, e.since, getattr(e, track), left=np.nan, right=np.nan)
            for e in encounters
        ])  # fmt: skip
        # Use only times with values of every repeat: a mean over a changing number of runs jumps.
        shared = ~np.isnan(lines).any(axis=0)
        lines = lines[:, shared]
        fired = "yes" if encounters[0].fired else "no"
        bands = grid[shared], lines.mean(axis=0), lines.min(axis=0), lines.max(axis=0)
        rows += [(name, fired, *row) for row in np.column_stack(bands).tolist()]
    about = {
        "scenario": "scenario", "fires": "door is triggered", "time": "time from the trigger [s]",
        "mean": f"mean {title}", "low": "least", "high": "most",
    }  # fmt: skip
    columns = columns_of(about, rows)
    upper = track == "speed"
    place = {
        "x": quantity("time", "" if upper else about["time"], domain=(-BEFORE, AFTER)),
        "y": quantity("mean", domain=values, axis=AXIS),
    }
    colour = colours_of("scenario", names, SERIES)
    dashes = {"domain": ["yes", "no"], "range": [[1, 0], [4, 2]]}
    dash = {"field": "fires", "type": "nominal", "legend": None, "scale": dashes}
    area = {**place, "y": {**place["y"], "field": "low"}, "y2": {"field": "high"}, "color": colour}
    line = {**place, "color": colour, "strokeDash": dash, "opacity": legend_opacity(1.0)}
    return {
        "title": title,
        "width": WIDTH,
        "height": 70,
        "data": table(columns),
        "layer": [
            layer("area", None, {**area, "opacity": legend_opacity(0.1, 0.0)}),
            layer("line", None, line, name=title, strokeWidth=1.1),
            layer("rule", {}, {"x": {"datum": 0}}, color=INK, strokeDash=DOTTED),
            hover_layer(title, place, about, ["scenario", "time"]),
        ],
    }
