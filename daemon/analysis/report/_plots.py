"""The figures of one cell (8, 10, 11 and 12 of the paper) and of a campaign (9, 13 and 14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from daemon.analysis.report._svg import (
    BAD,
    BODY,
    GOOD,
    INK,
    LINE,
    NEAR,
    RULE,
    SECOND,
    SERIES,
    SOFT,
    WALL,
    add_legend,
    escape_mathtext,
    new_figure,
    title_axes,
)
from daemon.analysis.report._tracks import AFTER, BEFORE, RunTracks, TriggerEncounter
from grammars.model.kinematics import object_rings, solid_rings
from grammars.model.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH: Final = 3.5
"""Width of a panel [inches]."""
REPEATS: Final = 10
"""Repeats drawn of one cell at most: the paper has five; more lines than this are one band."""
_CUT: Final = 0.3
"""Height [m] at which the map is cut: about where lasers look."""
_BINS: Final = 64


@dataclass(frozen=True, slots=True)
class PlotLimits:
    """What all panels of a scenario share, so that they can be compared: axis limits."""

    time: float
    error: float
    sigma: float
    clearance: float
    west: float
    south: float
    east: float
    north: float


def plot_limits(runs: Sequence[RunTracks]) -> PlotLimits:
    """Return limits that show everything of ``runs``."""
    xs = np.concatenate([r.x for r in runs])
    ys = np.concatenate([r.y for r in runs])
    margin = 1.0
    return PlotLimits(
        time=max(float(r.time[-1]) for r in runs),
        error=_top([r.error for r in runs]),
        sigma=_top([s for r in runs for s in (r.sigma_x, r.sigma_y)]),
        # Up to 2 m: in a hall the dips that matter would vanish at the bottom.
        clearance=min(max(_top([r.clearance for r in runs]), 0.3), 2.0),
        west=float(xs.min()) - margin,
        south=float(ys.min()) - margin,
        east=float(xs.max()) + margin,
        north=float(ys.max()) + margin,
    )


def _line_style(runs: Sequence[RunTracks]) -> dict[str, float]:
    """Return how to draw a line of one repeat, so that many of them stay apart."""
    return {"lw": 0.7, "alpha": 0.6} if len(runs) > 1 else {"lw": 1.0, "alpha": 1.0}


def _top(values: Sequence[Any]) -> float:
    known = [float(np.nanmax(v)) for v in values if not np.isnan(v).all()]
    return 1.05 * max(known, default=1.0) or 1.0


def plot_localisation(runs: Sequence[RunTracks], frame: PlotLimits, limit: float | None) -> Figure:
    """Return the localisation error and the spread of the estimate over time (figure 8)."""
    sheet, (above, below) = new_figure(WIDTH, 2.6, 2, 1, sharex=True)
    for run in runs[:REPEATS]:
        above.plot(run.time, run.error, color=LINE, **_line_style(runs))
        below.plot(run.time, run.sigma_x, color=LINE, **_line_style(runs))
        below.plot(run.time, run.sigma_y, color=SECOND, **_line_style(runs))
    top = frame.error
    # A limit far above the curve would press it flat against the axis.
    if limit is not None and limit < 4.0 * frame.error:
        above.axhline(limit, color=BAD, lw=0.9, ls=(0, (4, 3)))
        top = max(top, 1.1 * limit)
    above.set(xlim=(0.0, frame.time), ylim=(0.0, top))
    below.set(ylim=(0.0, frame.sigma), xlabel="time [s]")
    title_axes(above, "error [m]")
    title_axes(below, "spread [m]")
    below.plot([], [], color=LINE, lw=1.2, label="σ along x")
    below.plot([], [], color=SECOND, lw=1.2, label="σ along y")
    add_legend(below)
    return sheet


def plot_clearance(runs: Sequence[RunTracks], frame: PlotLimits) -> Figure:
    """Return the distance to the nearest obstacle over time, triggers dotted (figure 12)."""
    sheet, axes = new_figure(WIDTH, 1.9)
    limit = runs[0].limit
    low = min(-0.05, *(float(np.nanmin(r.clearance)) for r in runs if len(r.clearance)), 0.0)
    if limit > 0.0:
        axes.axhspan(min(low, 0.0), limit, color=NEAR, alpha=0.13, lw=0)
    axes.axhline(0.0, color=BAD, lw=0.9)
    for run in runs[:REPEATS]:
        axes.plot(run.time, run.clearance, color=LINE, **_line_style(runs))
        for encounter in run.encounters:
            if encounter.fired:
                axes.axvline(encounter.time, color=INK, lw=0.8, ls=":", alpha=0.6)
    axes.set(
        xlim=(0.0, frame.time),
        ylim=(low, frame.clearance),
        xlabel="time [s]",
    )
    title_axes(axes, "clearance [m]")
    return sheet


def plot_way(runs: Sequence[RunTracks], frame: PlotLimits, scene: Scene) -> Figure:
    """Return the ways driven on the map, coloured by the distance to obstacles (figure 10)."""
    wide, high = frame.east - frame.west, frame.north - frame.south
    sheet, axes = new_figure(WIDTH, min(max(WIDTH * high / wide, 1.2), 4.4), bare=True)
    draw_map(axes, scene, frame)
    limit = runs[0].limit if runs[0].limit > 0.0 else 0.2
    for run in runs[:REPEATS]:
        # Far, near, inside of the buffer, inside of the box around the footprint.
        for low, top, colour, lw in (
            (2.0 * limit, np.inf, LINE, 0.6),
            (limit, 2.0 * limit, GOOD, 0.8),
            (0.0, limit, NEAR, 1.2),
            (-np.inf, 0.0, BAD, 2.0),
        ):
            x, y = _way_pieces(run, (run.clearance >= low) & (run.clearance < top))
            axes.plot(x, y, color=colour, lw=lw, alpha=0.75)
    touched = [(x, y) for run in runs[:REPEATS] for _, _, x, y in run.contacts]
    if touched:
        axes.plot(*zip(*touched, strict=True), "x", color=BAD, ms=4.0, mew=1.1)
    axes.plot(runs[0].x[:1], runs[0].y[:1], "o", color=INK, ms=3.0)
    return sheet


def _way_pieces(run: RunTracks, shown: Any) -> tuple[Any, Any]:
    """Return the way where ``shown`` holds, and to the sample after it, with gaps of NaN."""
    drawn = shown.copy()
    drawn[1:] |= shown[:-1]
    return np.where(drawn, run.x, np.nan), np.where(drawn, run.y, np.nan)


def draw_map(axes: Axes, scene: Scene, frame: PlotLimits) -> None:
    """Draw what the scene has at laser height, doors as they start, within ``frame``."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    walls, things = solid_rings(scene, _CUT), object_rings(scene, _CUT)
    for rings, colour in ((walls, WALL), (things, SECOND)):
        near = [ring for ring in rings if _touches(ring, frame)]
        if near:
            outline = Outline.make_compound_path(
                *(Outline([*ring, ring[0]], closed=True) for ring in near)
            )
            axes.add_patch(PathPatch(outline, facecolor=colour, edgecolor=colour, lw=0.3))
    axes.set(xlim=(frame.west, frame.east), ylim=(frame.south, frame.north), aspect="equal")
    axes.grid(visible=False)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    _scale_bar(axes, frame)


