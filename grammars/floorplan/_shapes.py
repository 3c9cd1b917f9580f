"""Local outlines of spaces, features and openings.

Rings are those of the FloorPlan language: rectangles clockwise from the left-top corner, centred
on their frame; circles as 40-gons, clockwise from the top, so that walls grow outwards.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain
from typing import Final, Literal

from grammars.floorplan._attributes import ElementReader
from grammars.floorplan._spaces import wall_frames
from grammars.floorplan.model import Point3
from grammars.model.geometry import Point2, Ring
from grammars.text.diagnostics import SyntaxNode, rule_of, with_article

# FloorPlan DSL v1 approximated circles by 40 corners, clockwise from (0, r), so that walls grow
# outwards. Every edge is a wall with a number. Circles of objects have no such numbers and fewer
# corners (grammars.scenery._objects).
CIRCLE_CORNERS: Final = 40
SAME_POINT: Final = 1e-9
"""Corners closer than this [m] are one corner."""
# The outline turns back on itself if 1 + the cosine of a corner's turn is below this number. The
# mitre of outer_corners divides by the sum.
_SPIKE: Final = 1e-9


def rectangle(width: float, length: float) -> Ring:
    """Return the ring of a rectangle, clockwise from its left-top corner [m]."""
    x, y = width / 2, length / 2
    return ((-x, y), (x, y), (x, -y), (-x, -y))


def circle(radius: float) -> Ring:
    """Return the regular 40-gon of a circle, clockwise from its top [m]."""
    angles = [math.tau * k / CIRCLE_CORNERS for k in range(CIRCLE_CORNERS)]
    return tuple((radius * math.sin(a), radius * math.cos(a)) for a in angles)


def _outline(shape: SyntaxNode, second: Literal["length", "height"], reader: ElementReader) -> Ring:
    """Return the ring of a rectangle or circle, empty after an error.

    ``second`` is the other size of a rectangle: in a wall it has a height instead of a length.
    """
    if rule_of(shape) == "Circle":
        return circle(_positive(shape.radius, "the radius of a circle", reader))
    width = _positive(shape.width, "the width of a rectangle", reader)
    node = shape.length if second == "length" else shape.height
    if node is None:
        other = "height" if second == "length" else "length"
        owner = "opening" if second == "height" else "space or feature"
        reader.error(
            shape,
            f"the rectangle of {with_article(owner)} has a {second}, not a {other}",
            f"write Rectangle width=…, {second}=…",
        )
        return ()
    return rectangle(width, _positive(node, f"the {second} of a rectangle", reader))


def floor_outline(shape: SyntaxNode, reader: ElementReader) -> Ring:
    """Return the ring of a space or feature, empty after an error."""
    if rule_of(shape) != "Polygon":
        return _outline(shape, "length", reader)
    points = _points(shape, reader)
    for point, node in zip(points, shape.points, strict=False):
        if len(point) == 3 and point[2] != 0.0:
            reader.error(node.coordinates[2], "the outline lies on the floor: z must be 0")
            return ()
    ring: Ring = tuple((p[0], p[1]) for p in points)
    return tuple(ring[k] for k in _corners(ring, shape, reader))


def wall_outline(shape: SyntaxNode, reader: ElementReader) -> tuple[Point3, ...]:
    """Return the ring of an opening, x along the wall, z up; empty after an error."""
    if rule_of(shape) != "Polygon":
        return tuple((x, 0.0, z) for x, z in _outline(shape, "height", reader))
    points = _points(shape, reader)
    if points and all(len(point) == 2 for point in points):
        reader.warning(
            shape,
            "points of an opening are (x, y, z); the second number is taken as z",
            "write (x, 0 m, z)",
        )
        solid: list[Point3] = [(p[0], 0.0, p[1]) for p in points]
    else:
        solid = [(p[0], p[1], p[2] if len(p) == 3 else 0.0) for p in points]
    return tuple(solid[k] for k in _corners([(p[0], p[2]) for p in solid], shape, reader))


def _positive(node: SyntaxNode, label: str, reader: ElementReader) -> float:
    value = reader.length(node)
    if value <= 0.0:
        reader.error(node, f"{label} must be positive, not {value:g} m")
    return value


def _points(shape: SyntaxNode, reader: ElementReader) -> list[tuple[float, ...]]:
    """Return the points as written, or none if one of them is broken."""
    points = [tuple(map(reader.length, node.coordinates)) for node in shape.points]
    odd = [k for k, point in enumerate(points) if not 2 <= len(point) <= 3]
    for k in odd:
        reader.error(shape.points[k], f"a point has 2 or 3 coordinates, not {len(points[k])}")
    return [] if odd or any(map(math.isnan, chain.from_iterable(points))) else points


def _corners(points: Sequence[Point2], shape: SyntaxNode, reader: ElementReader) -> tuple[int, ...]:
    """Return the indices of the corners of a simple polygon, or none after an error."""
    if len(points) < len(shape.points):
        return ()  # one of them is broken and has been reported
    corners = _without_repeats(points)
    ring = tuple(points[k] for k in corners)
    if len(set(ring)) < 3:
        reader.error(shape, f"a polygon needs 3 different points, not {len(set(ring))}")
        return ()
    if len(ring) < len(points):
        reader.warning(
            shape,
            "repeated points of the polygon are left out",
            "walls are counted without them; do not repeat the first point at the end",
        )
    problem = _spike(ring) or _crossing(ring)
    if problem:
        reader.error(shape, problem, "list the points in order around the area")
        return ()
    return corners


def _without_repeats(points: Sequence[Point2]) -> tuple[int, ...]:
    corners: list[int] = []
    for k, point in enumerate(points):
        if not corners or math.dist(point, points[corners[-1]]) > SAME_POINT:
            corners.append(k)
    while len(corners) > 1 and math.dist(points[corners[0]], points[corners[-1]]) <= SAME_POINT:
        corners.pop()
    return tuple(corners)


def _spike(ring: Ring) -> str:
    """Return a message if the outline turns back on itself, where no mitre exists."""
    yaws = [frame.yaw for frame in wall_frames(ring)]
    turns = [1.0 + math.cos(yaw - yaws[k - 1]) for k, yaw in enumerate(yaws)]
    worst = turns.index(min(turns))
    if turns[worst] > _SPIKE:
        return ""
    x, y = ring[worst]
    return f"the outline turns back on itself at point {worst} ({x:g}, {y:g})"


def _crossing(ring: Ring) -> str:
    """Return a message if the outline crosses or touches itself."""
    import shapely

    reason, _, place = shapely.is_valid_reason(shapely.Polygon(ring)).partition("[")
    if "Self-intersection" not in reason:
        return ""
    x, y = map(float, place.rstrip("]").split())
    return f"the outline crosses or touches itself near ({x:g}, {y:g})"
