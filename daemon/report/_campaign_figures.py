"""The figures over a whole campaign: figures 9, 13 and 14 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from daemon.report._cell_figures import WIDTH, Frame, draw_map
from daemon.report._passing import AFTER, BEFORE
from daemon.report._svg import (
    BAD,
    INK,
    LINE,
    NEAR,
    SECOND,
    SERIES,
    figure,
    legend,
    named,
    plain,
    to_svg,
)
from daemon.report._types import Driven, Passing
from grammars.scene import Scene

_STEP: Final = 0.2
_AROUND: Final = 30.0
"""Seconds before and after the largest error that are shown."""
_NEAR: Final = 6.0
"""Half the width of the map around it [m]."""


def error_peak(name: str, label: str, run: Driven, limit: float | None) -> str:
    """Return the localisation error of a run around its peak (figure 9)."""
    peak = int(np.nanargmax(run.error))
    at = float(run.time[peak])
    sheet, axes = figure(WIDTH, 2.4)
    around = np.abs(run.time - at) <= _AROUND
    time = run.time[around]
    spread = 2.0 * np.hypot(run.sigma_x, run.sigma_y)[around]
    axes.fill_between(time, spread, color=SECOND, alpha=0.15, lw=0, label="2 σ")
    axes.plot(time, run.error[around], color=LINE, lw=1.2, label="error")
    axes.plot([at], [run.error[peak]], "o", color=BAD, ms=4.0)
    if limit is not None and limit < 4.0 * float(run.error[peak]):
        axes.axhline(limit, color=BAD, lw=0.9, ls=(0, (4, 3)), label="limit")
    axes.set(xlabel="time [s]", xlim=(time[0], time[-1]))
    axes.set_ylim(bottom=0.0)
    named(axes, "error [m]")
    legend(axes)
    return to_svg(sheet, name, label)


def peak_on_map(name: str, label: str, run: Driven, scene: Scene) -> str:
    """Return the map around the place with the largest localisation error of a run (figure 9)."""
    peak = int(np.nanargmax(run.error))
    x, y = float(run.x[peak]), float(run.y[peak])
    high = _NEAR * 2.2 / WIDTH
    sheet, axes = figure(WIDTH, 2.4)
    draw_map(axes, scene, Frame(0, 0, 0, 0, x - _NEAR, y - high, x + _NEAR, y + high))
    axes.plot(run.x, run.y, color=LINE, lw=0.9, alpha=0.8)
    large = run.error > 0.5 * run.error[peak]
    axes.plot(
        np.where(large, run.x, np.nan), np.where(large, run.y, np.nan), color=NEAR, lw=2.0,
        label="over half of the peak",
    )  # fmt: skip
    axes.plot([x], [y], "o", color=BAD, ms=4.0, label="largest error")
    legend(axes)
    return to_svg(sheet, name, label)


def boxes(
    name: str,
    label: str,
    values: Sequence[tuple[str, Sequence[tuple[str, Sequence[float]]]]],
    suts: Sequence[str],
    axis: str,
) -> str:
    """Return boxplots of one measure, SUTs side by side for each scenario (figure 13).

    Boxes show the quartiles, whiskers everything, dots each repeat.
    """
    groups = len(values)
    sheet, axes = figure(WIDTH, 2.4)
    width = 0.8 / len(suts)
    for place, (_, cells) in enumerate(values):
        for sut, found in cells:
            if not found:
                continue
            index = list(suts).index(sut)
            colour = SERIES[index % len(SERIES)]
            x = place + (index - (len(suts) - 1) / 2.0) * width
            _box(axes, x, np.asarray(found, dtype=np.float64), 0.36 * width, colour)
    axes.set_xticks(range(groups), [plain(scenario) for scenario, _ in values])
    if max((len(s) for s, _ in values), default=0) * groups > 48:
        axes.tick_params(axis="x", labelrotation=25)
    axes.set_xlim(-0.6, groups - 0.4)
    named(axes, axis)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    axes.grid(visible=False, axis="x")
    return to_svg(sheet, name, label)


def _box(axes: Any, x: float, values: Any, half: float, colour: str) -> None:
    low, lower, median, upper, high = np.percentile(values, (0, 25, 50, 75, 100))
    axes.plot([x, x], [low, high], color=colour, lw=0.8)
    axes.fill_between([x - half, x + half], lower, upper, color=colour, alpha=0.25, lw=0)
    axes.plot([x - half, x + half], [median, median], color=colour, lw=1.4)
    axes.plot(np.full(len(values), x), values, "o", color=colour, ms=2.2, alpha=0.8, mew=0)


def around_triggers(
    name: str, label: str, scenarios: Sequence[tuple[int, Sequence[Passing]]]
) -> str:
    """Return speed and turning speed around one trigger with one SUT (figure 14).

    ``scenarios`` are the numbers of their colours and what happened in each repeat. Means over the
    repeats, bands from the least to the most; dashed where the door stays as it is.
    """
    sheet, (above, below) = figure(3.5, 2.7, 2, 1, sharex=True)
    grid = np.arange(-BEFORE, AFTER + 0.5 * _STEP, _STEP)
    for number, found in scenarios:
        colour = SERIES[number % len(SERIES)]
        dashes = "-" if found[0].fired else (0, (4, 2))
        for axes, kind in ((above, "speed"), (below, "turning")):
            lines = np.stack([_on(grid, p, kind) for p in found])
            known = ~np.isnan(lines).any(axis=0)
            lines = lines[:, known]
            if not known.any():
                continue
            axes.fill_between(grid[known], lines.min(axis=0), lines.max(axis=0), color=colour,
                              alpha=0.1, lw=0)  # fmt: skip
            axes.plot(grid[known], lines.mean(axis=0), color=colour, lw=1.0, ls=dashes)
    for axes in (above, below):
        axes.axvline(0.0, color=INK, lw=0.8, ls=":")
    above.set_xlim(-BEFORE, AFTER)
    above.set_ylim(bottom=0.0)
    below.set_xlabel("time from the trigger [s]")
    named(above, "speed [m/s]")
    named(below, "turning [rad/s]")
    return to_svg(sheet, name, label)


def _on(grid: Any, passing: Passing, kind: str) -> Any:
    values = passing.speed if kind == "speed" else passing.turning
    return np.interp(grid, passing.since, values, left=np.nan, right=np.nan)
