"""Distance of the robot from things and places, and presence inside places.

Distances are Euclidean, between the robot's footprint and filled outlines, and 0 where they meet.
:mod:`daemon.judging.oracles._clearance` measures along the sides of a box, also below 0.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import shapely
from shapely.geometry import Polygon

from daemon.judging.oracles._obstacles import IndexArray, ObstaclePolygons, cos_sin
from daemon.judging.oracles._series import ObjectIndices, SignalSeries
from grammars.model.geometry import Floats, Ring
from grammars.model.scene import Scene


def distance_series(obstacles: ObstaclePolygons, poses: Floats, footprint: Ring) -> SignalSeries:
    """Return the distance [m] from the footprint at ``poses`` (n, 3) to the nearest obstacle.

    The tracks of ``obstacles`` are sampled at the same times as the poses.
    """
    if not obstacles.names:
        note = "nothing of it is as high as the robot"
        return SignalSeries(np.full(len(poses), np.nan), note=note)
    away, owner = nearest_polygons(obstacles, footprint, poses, np.arange(len(poses)))
    return SignalSeries(away, owner, obstacles.names)


def nearest_polygons(
    obstacles: ObstaclePolygons,
    footprint: Ring,
    poses: Floats,
    samples: IndexArray,
    reach: float = math.inf,
) -> tuple[Floats, ObjectIndices]:
    """Return distance (k,) [m] and index (k,) of the polygon nearest to the footprint.

    ``samples`` (k,) choose from the ``poses`` (n, 3), which are at the same times as the tracks of
    ``obstacles``. Of equally near polygons the first one counts. Without a polygon within ``reach``
    [m] the result is infinite and -1; moving polygons count at any distance.
    """
    robot = placed_polygons(np.array(footprint, dtype=np.float64), poses[samples])
    nearest = np.full(len(samples), np.inf)
    owner = np.full(len(samples), -1, dtype=np.int32)
    offsets = obstacles.offsets
    parts = [obstacles.corners[first:last] for first, last in itertools.pairwise(offsets)]
    still = np.flatnonzero(obstacles.frame < 0)
    if len(still):
        tree = shapely.STRtree([Polygon(parts[index]) for index in still])
        (sample, item), away = tree.query_nearest(
            robot, max_distance=None if math.isinf(reach) else reach, return_distance=True
        )
        # Equally near ones follow each other; the first one is assigned last.
        order = np.lexsort((-item, sample))
        nearest[sample[order]], owner[sample[order]] = away[order], still[item[order]]
    for index in np.flatnonzero(obstacles.frame >= 0):
        track = obstacles.tracks[samples, obstacles.frame[index]]
        away = shapely.distance(robot, placed_polygons(parts[index], track))
        closer = (away < nearest) | ((away == nearest) & (index < owner))
        nearest[closer], owner[closer] = away[closer], index
    return nearest, owner


def place_distance_series(outline: Ring, poses: Floats, footprint: Ring, name: str) -> SignalSeries:
    """Return the distance [m] from the footprint at ``poses`` (n, 3) to a part of the floor."""
    robot = placed_polygons(np.array(footprint, dtype=np.float64), poses)
    values: Floats = np.asarray(shapely.distance(robot, Polygon(outline)))
    return SignalSeries(values, np.zeros(len(poses), dtype=np.int32), (name,))


def inside_series(outline: Ring, poses: Floats, name: str) -> SignalSeries:
    """Return 1 where the base at ``poses`` (n, 3) is in a part of the floor or on its edge."""
    inside = shapely.intersects_xy(Polygon(outline), poses[:, 0], poses[:, 1])
    return SignalSeries(inside.astype(np.float64), np.zeros(len(poses), dtype=np.int32), (name,))


def place_outline(scene: Scene, name: str) -> Ring:
    """Return the outline [m] of a space or doorway; raises ``KeyError`` for an unknown one."""
    doorways = {doorway.name: doorway.footprint for doorway in scene.doorways}
    return (doorways | {region.name: region.outline for region in scene.regions})[name]


def placed_polygons(corners: Floats, poses: Floats) -> Any:
    """Return the polygons (n,) with ``corners`` (k, 2) placed at ``poses`` (n, 3)."""
    c, s = cos_sin(poses[:, 2].copy())
    x, y = corners[:, 0], corners[:, 1]
    placed = np.stack(
        (
            poses[:, 0, None] + c[:, None] * x - s[:, None] * y,
            poses[:, 1, None] + s[:, None] * x + c[:, None] * y,
        ),
        axis=-1,
    )
    return shapely.polygons(placed)
