"""Charts of a report in Vega-Lite: of a cell (figures 8, 9, 11 and 12 of the paper), of measures
(13), of comparisons, and around triggers (14).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
import shapely

from daemon.analysis.charts import HOVER, SERIES, Chart, table
from daemon.analysis.report._data import ReportRun
from daemon.analysis.report._references import ReferenceMark
from daemon.analysis.report._tracks import AFTER, BEFORE, TriggerEncounter
from daemon.model.assessments import ComparisonVerdict
from grammars.model.geometry import Floats

_Table: TypeAlias = Mapping[str, Sequence[Any]]
_Marks: TypeAlias = Mapping[tuple[str, str], Sequence[ReferenceMark]]

REPEATS: Final = 10
"""Repeats drawn of one cell at most: the paper has five; more lines than this are one band."""
_WIDTH: Final = 290
_AXIS: Final = {"minExtent": 28, "tickCount": 3}
"""Room for the numbers along y: the same in most, so that panels begin at one line."""
_DEVIATION: Final = 0.5
"""Pixels that a curve may pass beside the samples it is drawn from."""
_INK, _SOFT, _LINE, _SECOND = "var(--ink)", "var(--soft)", "var(--line)", "var(--second)"
_BAD, _NEAR, _BODY = "var(--bad)", "var(--near)", "var(--body)"
_DASHED: Final = [4, 3]
_DOTTED: Final = [1, 1.6]
_BROKEN: Final = [6, 2, 1.5, 2]
_HEAT: Final = ("#fed976", "#feb24c", "#fd8d3c", "#fc4e2a", "#e31a1c", "#bd0026", "#800026")
"""From few to many: the colours of ColorBrewer's YlOrRd (Brewer, Harrower, 2003)."""
_BINS: Final = 64
_AROUND: Final = 30.0
"""Seconds before and after the largest error that are shown."""
_STEP: Final = 0.2
"""Seconds between two values of a mean around a trigger."""
_LABELLED: Final = 6
"""Reference values that a chart names at most; of more the page has a table."""


@dataclass(frozen=True, slots=True)
class ValueLimits:
    """Ends of the axes of values, which all panels of a kind share: twice as high is twice as much.

    ``error`` and ``spread`` [m], ``speed`` [m/s] and ``turning`` [rad/s] are the largest shown.
    ``clearance`` goes from the first to the second [m].
    """

    error: float
    spread: float
    clearance: tuple[float, float]
    speed: float
    turning: float


def value_limits(runs: Sequence[ReportRun], errors: Iterable[float]) -> ValueLimits:
    """Return limits that show everything of ``runs``, and the ``errors`` [m] that are marked.

    An error far above all runs is left out: it would press their curves flat against the axis.
    """
    tracks = [run.tracks for run in runs]
    top = _top(run.error for run in tracks)
    nearest = [float(np.nanmin(run.clearance)) for run in tracks if _has_values(run.clearance)]
    widest = max(_top(run.clearance for run in tracks), 0.3)
    return ValueLimits(
        error=max([top, *(1.1 * error for error in errors if error < 4.0 * top)]),
        spread=_top(values for run in tracks for values in (run.sigma_x, run.sigma_y)),
        # Up to 2 m: in a hall the dips that matter would vanish at the bottom.
        clearance=(min([-0.05, *nearest]), min(widest, 2.0)),
        speed=1.05 * max((run.top_speed for run in tracks), default=0.0) or 1.0,
        turning=1.05 * max((run.top_turning for run in tracks), default=0.0) or 1.0,
    )


def _has_values(values: Any) -> bool:
    return bool(len(values)) and not np.isnan(values).all()


def _top(tracks: Iterable[Any]) -> float:
    return 1.05 * max((float(np.nanmax(v)) for v in tracks if _has_values(v)), default=1.0) or 1.0


