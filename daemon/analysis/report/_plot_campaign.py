"""The figures of a campaign: largest errors (9 of the paper), measures (13) and triggers (14)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, Literal

import numpy as np

from daemon.analysis.report._axes import Axes, Sheet
from daemon.analysis.report._plots import (
    CUT,
    DASHED,
    DOTTED,
    WIDTH,
    PlotLimits,
    draw_map,
    draw_reference,
    plot_limits,
    plot_localisation,
)
from daemon.analysis.report._references import ReferenceMark
from daemon.analysis.report._svg import BAD, INK, LINE, NEAR, SECOND, SERIES, SOFT
from daemon.analysis.report._tracks import AFTER, BEFORE, RunTracks, TriggerEncounter
from grammars.model.kinematics import solid_rings
from grammars.model.scene import Scene

_STEP: Final = 0.2
_AROUND: Final = 30.0
"""Seconds before and after the largest error that are shown."""
_PEAK_MAP_HALF: Final = 6.0
"""Half the width of the map around it [m]."""


def plot_error_overview(run: RunTracks, limit: float | None) -> Sheet:
    """Return error and spread of a whole run, what :func:`plot_error_peak` shows of it in grey."""
    peak = float(run.time[int(np.nanargmax(run.error))])
    frame = plot_limits([run], [] if limit is None else [limit])
    sheet = plot_localisation([run], frame, limit)
    for axes in sheet.axes:
        axes.column(peak - _AROUND, peak + _AROUND, SOFT, 0.16)
    return sheet


def plot_error_peak(run: RunTracks, limit: float | None) -> Sheet:
    """Return the localisation error of a run around its peak (figure 9)."""
    peak = int(np.nanargmax(run.error))
    at = float(run.time[peak])
    sheet = Sheet(WIDTH, 2.4)
    (axes,) = sheet.axes
    around = np.abs(run.time - at) <= _AROUND
    time = run.time[around]
    axes.line(time, run.sigma_x[around], SECOND, 0.9, dashes="2 1.5", label="σ along x")
    axes.line(time, run.sigma_y[around], SECOND, 0.9, label="σ along y")
    axes.line(time, run.error[around], LINE, 1.2, label="error")
    axes.dots([at], [run.error[peak]], BAD, 4.0)
    if limit is not None and limit < 4.0 * float(run.error[peak]):
        axes.across(limit, BAD, 0.9, dashes=DASHED, label="limit")
    axes.x_limits, axes.y_limits = (float(time[0]), float(time[-1])), (0.0, None)
    axes.title, axes.x_label = "error [m]", "time [s]"
    return sheet


def _inside(at: float, low: float, high: float, half: float) -> float:
    """Return the middle of what reaches ``half`` to both sides, moved to where ``low`` to ``high``
    fills it.
    """
    low, high = min(low, at) + half, max(high, at) - half
    return min(max(at, low), high) if low < high else (low + high) / 2.0


def plot_peak_map(run: RunTracks, scene: Scene) -> Sheet:
    """Return the map around the place with the largest localisation error of a run (figure 9)."""
    peak = int(np.nanargmax(run.error))
    x, y = float(run.x[peak]), float(run.y[peak])
    half, high = _PEAK_MAP_HALF, _PEAK_MAP_HALF * 2.2 / WIDTH
    corners = np.array([corner for ring in solid_rings(scene, CUT) for corner in ring])
    # Not beyond the building, where there is nothing to be seen.
    middle = [
        _inside(at, part.min(initial=at), part.max(initial=at), room)
        for at, part, room in zip((x, y), corners.reshape(-1, 2).T, (half, high), strict=True)
    ]
    sheet = Sheet(WIDTH, 2.4)
    (axes,) = sheet.axes
    around = replace(
        plot_limits([run]),
        west=middle[0] - half,
        south=middle[1] - high,
        east=middle[0] + half,
        north=middle[1] + high,
    )
    draw_map(axes, scene, around)
    axes.line(run.x, run.y, LINE, 0.9, alpha=0.8)
    large = run.error > 0.5 * run.error[peak]
    axes.line(
        np.where(large, run.x, np.nan), np.where(large, run.y, np.nan), NEAR, 2.0,
        label="over half of the peak",
    )  # fmt: skip
    axes.dots([x], [y], BAD, 4.0, label="largest error")
    return sheet


_LABELLED: Final = 4
"""Reference values of one figure that are named in it at most; of more the page has a table."""


def plot_boxes(
    values: Sequence[tuple[str, Sequence[tuple[str, Sequence[float]]]]],
    suts: Sequence[str],
    axis: str,
    marks: Mapping[tuple[str, str], Sequence[ReferenceMark]],
) -> Sheet:
    """Return boxplots of one measure, SUTs side by side for each scenario (figure 13).

    Boxes show the quartiles, whiskers everything, dots each repeat, diamonds reference values.
    """
    groups = len(values)
    sheet = Sheet(WIDTH, 2.4)
    (axes,) = sheet.axes
    width = 0.8 / len(suts)
    everything = [value for _, cells in values for _, found in cells for value in found]
    # Few enough to be read beside each other.
    labelled = sum(map(len, marks.values())) <= _LABELLED
    for place, (scenario, cells) in enumerate(values):
        for sut, found in cells:
            if not found:
                continue
            index = list(suts).index(sut)
            colour = SERIES[index % len(SERIES)]
            x = place + (index - (len(suts) - 1) / 2.0) * width
            _draw_box(axes, x, np.asarray(found, dtype=np.float64), 0.36 * width, colour)
            for reference in marks.get((scenario, sut), ()):
                side: Literal["start", "end"] = "start" if 2 * place < groups else "end"
                draw_reference(axes, x, reference, label=side if labelled else "")
    # From 0 on, unless that would hide a line at 0.
    lowest = 0.0 if min(everything) > 0.0 else None
    axes.x_names = [scenario for scenario, _ in values]
    axes.turned_names = max((len(s) for s, _ in values), default=0) * groups > 48
    axes.x_limits, axes.y_limits = (-0.6, groups - 0.4), (lowest, None)
    axes.title = axis
    return sheet


def _draw_box(axes: Axes, x: float, values: Any, half: float, colour: str) -> None:
    low, lower, median, upper, high = np.percentile(values, (0, 25, 50, 75, 100))
    axes.line([x, x], [low, high], colour, 0.8)
    axes.area([x - half, x + half], lower, upper, colour, 0.25)
    axes.line([x - half, x + half], [median, median], colour, 1.4)
    axes.dots(np.full(len(values), x), values, colour, 2.2, alpha=0.8)


def plot_triggers(
    scenarios: Sequence[tuple[int, Sequence[TriggerEncounter]]], frame: PlotLimits
) -> Sheet:
    """Return speed and turning speed around one trigger with one SUT (figure 14).

    ``scenarios`` are the numbers of their colours and what happened in each repeat. Means over the
    repeats, bands from the least to the most; dashed where the door stays as it is.
    """
    sheet = Sheet(3.5, 2.7, 2)
    above, below = sheet.axes
    grid = np.arange(-BEFORE, AFTER + 0.5 * _STEP, _STEP)
    for number, found in scenarios:
        colour = SERIES[number % len(SERIES)]
        dashes = "" if found[0].fired else "4 2"
        for axes, kind in ((above, "speed"), (below, "turning")):
            lines = np.stack([_resample(grid, p, kind) for p in found])
            known = ~np.isnan(lines).any(axis=0)
            # Only where every repeat has values: a mean that changes its number of runs jumps.
            lines = lines[:, known]
            if not known.any():
                continue
            axes.area(grid[known], lines.min(axis=0), lines.max(axis=0), colour, 0.1)
            axes.line(grid[known], lines.mean(axis=0), colour, 1.0, dashes=dashes)
    for axes in (above, below):
        axes.upright(0.0, INK, 0.8, dashes=DOTTED)
        axes.x_limits = (-BEFORE, AFTER)
    above.y_limits, below.y_limits = (0.0, frame.speed), (-frame.turning, frame.turning)
    above.title, below.title = "speed [m/s]", "turning [rad/s]"
    below.x_label = "time from the trigger [s]"
    return sheet


def _resample(grid: Any, encounter: TriggerEncounter, kind: str) -> Any:
    values = encounter.speed if kind == "speed" else encounter.turning
    return np.interp(grid, encounter.since, values, left=np.nan, right=np.nan)
