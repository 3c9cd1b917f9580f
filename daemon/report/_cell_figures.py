"""The figures of one cell, all repeats in one: figures 8, 10, 11 and 12 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from daemon.report._svg import (
    BAD,
    BODY,
    GOOD,
    INK,
    LINE,
    NEAR,
    RULE,
    SECOND,
    SOFT,
    WALL,
    figure,
    legend,
    named,
    to_svg,
)
from daemon.report._types import Driven
from grammars.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH: Final = 3.5
"""Width of a panel [inches]."""
REPEATS: Final = 10
"""Repeats drawn of one cell at most."""
_CUT: Final = 0.3
"""Height [m] at which the map is cut: about where lasers look."""
_BINS: Final = 64


@dataclass(frozen=True, slots=True)
class Frame:
    """What all panels of a scenario share, so that they can be compared: axis limits."""

    time: float
    error: float
    sigma: float
    clearance: float
    west: float
    south: float
    east: float
    north: float


def frame_of(runs: Sequence[Driven]) -> Frame:
    """Return limits that show everything of ``runs``."""
    xs = np.concatenate([r.x for r in runs])
    ys = np.concatenate([r.y for r in runs])
    margin = 1.0
    return Frame(
        time=max(float(r.time[-1]) for r in runs),
        error=_top([r.error for r in runs]),
        sigma=_top([s for r in runs for s in (r.sigma_x, r.sigma_y)]),
        clearance=min(max(_top([r.clearance for r in runs]), 0.3), 2.0),
        west=float(xs.min()) - margin,
        south=float(ys.min()) - margin,
        east=float(xs.max()) + margin,
        north=float(ys.max()) + margin,
    )


def _pen(runs: Sequence[Driven]) -> dict[str, float]:
    """Return how to draw a line of one repeat, so that many of them stay apart."""
    return {"lw": 0.7, "alpha": 0.6} if len(runs) > 1 else {"lw": 1.0, "alpha": 1.0}


def _top(values: Sequence[Any]) -> float:
    known = [float(np.nanmax(v)) for v in values if not np.isnan(v).all()]
    return 1.05 * max(known, default=1.0) or 1.0


def localisation(
    name: str, label: str, runs: Sequence[Driven], frame: Frame, limit: float | None
) -> str:
    """Return the localisation error and the spread of the estimate over time (figure 8)."""
    sheet, (above, below) = figure(WIDTH, 2.6, 2, 1, sharex=True)
    for run in runs[:REPEATS]:
        above.plot(run.time, run.error, color=LINE, **_pen(runs))
        below.plot(run.time, run.sigma_x, color=LINE, **_pen(runs))
        below.plot(run.time, run.sigma_y, color=SECOND, **_pen(runs))
    top = frame.error
    if limit is not None and limit < 4.0 * frame.error:
        above.axhline(limit, color=BAD, lw=0.9, ls=(0, (4, 3)))
        top = max(top, 1.1 * limit)
    above.set(xlim=(0.0, frame.time), ylim=(0.0, top))
    below.set(ylim=(0.0, frame.sigma), xlabel="time [s]")
    named(above, "error [m]")
    named(below, "spread [m]")
    below.plot([], [], color=LINE, lw=1.2, label="σ along x")
    below.plot([], [], color=SECOND, lw=1.2, label="σ along y")
    legend(below)
    return to_svg(sheet, name, label)


def distance(name: str, label: str, runs: Sequence[Driven], frame: Frame) -> str:
    """Return the distance to the nearest obstacle over time, triggers dotted (figure 12)."""
    sheet, axes = figure(WIDTH, 1.9)
    limit = runs[0].limit
    low = min(-0.05, *(float(np.nanmin(r.clearance)) for r in runs if len(r.clearance)), 0.0)
    if limit > 0.0:
        axes.axhspan(min(low, 0.0), limit, color=NEAR, alpha=0.13, lw=0)
    axes.axhline(0.0, color=BAD, lw=0.9)
    for run in runs[:REPEATS]:
        axes.plot(run.time, run.clearance, color=LINE, **_pen(runs))
        for passing in run.passings:
            if passing.fired:
                axes.axvline(passing.time, color=INK, lw=0.8, ls=":", alpha=0.6)
    axes.set(
        xlim=(0.0, frame.time),
        ylim=(low, frame.clearance),
        xlabel="time [s]",
    )
    named(axes, "clearance [m]")
    return to_svg(sheet, name, label)


def along_the_way(name: str, label: str, runs: Sequence[Driven], frame: Frame, scene: Scene) -> str:
    """Return the ways driven on the map, coloured by the distance to obstacles (figure 10)."""
    wide, high = frame.east - frame.west, frame.north - frame.south
    sheet, axes = figure(WIDTH, min(max(WIDTH * high / wide, 1.2), 4.4), bare=True)
    draw_map(axes, scene, frame)
    limit = runs[0].limit if runs[0].limit > 0.0 else 0.2
    for run in runs[:REPEATS]:
        for low, top, colour, lw in (
            (2.0 * limit, np.inf, LINE, 0.6),
            (limit, 2.0 * limit, GOOD, 0.8),
            (0.0, limit, NEAR, 1.2),
            (-np.inf, 0.0, BAD, 2.0),
        ):
            x, y = _pieces(run, (run.clearance >= low) & (run.clearance < top))
            axes.plot(x, y, color=colour, lw=lw, alpha=0.75)
    touched = [(x, y) for run in runs[:REPEATS] for _, _, x, y in run.contacts]
    if touched:
        axes.plot(*zip(*touched, strict=True), "x", color=BAD, ms=4.0, mew=1.1)
    axes.plot(runs[0].x[:1], runs[0].y[:1], "o", color=INK, ms=3.0)
    return to_svg(sheet, name, label)


def _pieces(run: Driven, shown: Any) -> tuple[Any, Any]:
    """Return the way where ``shown`` holds, and to the sample after it, with gaps of NaN."""
    drawn = shown.copy()
    drawn[1:] |= shown[:-1]
    return np.where(drawn, run.x, np.nan), np.where(drawn, run.y, np.nan)


def draw_map(axes: Axes, scene: Scene, frame: Frame) -> None:
    """Draw what the scene has at laser height, doors as they start, within ``frame``."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    for rings, colour in ((_walls(scene), WALL), (_things(scene), SECOND)):
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


