"""The building as an obstacle: the outline of all solids the robot can meet.

Chains of line segments that know their neighbours, not the convex solids themselves: where two
solids of one wall meet, a body sliding along would catch on the hidden end of the next one.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pymunk

from daemon.simulator._layers import BUILDING_FILTER, FRICTION
from daemon.simulator._sight import wall_outline
from grammars.scene import Scene
from grammars.values import Point2


def build_walls(space: pymunk.Space, scene: Scene, height: float) -> dict[pymunk.Shape, str]:
    """Add all solids between the floor and ``height`` to ``space``; return owners by shape."""
    solids = tuple(
        replace(solid, z_min=0.0, z_max=1.0)
        for solid in scene.solids
        if solid.z_min < height and solid.z_max > 0.0
    )
    rows, owner, names = wall_outline(solids, 0.5)
    segments = [((x1, y1), (x2, y2)) for x1, y1, x2, y2 in rows.tolist()]
    before = _unique({end: start for start, end in segments}, [end for _, end in segments])
    after = _unique(dict(segments), [start for start, _ in segments])
    owners: dict[pymunk.Shape, str] = {}
    for (start, end), number in zip(segments, owner.tolist(), strict=True):
        shape = pymunk.Segment(space.static_body, start, end, 0.0)
        if start in before and end in after:
            shape.set_neighbors(before[start], after[end])
        shape.filter = BUILDING_FILTER
        shape.friction = FRICTION
        owners[shape] = names[number]
        space.add(shape)
    return owners


def _unique(neighbours: dict[Point2, Point2], corners: list[Point2]) -> dict[Point2, Point2]:
    """Leave out corners where more than one outline passes: there is no one neighbour."""
    counts = Counter(corners)
    return {corner: other for corner, other in neighbours.items() if counts[corner] == 1}