def _scale_bar(axes: Axes, frame: PlotLimits) -> None:
    wide = frame.east - frame.west
    length = max(
        step for step in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0) if step <= wide / 4 or step == 0.5
    )
    left, low = frame.west + 0.02 * wide, frame.south + 0.02 * wide
    axes.plot([left, left + length], [low, low], color=INK, lw=1.6, solid_capstyle="butt")
    axes.text(left, low + 0.015 * wide, f"{length:g} m", color=SOFT, fontsize=6.5, va="bottom")


def _touches(ring: Any, frame: PlotLimits) -> bool:
    xs, ys = zip(*ring, strict=True)
    return bool(
        max(xs) >= frame.west
        and min(xs) <= frame.east
        and max(ys) >= frame.south
        and min(ys) <= frame.north
    )


def plot_buffer(runs: Sequence[RunTracks]) -> Figure:
    """Return where obstacles were inside the buffer, seen from the robot (figure 11)."""
    from matplotlib.patches import Polygon, Rectangle

    first = runs[0]
    sheet, axes = new_figure(2.3, 1.9)
    hx, hy = first.buffer
    reach = 1.12 * max(hx, hy)
    points = np.concatenate([run.inside for run in runs[:REPEATS]])
    if len(points):
        counts, _, _ = np.histogram2d(
            points[:, 0], points[:, 1], bins=_BINS, range=((-reach, reach), (-reach, reach))
        )
        # Roots, since a wall driven along has many times the counts of a corner passed.
        shown = np.ma.masked_equal(counts.T, 0.0)
        axes.imshow(
            np.sqrt(shown), extent=(-reach, reach, -reach, reach), origin="lower",
            cmap="YlOrRd", vmin=-0.4 * float(np.sqrt(shown.max())), interpolation="nearest",
        )  # fmt: skip
    axes.add_patch(Polygon(first.footprint, closed=True, fill=False, edgecolor=BODY, lw=1.2))
    axes.add_patch(
        Rectangle((-hx, -hy), 2 * hx, 2 * hy, fill=False, edgecolor=SOFT, lw=0.8, ls=(0, (4, 3)))
    )
    axes.annotate("", (0.6 * first.body[0], 0.0), (-0.3 * first.body[0], 0.0),
                  arrowprops={"arrowstyle": "->", "color": BODY, "lw": 1.0})  # fmt: skip
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="ahead [m]")
    title_axes(axes, "left [m]")
    axes.grid(color=RULE)
    return sheet


_STEP: Final = 0.2
_AROUND: Final = 30.0
"""Seconds before and after the largest error that are shown."""
_PEAK_MAP_HALF: Final = 6.0
"""Half the width of the map around it [m]."""