def _scale_bar(axes: Axes, frame: Frame) -> None:
    wide = frame.east - frame.west
    length = max(
        step for step in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0) if step <= wide / 4 or step == 0.5
    )
    left, low = frame.west + 0.02 * wide, frame.south + 0.02 * wide
    axes.plot([left, left + length], [low, low], color=INK, lw=1.6, solid_capstyle="butt")
    axes.text(left, low + 0.015 * wide, f"{length:g} m", color=SOFT, fontsize=6.5, va="bottom")


def _walls(scene: Scene) -> list[Any]:
    return [s.polygon for s in scene.solids if s.z_min <= _CUT < s.z_max]


def _things(scene: Scene) -> list[Any]:
    from grammars.kinematics import link_poses

    rings = []
    for item in scene.objects:
        poses = link_poses(item, item.initial)
        for link in item.links:
            if link.z_min <= _CUT < link.z_max:
                rings += [poses[link.name].apply_ring(ring) for ring in link.polygons]
    return rings


def _touches(ring: Any, frame: Frame) -> bool:
    xs, ys = zip(*ring, strict=True)
    return bool(
        max(xs) >= frame.west
        and min(xs) <= frame.east
        and max(ys) >= frame.south
        and min(ys) <= frame.north
    )


def inside_buffer(name: str, label: str, runs: Sequence[Driven]) -> str:
    """Return where obstacles were inside the buffer, seen from the robot (figure 11)."""
    from matplotlib.patches import Polygon, Rectangle

    first = runs[0]
    sheet, axes = figure(2.3, 1.9)
    hx, hy = first.buffer
    reach = 1.12 * max(hx, hy)
    points = np.concatenate([run.inside for run in runs[:REPEATS]])
    if len(points):
        counts, _, _ = np.histogram2d(
            points[:, 0], points[:, 1], bins=_BINS, range=((-reach, reach), (-reach, reach))
        )
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
    named(axes, "left [m]")
    axes.grid(color=RULE)
    return to_svg(sheet, name, label)
