"""Charts of one cell: localisation (figures 8 and 9 of the paper), clearance (12), returns (11)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

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
    SOFT,
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
)
from daemon.analysis.report._data import ReferenceMark, ReportRun
from grammars.model.geometry import Floats

REPEATS: Final = 10
"""Most repeats drawn of one cell: the paper has five; more lines would merge into a band."""
_DEVIATION: Final = 0.5
"""Largest distance of a curve from its samples [px]."""
_BROKEN: Final = [6, 2, 1.5, 2]
_HEAT: Final = ("#fed976", "#feb24c", "#fd8d3c", "#fc4e2a", "#e31a1c", "#bd0026", "#800026")
"""Colours from few to many returns: ColorBrewer's YlOrRd (Brewer, Harrower, 2003)."""
_BINS: Final = 64
_AROUND: Final = 30.0
"""Time shown before and after the largest error [s]."""


@dataclass(frozen=True, slots=True)
class ValueLimits:
    """Ends of the axes of values, shared by all panels of a kind, so that heights can be compared.

    ``error`` and ``spread`` [m], ``speed`` [m/s] and ``turning`` [rad/s] are the largest values.
    ``clearance`` is the range from the first to the second value [m].
    """

    error: float
    spread: float
    clearance: tuple[float, float]
    speed: float
    turning: float


def value_limits(runs: Sequence[ReportRun], errors: Iterable[float]) -> ValueLimits:
    """Return limits that show all values of ``runs`` and the marked ``errors`` [m].

    An error far above all runs is left out, since it would flatten their curves.
    """
    tracks = [run.tracks for run in runs]
    top = _top(run.error for run in tracks)
    clearance = _finite(run.clearance for run in tracks)
    widest = max(1.05 * float(clearance.max(initial=0.0)), 0.3)
    return ValueLimits(
        error=max([top, *(1.1 * error for error in errors if error < 4.0 * top)]),
        spread=_top(values for run in tracks for values in (run.sigma_x, run.sigma_y)),
        # At most 2 m: otherwise the important dips would vanish at the bottom in a hall.
        clearance=(float(clearance.min(initial=-0.05)), min(widest, 2.0)),
        speed=1.05 * max((run.top_speed for run in tracks), default=0.0) or 1.0,
        turning=1.05 * max((run.top_turning for run in tracks), default=0.0) or 1.0,
    )


def _finite(tracks: Iterable[Any]) -> Floats:
    values: Floats = np.concatenate([np.empty(0), *tracks])
    return np.asarray(values[np.isfinite(values)])


def _top(tracks: Iterable[Any]) -> float:
    return 1.05 * float(_finite(tracks).max(initial=0.0)) or 1.0


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
        lines.append(_level(limit, BAD, DASHED))
    spread = {"σx": ("sigma_x", LINE), "σy": ("sigma_y", SECOND)}
    above = _panel("error [m]", runs, {"": ("error", LINE)}, time, (0.0, top), lines, upper=True)
    return {
        "vconcat": [above, _panel("spread [m]", runs, spread, time, (0.0, limits.spread))],
        "resolve": {"legend": {"color": "independent"}, "scale": {"color": "independent"}},
        "spacing": 6,
        "params": _time_params("error [m]", "spread [m]") + legend("curve", "spread [m]"),
    }


def peak_chart(run: ReportRun, limit: float | None) -> Chart:
    """Return the localisation error of a run around its peak (figure 9)."""
    tracks = run.tracks
    peak = int(np.nanargmax(tracks.error))
    at, value = float(tracks.time[peak]), float(tracks.error[peak])
    time = max(at - _AROUND, 0.0), min(at + _AROUND, float(tracks.time[-1]))
    curves = {"error": ("error", LINE), "σx": ("sigma_x", SECOND), "σy": ("sigma_y", SOFT)}
    around = (tracks.time >= time[0]) & (tracks.time <= time[1])
    values = [getattr(tracks, name)[around] for name, _ in curves.values()]
    dot = layer("circle", {}, {"x": {"datum": at}, "y": {"datum": value}}, color=BAD, size=40)
    lines = [dot]
    if limit is not None and limit < 4.0 * value:
        lines.append(_level(limit, BAD, DASHED))
        values.append(np.array([limit]))
    panel = _panel("error [m]", [run], curves, time, (0.0, _top(values)), lines)
    return panel | {"params": _time_params("error [m]") + legend("curve", "error [m]")}


def clearance_chart(
    runs: Sequence[ReportRun], end: float, limits: ValueLimits, marks: Sequence[ReferenceMark]
) -> Chart:
    """Return the distance to obstacles up to ``end`` [s], triggers dotted (figure 12)."""
    low, high = limits.clearance
    buffer = runs[0].tracks.limit
    fired = [e.time for run in runs[:REPEATS] for e in run.tracks.encounters if e.fired]
    lines = [_level(0.0, BAD), *_reference_lines([mark for mark in marks if mark.value < high])]
    if buffer > 0.0:
        band = {"y": {"datum": low}, "y2": {"datum": buffer}}
        lines.append(layer("rect", {}, band, color=NEAR, opacity=0.13))
    if fired:
        moments = {"x": quantity("time")}
        dotted = layer("rule", {"time": fired}, moments, color=INK, strokeDash=DOTTED)
        lines.append(dotted)
    curve = {"": ("clearance", LINE)}
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


def _reference_lines(marks: Sequence[ReferenceMark]) -> list[Chart]:
    """Return reference values as broken horizontal lines, named above their right end."""
    if not marks:
        return []
    names: Table = {"value": [m.value for m in marks], "label": [m.label for m in marks]}
    y = {"y": quantity("value")}
    text = {**y, "text": {"field": "label"}, "x": {"value": "width"}}
    return [
        layer("rule", names, y, color=INK, strokeDash=_BROKEN, strokeWidth=0.8),
        layer("text", names, text, align="right", dy=-4),
    ]


def _level(value: float, colour: str, dashes: Sequence[float] = ()) -> Chart:
    return layer("rule", {}, {"y": {"datum": value}}, color=colour, strokeDash=dashes)
