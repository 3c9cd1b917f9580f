"""The figures of one cell (8, 10, 11 and 12 of the paper), and what all figures share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np

from daemon.analysis.report._axes import Axes, Sheet
from daemon.analysis.report._references import ReferenceMark
from daemon.analysis.report._svg import BAD, BODY, GOOD, INK, LINE, NEAR, SECOND, SOFT, WALL
from daemon.analysis.report._tracks import RunTracks
from grammars.model.kinematics import object_rings, solid_rings
from grammars.model.scene import Scene

WIDTH: Final = 3.5
"""Width of a panel [inches]."""
REPEATS: Final = 10
"""Repeats drawn of one cell at most: the paper has five; more lines than this are one band."""
CUT: Final = 0.3
"""Height [m] at which the map is cut: about where lasers look."""
_BINS: Final = 64
DASHED: Final = "4 3"
DOTTED: Final = "1 1.6"
_BROKEN: Final = "6 2 1.5 2"
_HEAT: Final = ("#fed976", "#feb24c", "#fd8d3c", "#fc4e2a", "#e31a1c", "#bd0026", "#800026")
"""From few to many: the colours of ColorBrewer's YlOrRd (Brewer, Harrower, 2003)."""


@dataclass(frozen=True, slots=True)
class PlotLimits:
    """What panels share that are compared: axis limits, and the part of the map.

    ``clearance`` goes from the first to the second [m]; ``speed`` [m/s] and ``turning`` [rad/s] are
    the largest there are.
    """

    time: float
    error: float
    sigma: float
    clearance: tuple[float, float]
    speed: float
    turning: float
    west: float
    south: float
    east: float
    north: float


def plot_limits(runs: Sequence[RunTracks], errors: Sequence[float] = ()) -> PlotLimits:
    """Return limits that show everything of ``runs``, and ``errors`` [m] that are marked."""
    xs = np.concatenate([r.x for r in runs])
    ys = np.concatenate([r.y for r in runs])
    margin = 1.0
    return PlotLimits(
        time=max(float(r.time[-1]) for r in runs),
        error=room_for(_top([r.error for r in runs]), errors),
        sigma=_top([s for r in runs for s in (r.sigma_x, r.sigma_y)]),
        # Up to 2 m: in a hall the dips that matter would vanish at the bottom.
        clearance=(
            min([-0.05, *(float(np.nanmin(r.clearance)) for r in runs if _is_known(r.clearance))]),
            min(max(_top([r.clearance for r in runs]), 0.3), 2.0),
        ),
        speed=1.05 * max(r.top_speed for r in runs) or 1.0,
        turning=1.05 * max(r.top_turning for r in runs) or 1.0,
        west=float(xs.min()) - margin,
        south=float(ys.min()) - margin,
        east=float(xs.max()) + margin,
        north=float(ys.max()) + margin,
    )


def panel_limits(whole: PlotLimits, part: PlotLimits) -> PlotLimits:
    """Return the limits of the panels of a scenario: values as in all others, its own time and map.

    Panels are compared across systems and across scenarios: a curve that is twice as high is twice
    as much. A scenario that takes ten minutes and one that takes half of one have each their width.
    """
    return replace(
        whole,
        time=part.time,
        west=part.west,
        south=part.south,
        east=part.east,
        north=part.north,
    )


def room_for(top: float, values: Sequence[float]) -> float:
    """Return the upper end of an axis with room for ``values`` above ``top``.

    Not for those far above: they would press the curves flat against the axis.
    """
    return max([top, *(1.1 * value for value in values if value < 4.0 * top)])


def _is_known(values: Any) -> bool:
    return bool(len(values)) and not np.isnan(values).all()


def _line_look(runs: Sequence[RunTracks]) -> tuple[float, float]:
    """Return width and opacity of a line of one repeat, so that many of them stay apart."""
    return (0.7, 0.6) if len(runs) > 1 else (1.0, 1.0)


def _top(values: Sequence[Any]) -> float:
    known = [float(np.nanmax(v)) for v in values if _is_known(v)]
    return 1.05 * max(known, default=1.0) or 1.0