def localisation_chart(
    runs: Sequence[ReportRun],
    end: float,
    limits: ValueLimits,
    limit: float | None,
    marks: Sequence[ReferenceMark],
) -> Chart:
    """Return the localisation error and the spread of the estimate up to ``end`` [s] (figure 8)."""
    time, top = (0.0, end), limits.error
    lines = _reference_lines([mark for mark in marks if mark.value < top])
    if limit is not None and limit < top:
        lines.append(_level(limit, _BAD, _DASHED))
    spread = {"σx": ("sigma_x", _LINE), "σy": ("sigma_y", _SECOND)}
    above = _panel("error [m]", runs, {"": ("error", _LINE)}, time, (0.0, top), lines, upper=True)
    return {
        "vconcat": [above, _panel("spread [m]", runs, spread, time, (0.0, limits.spread))],
        "resolve": {"legend": {"color": "independent"}, "scale": {"color": "independent"}},
        "spacing": 6,
        "params": _time_params("error [m]", "spread [m]") + _legend("curve", "spread [m]"),
    }


def peak_chart(run: ReportRun, limit: float | None) -> Chart:
    """Return the localisation error of a run around its peak (figure 9)."""
    tracks = run.tracks
    peak = int(np.nanargmax(tracks.error))
    at, value = float(tracks.time[peak]), float(tracks.error[peak])
    time = max(at - _AROUND, 0.0), min(at + _AROUND, float(tracks.time[-1]))
    curves = {"error": ("error", _LINE), "σx": ("sigma_x", _SECOND), "σy": ("sigma_y", _SOFT)}
    shown = (tracks.time >= time[0]) & (tracks.time <= time[1])
    values = [getattr(tracks, name)[shown] for name, _ in curves.values()]
    dot = _layer("circle", {}, {"x": {"datum": at}, "y": {"datum": value}}, color=_BAD, size=40)
    lines = [dot]
    if limit is not None and limit < 4.0 * value:
        lines.append(_level(limit, _BAD, _DASHED))
        values.append(np.array([limit]))
    panel = _panel("error [m]", [run], curves, time, (0.0, _top(values)), lines)
    return panel | {"params": _time_params("error [m]") + _legend("curve", "error [m]")}


def clearance_chart(
    runs: Sequence[ReportRun], end: float, limits: ValueLimits, marks: Sequence[ReferenceMark]
) -> Chart:
    """Return the distance to obstacles up to ``end`` [s], triggers dotted (figure 12)."""
    low, high = limits.clearance
    buffer = runs[0].tracks.limit
    fired = [e.time for run in runs[:REPEATS] for e in run.tracks.encounters if e.fired]
    lines = [_level(0.0, _BAD), *_reference_lines([mark for mark in marks if mark.value < high])]
    if buffer > 0.0:
        band = {"y": {"datum": low}, "y2": {"datum": buffer}}
        lines.append(_layer("rect", {}, band, color=_NEAR, opacity=0.13))
    if fired:
        moments = {"x": _quantity("time")}
        dotted = _layer("rule", {"time": fired}, moments, color=_INK, strokeDash=_DOTTED)
        lines.append(dotted)
    curve = {"": ("clearance", _LINE)}
    panel = _panel("clearance [m]", runs, curve, (0.0, end), limits.clearance, lines)
    return panel | {"params": _time_params("clearance [m]")}


