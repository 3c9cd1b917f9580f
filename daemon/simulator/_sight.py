"""Laser geometry of a scene: the segments that cross the scan plane."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import pymunk

from daemon.simulator._geometry import ring_edges
from daemon.simulator._laser import Ids
from daemon.simulator._links import WORLD, Assembly
from grammars.composition import static_segments
from grammars.scene import Scene, Solid
from grammars.values import Floats, Ring

Edge = tuple[float, float, float, float]


def laser_segments(
    scene: Scene, assembly: Assembly, z: float
) -> tuple[tuple[Floats, Ids], tuple[Floats, Ids, Ids], tuple[str, ...]]:
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
    for placement in sorted(assembly.placements, key=lambda p: p.slot):
        if not placement.link.z_min <= z < placement.link.z_max:
            continue
        edges = [edge for ring in placement.rings for edge in ring_edges(_left_inside(ring))]
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
def wall_outline(solids: tuple[Solid, ...], z: float) -> tuple[Floats, Ids, tuple[str, ...]]:
    """Return the union outline of solids at a height, see ``static_segments``.

    Remembered, since runs share their scene.
    """
    return static_segments(Scene("", (), (), solids), z)


def _left_inside(ring: Ring) -> Ring:
    """Return the ring counter-clockwise."""
    return ring if pymunk.area_for_poly(list(ring)) > 0.0 else ring[::-1]


def _rows(edges: Sequence[Edge]) -> Floats:
    return np.array(edges, dtype=np.float64).reshape(-1, 4)


def _ids(values: Sequence[int]) -> Ids:
    return np.array(values, dtype=np.int32)