def draw_reference(
    axes: Axes, x: float, found: ReferenceMark, *, label: Literal["", "start", "end"], rise: int = 0
) -> None:
    """Draw a reference value as a diamond at ``x``, with its deviation or range.

    With a ``label`` it is named above, on so many lines higher as ``rise`` says.
    """
    if found.low is not None and found.high is not None:
        axes.line([x, x], [found.low, found.high], INK, 0.9)
    axes.diamonds([x], [found.value], INK, 5.5, about=f"{found.label}, {found.source}")
    if label:
        shift = (-3.0 if label == "start" else 3.0, 5.0 + 7.5 * rise)
        axes.words(x, found.value, found.label, colour=INK, anchor=label, shift=shift, halo=True)


def _draw_reference_lines(axes: Axes, marks: Sequence[ReferenceMark], top: float) -> None:
    """Draw reference values up to ``top`` as lines from side to side."""
    for found in marks:
        if found.value < top:
            axes.across(found.value, INK, 0.8, dashes=_BROKEN, label=found.label)


def plot_localisation(
    runs: Sequence[RunTracks],
    frame: PlotLimits,
    limit: float | None,
    marks: Sequence[ReferenceMark] = (),
) -> Sheet:
    """Return the localisation error and the spread of the estimate over time (figure 8)."""
    sheet = Sheet(WIDTH, 2.6, 2)
    above, below = sheet.axes
    width, alpha = _line_look(runs)
    for run in runs[:REPEATS]:
        above.line(run.time, run.error, LINE, width, alpha=alpha)
        below.line(run.time, run.sigma_x, LINE, width, alpha=alpha)
        below.line(run.time, run.sigma_y, SECOND, width, alpha=alpha)
    if limit is not None and limit < frame.error:
        above.across(limit, BAD, 0.9, dashes=DASHED)
    _draw_reference_lines(above, marks, frame.error)
    above.x_limits = below.x_limits = (0.0, frame.time)
    above.y_limits, below.y_limits = (0.0, frame.error), (0.0, frame.sigma)
    above.title, below.title, below.x_label = "error [m]", "spread [m]", "time [s]"
    below.legend_only("σ along x", LINE)
    below.legend_only("σ along y", SECOND)
    return sheet


def plot_clearance(
    runs: Sequence[RunTracks], frame: PlotLimits, marks: Sequence[ReferenceMark] = ()
) -> Sheet:
    """Return the distance to the nearest obstacle over time, triggers dotted (figure 12)."""
    sheet = Sheet(WIDTH, 1.9)
    (axes,) = sheet.axes
    limit = runs[0].limit
    low, high = frame.clearance
    if limit > 0.0:
        axes.band(low, limit, NEAR, 0.13)
    axes.across(0.0, BAD, 0.9)
    width, alpha = _line_look(runs)
    for run in runs[:REPEATS]:
        axes.line(run.time, run.clearance, LINE, width, alpha=alpha)
        for encounter in run.encounters:
            if encounter.fired:
                axes.upright(encounter.time, INK, 0.8, dashes=DOTTED, alpha=0.6)
    _draw_reference_lines(axes, marks, high)
    axes.x_limits, axes.y_limits = (0.0, frame.time), (low, high)
    axes.title, axes.x_label = "clearance [m]", "time [s]"
    return sheet


