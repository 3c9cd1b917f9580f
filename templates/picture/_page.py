"""Where the world lies on the page, and what colours things have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from grammars.scene import Scene
from grammars.values import Point2, Ring
from templates.world import poses_at

PAPER: Final = "#faf8f4"
FLOOR: Final = "#ffffff"
WALL: Final = "#3b4048"
LOW: Final = "#cfc9bd"
DOOR: Final = "#c8553d"
SWING: Final = "#e9a178"
POST: Final = "#6d3023"
ROUTE: Final = "#22638f"
ROBOT: Final = "#2f9e6e"
INK: Final = "#2b2f36"
SOFT: Final = "#7b8089"
FAINT: Final = "#b9b5ab"
MOVER: Final = "#7d4f9e"

LONGEST: Final = 1400.0
"""Longer side of the page without its margins."""
MARGIN: Final = 48.0
HEAD: Final = 92.0
FOOT: Final = 76.0
_NARROWEST: Final = 720.0
_LARGEST_SCALE: Final = 120.0
_CUT: Final = 1.2
"""Height of the horizontal cut a plan shows [m], as architects draw it."""


@dataclass(frozen=True, slots=True)
class Page:
    """``scale`` [px/m] and the world point (``west``, ``north``) at (``left``, ``top``)."""

    scale: float
    west: float
    north: float
    left: float
    top: float
    width: float
    height: float

    def point(self, at: Point2) -> Point2:
        """Return a point of the map on the page."""
        x = self.left + (at[0] - self.west) * self.scale
        y = self.top + (self.north - at[1]) * self.scale
        return (round(x, 2), round(y, 2))

    def ring(self, ring: Ring) -> tuple[Point2, ...]:
        """Return a ring of the map on the page."""
        return tuple(map(self.point, ring))


def page_for(scene: Scene, start: Mapping[str, float], more: tuple[Point2, ...] = ()) -> Page:
    """Return a page on which the whole scene as it starts and the points ``more`` have room."""
    corners = [c for region in scene.regions for c in region.outline]
    corners += [c for solid in scene.solids for c in solid.polygon]
    corners += [
        pose.apply(c)
        for thing in scene.objects
        for pose, link in zip(poses_at(thing, start).values(), thing.links, strict=True)
        for ring in link.polygons
        for c in ring
    ]
    corners += more
    xs, ys = [c[0] for c in corners] or [0.0, 1.0], [c[1] for c in corners] or [0.0, 1.0]
    wide, high = max(max(xs) - min(xs), 1.0), max(max(ys) - min(ys), 1.0)
    scale = min(LONGEST / max(wide, high), _LARGEST_SCALE)
    width = max(wide * scale + 2 * MARGIN, _NARROWEST)
    left = (width - wide * scale) / 2.0
    height = high * scale + HEAD + FOOT
    return Page(scale, min(xs), max(ys), left, HEAD, round(width), round(height))


def is_cut(z_min: float, z_max: float) -> bool:
    """Return whether something crosses the height at which the plan is cut."""
    return z_min <= _CUT < z_max


def is_below(z_min: float, z_max: float) -> bool:
    """Return whether something stands below that height."""
    return z_min < _CUT and z_max <= _CUT
