"""The building and its objects as the laser sees them, and the walls as obstacles.

Walls are chains of line segments that know their neighbours, not the convex solids themselves:
where two solids of one wall meet, a body sliding along would catch on the hidden end of the next.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pymunk

from daemon.simulator._assembly import WORLD, BodyAssembly
from daemon.simulator._physics import BUILDING_FILTER, FRICTION, ring_edges
from daemon.simulator._sensors import OwnerIds
from grammars.model.geometry import Floats, Point2, Ring
from grammars.model.scene import Scene, Solid
from grammars.scenery.composition import static_segments

Edge = tuple[float, float, float, float]


def laser_segments(
    scene: Scene, assembly: BodyAssembly, z: float
) -> tuple[tuple[Floats, OwnerIds], tuple[Floats, OwnerIds, OwnerIds], tuple[str, ...]]:
    """Return what a laser at height ``z`` can hit.

    Static segments (n, 4) in the world with their owner indices; moving segments (m, 4) in the
    frame of their body with owner indices and body slots; owner names.
    """
    walls, wall_owner, wall_names = wall_outline(scene.solids, z)
    names = {name: number for number, name in enumerate(wall_names)}
    static: list[Edge] = []
    static_owner: list[int] = []
    moving: list[Edge] = []
    moving_owner: list[int] = []
    slots: list[int] = []
    # By body, as the laser wants moving segments.
    for placement in sorted(assembly.placements, key=lambda p: p.slot):
        if not placement.link.z_min <= z < placement.link.z_max:
            continue
        edges = [edge for ring in placement.rings for edge in ring_edges(_counter_clockwise(ring))]
        owners = [names.setdefault(placement.owner, len(names))] * len(edges)
        if placement.slot == WORLD:
            static += edges
            static_owner += owners
        else:
            moving += edges
            moving_owner += owners
            slots += [placement.slot] * len(edges)
    still = np.vstack([walls, _rows(static)]), np.concatenate([wall_owner, _ids(static_owner)])
    return still, (_rows(moving), _ids(moving_owner), _ids(slots)), tuple(names)


@lru_cache(maxsize=8)
def wall_outline(solids: tuple[Solid, ...], z: float) -> tuple[Floats, OwnerIds, tuple[str, ...]]:
    """Return the union outline of solids at a height, see ``static_segments``.

    Remembered, since runs share their scene.
    """
    return static_segments(Scene("", (), (), solids), z)


def _counter_clockwise(ring: Ring) -> Ring:
    """Return the ring counter-clockwise."""
    return ring if pymunk.area_for_poly(list(ring)) > 0.0 else ring[::-1]


def _rows(edges: Sequence[Edge]) -> Floats:
    return np.array(edges, dtype=np.float64).reshape(-1, 4)


def _ids(values: Sequence[int]) -> OwnerIds:
    return np.array(values, dtype=np.int32)


def build_walls(space: pymunk.Space, scene: Scene, height: float) -> dict[pymunk.Shape, str]:
    """Add all solids between the floor and ``height`` to ``space``; return owners by shape."""
    # All that the body can hit, as if it were of one height: the outline of their union has no
    # edges inside of it that a robot could catch on.
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
