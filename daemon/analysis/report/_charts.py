"""Charts of a report, each after a figure of the paper: of one cell, and of the whole campaign."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, TypeAlias

import numpy as np
import shapely

from daemon.analysis.charts import (
    AXIS,
    BAD,
    BODY,
    DASHED,
    DOTTED,
    HOVER,
    INK,
    LINE,
    NEAR,
    SECOND,
    SERIES,
    SOFT,
    WIDTH,
    Chart,
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
from daemon.analysis.report._data import ReportRun
from daemon.analysis.report._tracks import AFTER, BEFORE, TriggerEncounter
from daemon.model.assessments import ReferenceValue
from grammars.model.geometry import Floats

References: TypeAlias = Sequence[tuple[str, str, ReferenceValue]]
"""Reference values of one measure, each with its scenario and its SUT."""
_Row: TypeAlias = tuple[str, str, int, float]
"""Scenario, SUT, repeat, value."""

_STEP: Final = 0.2
"""Seconds between two values of a mean around a trigger."""
REPEATS: Final = 10
"""Most repeats drawn of one cell: the paper has five; more lines would merge into a band."""
_DEVIATION: Final = 0.5
"""Largest distance of a curve from its samples [px]."""
_HEAT: Final = ("#fed976", "#feb24c", "#fd8d3c", "#fc4e2a", "#e31a1c", "#bd0026", "#800026")
"""Colours from few to many returns: ColorBrewer's YlOrRd (Brewer, Harrower, 2003)."""
_BINS: Final = 64


Scales: TypeAlias = Mapping[str, tuple[float, float]]
"""Ends of the axis of each track, the same in all panels, so that heights can be compared."""


def shared_scales(runs: Sequence[ReportRun], limit: float | None) -> Scales:
    """Return scales that show all values of ``runs`` and, unless far above, the ``limit`` [m].

    A far limit of the localisation error would flatten all curves.
    """
    tracks = [run.tracks for run in runs]
    error = _top(one.error for one in tracks)
    if limit is not None and limit < 4.0 * error:
        error = max(error, 1.1 * limit)
    clearance = _finite(one.clearance for one in tracks)
    widest = max(1.05 * float(clearance.max(initial=0.0)), 0.3)
    turning = _top([[one.top_turning for one in tracks]])
    return {
        "error": (0.0, error),
        "spread": (0.0, _top(sigma for one in tracks for sigma in (one.sigma_x, one.sigma_y))),
        # At most 2 m: otherwise the important dips would vanish at the bottom in a hall.
        "clearance": (float(clearance.min(initial=-0.05)), min(widest, 2.0)),
        "speed": (0.0, _top([[one.top_speed for one in tracks]])),
        "turning": (-turning, turning),
    }


def _finite(tracks: Iterable[Any]) -> Floats:
    values: Floats = np.concatenate([np.empty(0), *tracks])
    return np.asarray(values[np.isfinite(values)])


def _top(tracks: Iterable[Any]) -> float:
    return 1.05 * float(_finite(tracks).max(initial=0.0)) or 1.0


def localisation_chart(
    runs: Sequence[ReportRun], end: float, scales: Scales, limit: float | None
) -> Chart:
    """Return the localisation error and the spread of the estimate up to ``end`` [s] (figure 8)."""
    time, error = (0.0, end), scales["error"]
    lines = [_level(limit, BAD, DASHED)] if limit is not None and limit < error[1] else []
    spread = {"σx": ("sigma_x", LINE), "σy": ("sigma_y", SECOND)}
    above = _panel("error [m]", runs, {"": ("error", LINE)}, time, error, lines, upper=True)
    return {
        "vconcat": [above, _panel("spread [m]", runs, spread, time, scales["spread"])],
        "resolve": {"legend": {"color": "independent"}, "scale": {"color": "independent"}},
        "spacing": 6,
        "params": _time_params("error [m]", "spread [m]") + legend("curve", "spread [m]"),
    }