def plot_way(runs: Sequence[RunTracks], frame: PlotLimits, scene: Scene) -> Sheet:
    """Return the ways driven on the map, coloured by the distance to obstacles (figure 10)."""
    wide, high = frame.east - frame.west, frame.north - frame.south
    sheet = Sheet(WIDTH, min(max(WIDTH * high / wide, 1.2), 4.4), bare=True)
    (axes,) = sheet.axes
    draw_map(axes, scene, frame)
    limit = runs[0].limit if runs[0].limit > 0.0 else 0.2
    for run in runs[:REPEATS]:
        # Far, near, inside of the buffer, inside of the box around the footprint.
        for low, top, colour, width in (
            (2.0 * limit, np.inf, LINE, 0.6),
            (limit, 2.0 * limit, GOOD, 0.8),
            (0.0, limit, NEAR, 1.2),
            (-np.inf, 0.0, BAD, 2.0),
        ):
            x, y = _way_pieces(run, (run.clearance >= low) & (run.clearance < top))
            axes.line(x, y, colour, width, alpha=0.75)
    touched = [(x, y) for run in runs[:REPEATS] for _, _, x, y in run.contacts]
    if touched:
        xs, ys = zip(*touched, strict=True)
        axes.crosses(xs, ys, BAD, 4.0)
    axes.dots(runs[0].x[:1], runs[0].y[:1], INK, 3.0)
    nearest = min(runs, key=lambda run: float(np.nanmin(run.clearance)))
    at = int(np.nanargmin(nearest.clearance))
    x, y = float(nearest.x[at]), float(nearest.y[at])
    axes.diamonds([x], [y], INK, 5.0)
    # Towards the middle, so that the words do not run out of the picture.
    side: Literal["start", "end"] = "start" if 2.0 * x < frame.west + frame.east else "end"
    words = f"{float(nearest.clearance[at]):.3f} m".replace("-", "−")
    shift = (5.0 if side == "start" else -5.0, -2.0)
    axes.words(x, y, words, colour=INK, anchor=side, shift=shift, halo=True)
    return sheet


def _way_pieces(run: RunTracks, shown: Any) -> tuple[Any, Any]:
    """Return the way where ``shown`` holds, and to the sample after it, with gaps of NaN."""
    drawn = shown.copy()
    drawn[1:] |= shown[:-1]
    return np.where(drawn, run.x, np.nan), np.where(drawn, run.y, np.nan)


def draw_map(axes: Axes, scene: Scene, frame: PlotLimits) -> None:
    """Draw what the scene has at laser height, doors as they start, within ``frame``."""
    walls, things = solid_rings(scene, CUT), object_rings(scene, CUT)
    for rings, colour in ((walls, WALL), (things, SECOND)):
        near = [ring for ring in rings if _touches(ring, frame)]
        if near:
            axes.shapes(near, fill=colour, edge=colour, width=0.3)
    axes.x_limits, axes.y_limits = (frame.west, frame.east), (frame.south, frame.north)
    axes.equal = axes.bare = True
    _scale_bar(axes, frame)


def _scale_bar(axes: Axes, frame: PlotLimits) -> None:
    wide = frame.east - frame.west
    length = max(
        step for step in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0) if step <= wide / 4 or step == 0.5
    )
    left, low = frame.west + 0.02 * wide, frame.south + 0.02 * wide
    axes.line([left, left + length], [low, low], INK, 1.6, flat=True)
    axes.words(left, low + 0.015 * wide, f"{length:g} m", colour=INK, halo=True)


def _touches(ring: Any, frame: PlotLimits) -> bool:
    xs, ys = zip(*ring, strict=True)
    return bool(
        max(xs) >= frame.west
        and min(xs) <= frame.east
        and max(ys) >= frame.south
        and min(ys) <= frame.north
    )


def plot_buffer(runs: Sequence[RunTracks]) -> Sheet:
    """Return the laser returns inside the buffer, seen from the robot (figure 11)."""
    first = runs[0]
    sheet = Sheet(2.3, 1.9)
    (axes,) = sheet.axes
    hx, hy = first.buffer
    reach = 1.12 * max(hx, hy)
    points = np.concatenate([run.returns for run in runs[:REPEATS]])
    if len(points):
        counts, _, _ = np.histogram2d(
            points[:, 0], points[:, 1], bins=_BINS, range=((-reach, reach), (-reach, reach))
        )
        # Roots, since a wall driven along has many times the counts of a corner passed.
        share = np.sqrt(counts / max(counts.max(), 1.0))
        levels = np.ceil(share * len(_HEAT)).astype(int) - 1
        axes.cells(levels, reach, _HEAT)
    axes.shapes([first.footprint], edge=BODY, width=1.2)
    box = [(-hx, -hy), (hx, -hy), (hx, hy), (-hx, hy)]
    axes.shapes([box], edge=SOFT, width=0.8, dashes=DASHED)
    axes.arrow((-0.3 * first.body[0], 0.0), (0.6 * first.body[0], 0.0), BODY)
    axes.x_limits = axes.y_limits = (-reach, reach)
    axes.equal = True
    axes.title, axes.x_label = "left [m]", "ahead [m]"
    return sheet