def _panel(
    title: str,
    runs: Sequence[ReportRun],
    curves: Mapping[str, tuple[str, str]],
    time: tuple[float, float],
    values: tuple[float, float],
    lines: Sequence[Chart] = (),
    *,
    upper: bool = False,
) -> Chart:
    """Return curves of every run over ``time`` [s]: the track and the colour of each name.

    ``values`` are the ends of the axis of values, ``lines`` layers behind the curves. The lower
    panel names the axis they share.
    """
    height = 60 if upper or len(curves) == 2 else 105
    scale = np.array([_WIDTH / (time[1] - time[0]), height / (values[1] - values[0])])
    rows = [
        (name, run.record.repeat, *sample)
        for run in runs[:REPEATS]
        for name, (track, _) in curves.items()
        for sample in _samples(run.tracks.time, getattr(run.tracks, track), time, scale)
    ]
    about = {"repeat": "repeat", "time": "time [s]", "value": title}
    place = {
        "x": _quantity("time", "" if upper else about["time"], domain=time),
        "y": _quantity("value", domain=values, axis=_AXIS),
    }
    columns = _columns(("curve", *about), rows)
    opacity = 0.6 if len(runs) > 1 else 1.0
    encoding = {**place, "detail": {"field": "repeat"}, "opacity": {"value": opacity}}
    if len(curves) == 1:
        columns.pop("curve", None)
        encoding["color"] = {"value": curves[""][1]}
    else:
        about = {"curve": "curve", **about}
        encoding["color"] = _colours("curve", list(curves), [c for _, c in curves.values()])
        encoding["opacity"] = _legend_opacity(opacity)
    clip = max((row[3] for row in rows), default=0.0) > values[1]
    begin = {"datum": {"expr": "span[0]"}, "type": "quantitative"}
    span = {"x": begin, "x2": {"datum": {"expr": "span[1]"}}}
    return {
        "title": title,
        "width": _WIDTH,
        "height": height,
        "data": table(columns),
        "layer": [
            *lines,
            _layer("line", None, encoding, name=title, clip=clip, strokeWidth=0.8),
            _layer(
                "rect", {}, span, name=f"{HOVER} span {title}", color=_LINE, opacity=0.12, clip=True
            ),
            _hover(title, place, about, ["repeat", "time"], clip=clip),
        ],
    }


def _samples(
    time: Any, values: Any, span: tuple[float, float], scale: Floats
) -> Iterator[tuple[float, float]]:
    """Return the samples of a curve that make a difference to be seen, no number in its gaps."""
    shown = (time >= span[0]) & (time <= span[1])
    points = np.column_stack((time[shown], values[shown])).astype(np.float64)
    gaps = np.flatnonzero(np.diff(np.isnan(points[:, 1]))) + 1
    for piece in np.split(points, gaps):
        if len(piece) > 1 and not np.isnan(piece).any():
            line = shapely.LineString(piece * scale).simplify(_DEVIATION)
            yield from (shapely.get_coordinates(line) / scale).tolist()
        else:
            yield from piece[:1].tolist()


def returns_chart(runs: Sequence[ReportRun]) -> Chart:
    """Return the laser returns inside the safety buffer, seen from the robot (figure 11)."""
    first = runs[0].tracks
    (hx, hy), ahead = first.buffer, 0.6 * first.body[0]
    reach = 1.12 * max(hx, hy)
    ends, side = (-reach, reach), 2.0 * reach / _BINS
    points = np.concatenate([run.tracks.returns for run in runs[:REPEATS]])
    counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=_BINS, range=(ends, ends))
    # Roots, since a wall driven along has many times the counts of a corner passed.
    levels = np.ceil(np.sqrt(counts / max(counts.max(), 1.0)) * len(_HEAT)).astype(int)
    cells = np.argwhere(levels)
    x, y = (cells * side - reach).T.tolist()
    found = counts[tuple(cells.T)].tolist(), levels[tuple(cells.T)].tolist()
    columns = {"x": x, "y": y, "returns": found[0], "level": found[1]}
    scale = {"domain": list(range(1, 1 + len(_HEAT))), "range": _HEAT}
    encoding = {
        "x": _quantity("x", "ahead [m]", domain=ends, axis={"tickCount": 5}),
        "y": _quantity("y", domain=ends, axis=_AXIS),
        "x2": {"field": "x2"},
        "y2": {"field": "y2"},
        "color": {"field": "level", "type": "ordinal", "legend": None, "scale": scale},
        "tooltip": _quantity("returns"),
    }
    heat = _layer("rect", columns, encoding)
    heat["transform"] = [{"calculate": f"datum.{a} + {side:.6g}", "as": f"{a}2"} for a in "xy"]
    box = [(-hx, -hy), (hx, -hy), (hx, hy), (-hx, hy), (-hx, -hy)]
    arrow = [
        (-ahead, 0),
        (ahead, 0),
        (0.8 * ahead, ahead / 8),
        (0.8 * ahead, -ahead / 8),
        (ahead, 0),
    ]
    footprint = [*first.footprint, first.footprint[0]]
    outlines = [_outline(footprint, _BODY), _outline(arrow, _BODY), _outline(box, _SOFT, _DASHED)]
    return {"title": "left [m]", "width": 170, "height": 170, "layer": [heat, *outlines]}