def clearance_chart(runs: Sequence[ReportRun], end: float, scales: Scales) -> Chart:
    """Return the distance to obstacles up to ``end`` [s], triggers dotted (figure 12)."""
    values, buffer = scales["clearance"], runs[0].tracks.limit
    fired = [e.time for run in runs[:REPEATS] for e in run.tracks.encounters if e.fired]
    lines = [_level(0.0, BAD)]
    if buffer > 0.0:
        band = {"y": {"datum": values[0]}, "y2": {"datum": buffer}}
        lines.append(layer("rect", {}, band, color=NEAR, opacity=0.13))
    if fired:
        moments = {"x": quantity("time")}
        dotted = layer("rule", {"time": fired}, moments, color=INK, strokeDash=DOTTED)
        lines.append(dotted)
    curve = {"": ("clearance", LINE)}
    panel = _panel("clearance [m]", runs, curve, (0.0, end), values, lines)
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
    """Return a panel with ``curves`` of every run over ``time`` [s].

    A curve is the track and the colour of a name. ``values`` are the ends of the axis of values,
    ``lines`` are layers behind the curves. An ``upper`` panel leaves the title of the shared axis
    to the lower one.
    """
    height = 60 if upper or len(curves) == 2 else 105
    scale = np.array([WIDTH / (time[1] - time[0]), height / (values[1] - values[0])])
    rows = [
        (name, run.record.repeat, *sample)
        for run in runs[:REPEATS]
        for name, (track, _) in curves.items()
        for sample in _samples(run.tracks.time, getattr(run.tracks, track), time, scale)
    ]
    about = {"repeat": "repeat", "time": "time [s]", "value": title}
    place = {
        "x": quantity("time", "" if upper else about["time"], domain=time),
        "y": quantity("value", domain=values, axis=AXIS),
    }
    columns = columns_of(("curve", *about), rows)
    opacity = 0.6 if len(runs) > 1 else 1.0
    encoding = {**place, "detail": {"field": "repeat"}, "opacity": {"value": opacity}}
    if len(curves) == 1:
        columns.pop("curve", None)
        encoding["color"] = {"value": curves[""][1]}
    else:
        about = {"curve": "curve", **about}
        encoding["color"] = colours_of("curve", list(curves), [c for _, c in curves.values()])
        encoding["opacity"] = legend_opacity(opacity)
    clip = max((row[3] for row in rows), default=0.0) > values[1]
    begin = {"datum": {"expr": "span[0]"}, "type": "quantitative"}
    span = {"x": begin, "x2": {"datum": {"expr": "span[1]"}}}
    return {
        "title": title,
        "width": WIDTH,
        "height": height,
        "data": table(columns),
        "layer": [
            *lines,
            layer("line", None, encoding, name=title, clip=clip, strokeWidth=0.8),
            layer(
                "rect", {}, span, name=f"{HOVER} span {title}", color=LINE, opacity=0.12, clip=True
            ),
            hover_layer(title, place, about, ["repeat", "time"], clip=clip),
        ],
    }


def _samples(
    time: Any, values: Any, span: tuple[float, float], scale: Floats
) -> Iterator[tuple[float, float]]:
    """Yield the samples of a curve that change its look, and NaN in its gaps."""
    within = (time >= span[0]) & (time <= span[1])
    points = np.column_stack((time[within], values[within])).astype(np.float64)
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
    # Use roots: a wall beside the way has many times the returns of a single corner.
    levels = np.ceil(np.sqrt(counts / max(counts.max(), 1.0)) * len(_HEAT)).astype(int)
    cells = np.argwhere(levels)
    x, y = (cells * side - reach).T.tolist()
    count, level = (grid[tuple(cells.T)].tolist() for grid in (counts, levels))
    columns = {"x": x, "y": y, "returns": count, "level": level}
    scale = {"domain": list(range(1, 1 + len(_HEAT))), "range": _HEAT}
    encoding = {
        "x": quantity("x", "ahead [m]", domain=ends, axis={"tickCount": 5}),
        "y": quantity("y", domain=ends, axis=AXIS),
        "x2": {"field": "x2"},
        "y2": {"field": "y2"},
        "color": {"field": "level", "type": "ordinal", "legend": None, "scale": scale},
        "tooltip": quantity("returns"),
    }
    heat = layer("rect", columns, encoding)
    heat["transform"] = [{"calculate": f"datum.{a} + {side:.6g}", "as": f"{a}2"} for a in "xy"]
    box = [(-hx, -hy), (hx, -hy), (hx, hy), (-hx, hy), (-hx, -hy)]
    arrow = [(-ahead, 0), (ahead, 0), (0.8 * ahead, 0.1 * ahead), (ahead, 0)]
    footprint = [*first.footprint, first.footprint[0]]
    outlines = [_outline(footprint, BODY), _outline(arrow, BODY), _outline(box, SOFT, DASHED)]
    return {"title": "left [m]", "width": 170, "height": 170, "layer": [heat, *outlines]}