def plot_error_peak(run: RunTracks, limit: float | None) -> Figure:
    """Return the localisation error of a run around its peak (figure 9)."""
    peak = int(np.nanargmax(run.error))
    at = float(run.time[peak])
    sheet, axes = new_figure(WIDTH, 2.4)
    around = np.abs(run.time - at) <= _AROUND
    time = run.time[around]
    # Two deviations: the band that the paper's confidence oracle asks the true pose to be in.
    spread = 2.0 * np.hypot(run.sigma_x, run.sigma_y)[around]
    axes.fill_between(time, spread, color=SECOND, alpha=0.15, lw=0, label="2 σ")
    axes.plot(time, run.error[around], color=LINE, lw=1.2, label="error")
    axes.plot([at], [run.error[peak]], "o", color=BAD, ms=4.0)
    if limit is not None and limit < 4.0 * float(run.error[peak]):
        axes.axhline(limit, color=BAD, lw=0.9, ls=(0, (4, 3)), label="limit")
    axes.set(xlabel="time [s]", xlim=(time[0], time[-1]))
    axes.set_ylim(bottom=0.0)
    title_axes(axes, "error [m]")
    add_legend(axes)
    return sheet


def plot_peak_map(run: RunTracks, scene: Scene) -> Figure:
    """Return the map around the place with the largest localisation error of a run (figure 9)."""
    peak = int(np.nanargmax(run.error))
    x, y = float(run.x[peak]), float(run.y[peak])
    high = _PEAK_MAP_HALF * 2.2 / WIDTH
    sheet, axes = new_figure(WIDTH, 2.4)
    draw_map(
        axes,
        scene,
        PlotLimits(0, 0, 0, 0, x - _PEAK_MAP_HALF, y - high, x + _PEAK_MAP_HALF, y + high),
    )
    axes.plot(run.x, run.y, color=LINE, lw=0.9, alpha=0.8)
    large = run.error > 0.5 * run.error[peak]
    axes.plot(
        np.where(large, run.x, np.nan), np.where(large, run.y, np.nan), color=NEAR, lw=2.0,
        label="over half of the peak",
    )  # fmt: skip
    axes.plot([x], [y], "o", color=BAD, ms=4.0, label="largest error")
    add_legend(axes)
    return sheet


def plot_boxes(
    values: Sequence[tuple[str, Sequence[tuple[str, Sequence[float]]]]],
    suts: Sequence[str],
    axis: str,
) -> Figure:
    """Return boxplots of one measure, SUTs side by side for each scenario (figure 13).

    Boxes show the quartiles, whiskers everything, dots each repeat.
    """
    groups = len(values)
    sheet, axes = new_figure(WIDTH, 2.4)
    width = 0.8 / len(suts)
    for place, (_, cells) in enumerate(values):
        for sut, found in cells:
            if not found:
                continue
            index = list(suts).index(sut)
            colour = SERIES[index % len(SERIES)]
            x = place + (index - (len(suts) - 1) / 2.0) * width
            _draw_box(axes, x, np.asarray(found, dtype=np.float64), 0.36 * width, colour)
    axes.set_xticks(range(groups), [escape_mathtext(scenario) for scenario, _ in values])
    if max((len(s) for s, _ in values), default=0) * groups > 48:
        axes.tick_params(axis="x", labelrotation=25)
    axes.set_xlim(-0.6, groups - 0.4)
    title_axes(axes, axis)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    axes.grid(visible=False, axis="x")
    return sheet


def _draw_box(axes: Any, x: float, values: Any, half: float, colour: str) -> None:
    low, lower, median, upper, high = np.percentile(values, (0, 25, 50, 75, 100))
    axes.plot([x, x], [low, high], color=colour, lw=0.8)
    axes.fill_between([x - half, x + half], lower, upper, color=colour, alpha=0.25, lw=0)
    axes.plot([x - half, x + half], [median, median], color=colour, lw=1.4)
    axes.plot(np.full(len(values), x), values, "o", color=colour, ms=2.2, alpha=0.8, mew=0)


def plot_triggers(scenarios: Sequence[tuple[int, Sequence[TriggerEncounter]]]) -> Figure:
    """Return speed and turning speed around one trigger with one SUT (figure 14).

    ``scenarios`` are the numbers of their colours and what happened in each repeat. Means over the
    repeats, bands from the least to the most; dashed where the door stays as it is.
    """
    sheet, (above, below) = new_figure(3.5, 2.7, 2, 1, sharex=True)
    grid = np.arange(-BEFORE, AFTER + 0.5 * _STEP, _STEP)
    for number, found in scenarios:
        colour = SERIES[number % len(SERIES)]
        dashes = "-" if found[0].fired else (0, (4, 2))
        for axes, kind in ((above, "speed"), (below, "turning")):
            lines = np.stack([_resample(grid, p, kind) for p in found])
            known = ~np.isnan(lines).any(axis=0)
            # Only where every repeat has values: a mean that changes its number of runs jumps.
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
    title_axes(above, "speed [m/s]")
    title_axes(below, "turning [rad/s]")
    return sheet


def _resample(grid: Any, encounter: TriggerEncounter, kind: str) -> Any:
    values = encounter.speed if kind == "speed" else encounter.turning
    return np.interp(grid, encounter.since, values, left=np.nan, right=np.nan)