def _outline(
    points: Sequence[tuple[float, float]], colour: str, dashes: Sequence[float] = ()
) -> Chart:
    x, y = zip(*points, strict=True)
    place = {"x": _quantity("x"), "y": _quantity("y"), "order": {"field": "n"}}
    columns = {"x": x, "y": y, "n": range(len(x))}
    return _layer("line", columns, place, color=colour, strokeWidth=1.2, strokeDash=dashes)


def box_chart(rows: Sequence[tuple[str, str, int, float]], axis: str, marks: _Marks) -> Chart:
    """Return boxplots of one measure by scenario, SUTs side by side (figure 13).

    ``rows`` are scenario, SUT, repeat and value. Boxes show the quartiles, whiskers everything,
    dots each repeat, diamonds reference values.
    """
    half = {"fillOpacity": 0.3}
    boxes = _layer("boxplot", None, {}, extent="min-max", box=half, median={"color": _INK})
    # From 0 on, unless that would hide a line at 0.
    zero = min(row[3] for row in rows) > 0.0
    return _groups("scenario", rows, axis, [boxes], marks, zero=zero)


def comparison_chart(verdicts: Sequence[ComparisonVerdict], marks: _Marks) -> Chart:
    """Return the differences that comparisons of one unit judge: left minus right, by SUT.

    Dots are pairs of runs, upright lines the 95 % interval of the mean, the short line the mean.
    The dashed line is the limit, diamonds are reference values.
    """
    rows = [
        (verdict.comparison, verdict.sut, number, value)
        for verdict in verdicts
        for number, value in enumerate(verdict.differences)
    ]
    intervals = [verdict.interval or (np.nan, np.nan) for verdict in verdicts]
    columns: _Table = {
        "comparison": [verdict.comparison for verdict in verdicts],
        "SUT": [verdict.sut for verdict in verdicts],
        "mean": [np.nan if verdict.mean is None else verdict.mean for verdict in verdicts],
        "low": [low for low, _ in intervals],
        "high": [high for _, high in intervals],
        "limit": [verdict.limit for verdict in verdicts],
    }
    interval = {"y": _quantity("low"), "y2": {"field": "high"}}
    limit = {
        "x": {"field": "comparison", "bandPosition": 0},
        "x2": {"field": "comparison", "bandPosition": 1},
        "xOffset": {"value": 0},
        "y": _quantity("limit"),
        "color": {"value": _BAD},
        "opacity": {"value": 1},
    }
    bounds = [
        _layer("rule", columns, interval),
        _layer("tick", columns, {"y": _quantity("mean")}, orient="horizontal", thickness=1.4),
        _layer("rule", columns, limit, strokeDash=_DASHED),
    ]
    title = f"left minus right [{verdicts[0].unit}]"
    return _groups("comparison", rows, title, bounds, marks, zero=False)


def _groups(
    group: str,
    rows: Sequence[tuple[str, str, int, float]],
    title: str,
    layers: Sequence[Chart],
    marks: _Marks,
    *,
    zero: bool,
) -> Chart:
    """Return dots of ``rows``, SUTs side by side within each group, on top of ``layers``."""
    columns = _columns((group, "SUT", "repeat", "value"), rows)
    names, systems = (list(dict.fromkeys(columns[field])) for field in (group, "SUT"))
    turned = max(map(len, names)) * len(names) > 48
    axis = {"labelAngle": -25 if turned else 0, "title": None}
    about = {group: group, "SUT": "SUT", "repeat": "repeat", "value": title}
    dots = _layer("circle", None, {"tooltip": _tooltip(about)}, name="dots", size=7)
    return {
        "title": title,
        "width": _WIDTH,
        "height": 125,
        "params": _legend("SUT", "dots"),
        "data": table(columns),
        "encoding": {
            "x": {"field": group, "type": "nominal", "sort": names, "axis": axis},
            "xOffset": {"field": "SUT", "type": "nominal", "sort": systems},
            "y": _quantity("value", axis=_AXIS, scale={"zero": zero, "nice": True}),
            "color": _colours("SUT", systems, SERIES),
            "opacity": _legend_opacity(1.0),
        },
        "layer": [*layers, dots, *_diamonds(group, names, max(columns["value"]), marks)],
    }