def _outline(
    points: Sequence[tuple[float, float]], colour: str, dashes: Sequence[float] = ()
) -> Chart:
    x, y = zip(*points, strict=True)
    place = {"x": quantity("x"), "y": quantity("y"), "order": {"field": "n"}}
    columns = {"x": x, "y": y, "n": range(len(x))}
    return layer("line", columns, place, color=colour, strokeWidth=1.2, strokeDash=dashes)


def _time_params(*views: str) -> list[Chart]:
    """Return parameters of charts over time: the span brushed here, and that of another chart."""
    select = {"type": "interval", "encodings": ["x"]}
    return [
        {"name": "brush", "select": select, "views": views},
        {"name": "span", "value": [0, 0]},
    ]


def _level(value: float, colour: str, dashes: Sequence[float] = ()) -> Chart:
    return layer("rule", {}, {"y": {"datum": value}}, color=colour, strokeDash=dashes)


def box_chart(
    rows: Sequence[_Row], systems: Sequence[str], title: str, references: References
) -> Chart:
    """Return boxplots of one measure by scenario, SUTs side by side (figure 13).

    ``systems`` are all SUTs, in the order of their colours. Boxes show the quartiles, whiskers
    everything, dots each repeat, diamonds ``references``.
    """
    columns = columns_of(("scenario", "SUT", "repeat", "value"), rows)
    names = list(dict.fromkeys(columns["scenario"]))
    is_long = max(map(len, names)) * len(names) > 48
    axis = {"labelAngle": -25 if is_long else 0, "title": None}
    # Begin at 0, unless that would hide a line at 0.
    scale = {"zero": min(columns["value"]) > 0.0, "nice": True}
    half, dark = {"fillOpacity": 0.3}, {"color": INK}
    boxes = layer("boxplot", None, {}, extent="min-max", box=half, median=dark, rule=dark)
    about = {"scenario": "scenario", "SUT": "SUT", "repeat": "repeat", "value": title}
    dots = layer("circle", None, {"tooltip": tooltip(about)}, name="dots", size=7)
    return {
        "title": title,
        "width": WIDTH,
        "height": 125,
        "params": legend("SUT", "dots"),
        "data": table(columns),
        "encoding": {
            "x": {"field": "scenario", "type": "nominal", "sort": names, "axis": axis},
            "xOffset": {"field": "SUT", "type": "nominal", "sort": systems},
            "y": quantity("value", axis=AXIS, scale=scale),
            "color": colours_of("SUT", systems, SERIES),
            "opacity": legend_opacity(1.0),
        },
        "layer": [boxes, dots, *_diamonds([one for one in references if one[0] in names])],
    }


def _diamonds(references: References) -> list[Chart]:
    """Return reference values with their deviation or range; the pointer shows their source."""
    if not references:
        return []
    fields = ("scenario", "SUT", "reference", "low", "high", "text", "source")
    columns = columns_of(fields, [
        (name, sut, one.value, *_ends(one), f"{one.name} {one.text}", one.source)
        for name, sut, one in references
    ])  # fmt: skip
    black = {"color": {"value": INK}}
    range_ = {**black, "y": quantity("low"), "y2": {"field": "high"}}
    words = tooltip({"text": "reference", "source": "source"})
    place = {**black, "y": quantity("reference"), "tooltip": words}
    look: Chart = {"shape": "diamond", "filled": True, "size": 45, "stroke": "var(--paper)"}
    return [layer("rule", columns, range_), layer("point", columns, place, **look)]


def _ends(reference: ReferenceValue) -> tuple[float | None, float | None]:
    """Return the ends of the deviation of a reference value, or of its range, if any."""
    if reference.deviation is None:
        return reference.low, reference.high
    return reference.value - reference.deviation, reference.value + reference.deviation


def trigger_chart(
    scenarios: Mapping[str, Sequence[TriggerEncounter]], names: Sequence[str], scales: Scales
) -> Chart:
    """Return speed and turning speed around one trigger with one SUT (figure 14).

    ``scenarios`` are the encounters of each, ``names`` all scenarios in the order of their colours.
    Lines are means over the repeats, bands go from the least to the greatest value. Lines are
    dashed if the door does not move.
    """
    titles = {"speed": "speed [m/s]", "turning": "turning [rad/s]"}
    return {
        "vconcat": [
            _trigger_panel(track, title, scenarios, names, scales[track])
            for track, title in titles.items()
        ],
        "spacing": 6,
        "params": legend("scenario", *titles.values()),
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
