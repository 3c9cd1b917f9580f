"""Where the robot is in relation to things and places: distances between outlines, being inside.

Distances are Euclidean, between the robot's footprint and filled outlines, and 0 where they meet.
:mod:`daemon.judging.oracles._clearance` measures along the sides of a box, and goes on below 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from shapely.geometry import Polygon

from daemon.judging.oracles._obstacles import ObstaclePolygons, cos_sin
from daemon.judging.oracles._series import SignalSeries
from grammars.model.geometry import Floats, Ring
from grammars.model.scene import Scene


def distance_series(obstacles: ObstaclePolygons, poses: Floats, footprint: Ring) -> SignalSeries:
    """Return the distance [m] from the footprint at ``poses`` (n, 3) to the nearest obstacle.

    The tracks of ``obstacles`` are sampled at the same times as the poses.
    """
    if not obstacles.names:
        note = "nothing of it is as high as the robot"
        return SignalSeries(np.full(len(poses), np.nan), note=note)
    robot = placed_polygons(np.array(footprint, dtype=np.float64), poses)
    away = np.empty((len(obstacles.names), len(poses)))
    for index, frame in enumerate(obstacles.frame):
        first, last = obstacles.offsets[index : index + 2]
        corners = obstacles.corners[first:last]
        other = (
            Polygon(corners) if frame < 0 else placed_polygons(corners, obstacles.tracks[:, frame])
        )
        away[index] = shapely.distance(robot, other)
    nearest = np.argmin(away, axis=0).astype(np.int32)
    return SignalSeries(away.min(axis=0), nearest, obstacles.names)


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
    """Return the outline [m] of a space or doorway; raises ``KeyError`` when there is none."""
    doorways = {doorway.name: doorway.footprint for doorway in scene.doorways}
    return (doorways | {region.name: region.outline for region in scene.regions})[name]


def placed_polygons(corners: Floats, poses: Floats) -> Any:
    """Return the polygons (n,) that ``corners`` (k, 2) make at ``poses`` (n, 3)."""
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