def _diamonds(group: str, names: Sequence[str], top: float, marks: _Marks) -> Iterator[Chart]:
    """Return reference values with their deviation or range, named where they are few."""
    shown = [(*cell, mark) for cell, of_cell in marks.items() for mark in of_cell]
    if not shown:
        return
    columns: _Table = {
        group: [name for name, _, _ in shown],
        "SUT": [sut for _, sut, _ in shown],
        "reference": [mark.value for _, _, mark in shown],
        "low": [mark.value if mark.low is None else mark.low for _, _, mark in shown],
        "high": [mark.value if mark.high is None else mark.high for _, _, mark in shown],
        "label": [mark.label for _, _, mark in shown],
        "source": [mark.source for _, _, mark in shown],
        # Towards the middle, and below what is highest: the words must not run out of the chart.
        "rise": [10 if mark.value > 0.9 * top else -7 for _, _, mark in shown],
        "side": ["left" if 2 * names.index(name) < len(names) else "right" for name, _, _ in shown],
    }
    black = {"color": {"value": _INK}, "y": _quantity("reference")}
    yield _layer("rule", columns, {**black, "y": _quantity("low"), "y2": {"field": "high"}})
    about = {**black, "tooltip": _tooltip({"label": "reference", "source": "source"})}
    diamond = _layer("point", columns, about, shape="diamond", filled=True, size=45)
    diamond["mark"] |= {"stroke": "var(--paper)", "strokeWidth": 0.8}
    yield diamond
    if len(shown) <= _LABELLED:
        place = {"align": {"expr": "datum.side"}, "dy": {"expr": "datum.rise"}}
        words = _layer("text", columns, {**black, "text": {"field": "label"}})
        words["mark"] |= place
        yield words


def trigger_chart(
    scenarios: Mapping[str, Sequence[TriggerEncounter]], names: Sequence[str], limits: ValueLimits
) -> Chart:
    """Return speed and turning speed around one trigger with one SUT (figure 14).

    ``scenarios`` are the encounters of each, ``names`` all scenarios in the order of their colours.
    Means over the repeats, bands from the least to the most; dashed where the door stays as it is.
    """
    turning = (-limits.turning, limits.turning)
    return {
        "vconcat": [
            _trigger_panel("speed", "speed [m/s]", scenarios, names, (0.0, limits.speed)),
            _trigger_panel("turning", "turning [rad/s]", scenarios, names, turning),
        ],
        "spacing": 6,
        "params": _legend("scenario", "speed [m/s]", "turning [rad/s]"),
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
        # Only where every repeat has values: a mean that changes its number of runs jumps.
        shared = ~np.isnan(lines).any(axis=0)
        lines = lines[:, shared]
        fired = "yes" if encounters[0].fired else "no"
        bands = grid[shared], lines.mean(axis=0), lines.min(axis=0), lines.max(axis=0)
        rows += [(name, fired, *row) for row in np.column_stack(bands).tolist()]
    about = {
        "scenario": "scenario", "fires": "door is triggered", "time": "time from the trigger [s]",
        "mean": f"mean {title}", "low": "least", "high": "most",
    }  # fmt: skip
    columns = _columns(about, rows)
    upper = track == "speed"
    place = {
        "x": _quantity("time", "" if upper else about["time"], domain=(-BEFORE, AFTER)),
        "y": _quantity("mean", domain=values, axis=_AXIS),
    }
    colour = _colours("scenario", names, SERIES)
    dashes = {"domain": ["yes", "no"], "range": [[1, 0], [4, 2]]}
    dash = {"field": "fires", "type": "nominal", "legend": None, "scale": dashes}
    area = {**place, "y": {**place["y"], "field": "low"}, "y2": {"field": "high"}, "color": colour}
    line = {**place, "color": colour, "strokeDash": dash, "opacity": _legend_opacity(1.0)}
    return {
        "title": title,
        "width": _WIDTH,
        "height": 70,
        "data": table(columns),
        "layer": [
            _layer("area", None, {**area, "opacity": _legend_opacity(0.1, 0.0)}),
            _layer("line", None, line, name=title, strokeWidth=1.1),
            _layer("rule", {}, {"x": {"datum": 0}}, color=_INK, strokeDash=_DOTTED),
            _hover(title, place, about, ["scenario", "time"]),
        ],
    }


def _columns(names: Iterable[str], rows: Sequence[tuple[Any, ...]]) -> dict[str, list[Any]]:
    return {name: [row[place] for row in rows] for place, name in enumerate(names)}


def _layer(
    kind: str,
    columns: _Table | None,
    encoding: Chart,
    *,
    name: str = "",
    **look: Any,
) -> Chart:
    """Return a layer of marks of one ``kind`` and ``look``.

    It shows the rows of ``columns``, once what ``encoding`` says without columns, and with ``None``
    the rows of the whole chart.
    """
    layer: Chart = {"name": name} if name else {}
    if columns is not None:
        layer["data"] = table(columns) if columns else {"values": [{}]}
    return layer | {"mark": {"type": kind, **look}, "encoding": encoding}


def _quantity(field: str, title: str = "", *, domain: Any = None, **options: Any) -> Chart:
    if domain is not None:
        options["scale"] = {"domain": domain, "nice": False, "zero": False}
    return {"field": field, "type": "quantitative", "title": title or None, **options}


def _colours(field: str, names: Sequence[str], colours: Sequence[str]) -> Chart:
    scale = {"domain": names, "range": [colours[n % len(colours)] for n in range(len(names))]}
    # As many entries of the legend beside each other as their words leave room for.
    columns = max(_WIDTH // (5 * max(map(len, names)) + 28), 1)
    return {"field": field, "type": "nominal", "scale": scale, "legend": {"columns": columns}}


def _legend(field: str, *views: str) -> list[Chart]:
    """Return the parameter by which a click on an entry of the legend shows it alone."""
    select = {"type": "point", "fields": [field]}
    return [{"name": "legend", "select": select, "bind": "legend", "views": views}]


def _legend_opacity(opacity: float, other: float = 0.05) -> Chart:
    return {"condition": {"param": "legend", "value": opacity}, "value": other}


def _time_params(*views: str) -> list[Chart]:
    """Return parameters of charts over time: the span that is brushed, and that of another."""
    select = {"type": "interval", "encodings": ["x"]}
    return [
        {"name": "brush", "select": select, "views": views},
        {"name": "span", "value": [0, 0]},
    ]


def _tooltip(about: Mapping[str, str]) -> list[Chart]:
    return [{"field": field, "title": title} for field, title in about.items()]


def _hover(
    title: str,
    place: Chart,
    about: Mapping[str, str],
    fields: Sequence[str],
    *,
    clip: bool = False,
) -> Chart:
    """Return points of which the one nearest to the pointer is shown, with what it says."""
    near = {"type": "point", "on": "pointerover", "clear": "pointerout", "nearest": True}
    opacity = {"condition": {"param": "near", "empty": False, "value": 1}, "value": 0}
    encoding = {**place, "opacity": opacity, "tooltip": _tooltip(about)}
    layer = _layer(
        "circle", None, encoding, name=f"{HOVER} {title}", color=_INK, size=30, clip=clip
    )
    return layer | {"params": [{"name": "near", "select": {**near, "fields": fields}}]}


def _level(value: float, colour: str, dashes: Sequence[float] = ()) -> Chart:
    return _layer("rule", {}, {"y": {"datum": value}}, color=colour, strokeDash=dashes)


def _reference_lines(marks: Sequence[ReferenceMark]) -> list[Chart]:
    """Return reference values as broken lines from side to side, named above their right end."""
    if not marks:
        return []
    names: _Table = {"value": [m.value for m in marks], "label": [m.label for m in marks]}
    y = {"y": _quantity("value")}
    text = {**y, "text": {"field": "label"}, "x": {"value": "width"}}
    return [
        _layer("rule", names, y, color=_INK, strokeDash=_BROKEN, strokeWidth=0.8),
        _layer("text", names, text, align="right", dy=-4),
    ]
