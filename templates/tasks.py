"""Waypoints around every space and the mission of a campaign, as YAML task files.

The inset contour of a floor (Ortega et al. 2024, section 3.3) is a negative buffer with mitred
corners, correct for rooms of any shape. Too narrow spaces have no contour; spaces with a narrow
middle have several parts. Both are reported. Waypoints are numbered as in the published tools:
waypoint 0 is near the second corner of the space, later ones follow the order of its corners.

There are two published forms. ``tasks/<name>_route.yaml`` is the current form of the tools.
``tasks/era/<name>_task.yaml`` is the plain list of waypoints of the experiments of 2024, rounded to
centimetres.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import Point, Polygon

from grammars.model.geometry import Floats, Point2, Ring
from grammars.model.mission import Mission
from grammars.model.scene import Region, Scene
from templates.naming import file_name
from templates.rendering import render
from templates.world import ExportJob

Yaw: TypeAlias = Literal["zero", "path"]
_SHARPEST: Final = 1e6
"""Limit of mitres that never cuts off a corner."""
_SAME: Final = 1e-6
"""Length up to which differences are rounding errors [m]."""


@dataclass(frozen=True, slots=True)
class Contour:
    """Inset of one space: ``parts`` are rings, numbered in the order of the space's corners.

    ``findings`` describe unexpected results.
    """

    space: str
    parts: tuple[Ring, ...]
    findings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RouteStop:
    """Waypoint of a route: ``part`` and ``number`` of its corner, position [m], yaw [rad]."""

    part: int
    number: int
    x: float
    y: float
    yaw: float


def inset_contour(region: Region, distance: float) -> Contour:
    """Return the contour ``distance`` [m] inside a space.

    Raises :class:`ValueError` unless ``distance`` is positive and finite.
    """
    if not (distance > 0.0 and math.isfinite(distance)):
        raise ValueError(f"the distance of a contour must be positive, not {distance} m")
    floor = Polygon(region.outline, region.holes)
    # The published tool insets edge by edge, which is wrong for concave or narrow rooms.
    inner = floor.buffer(-distance, join_style="mitre", mitre_limit=_SHARPEST)
    rings = [
        _numbered(part.exterior, region.outline, distance)
        for part in shapely.get_parts(inner)
        if part.area > _SAME
    ]
    rings.sort(key=lambda pair: pair[0])
    parts = tuple(ring for _, ring in rings)
    return Contour(region.name, parts, _findings(region, parts, distance))


def contour_route(
    contour: Contour,
    *,
    first: int = 0,
    forward: bool = True,
    closed: bool = False,
    yaw: Yaw = "zero",
) -> tuple[RouteStop, ...]:
    """Return the waypoints of a contour in the order of driving.

    ``first`` is the number of the first waypoint, modulo the number of corners. A ``closed`` route
    returns to it. With yaw ``path`` the robot faces the next waypoint, with ``zero`` the x axis of
    the map.
    """
    stops: list[RouteStop] = []
    for index, ring in enumerate(contour.parts):
        step = 1 if forward else -1
        order = [(first + step * i) % len(ring) for i in range(len(ring) + closed)]
        points = [ring[i] for i in order]
        ahead = _headings(points) if yaw == "path" else [0.0] * len(points)
        stops += [
            RouteStop(index, number, *point, heading)
            for number, point, heading in zip(order, points, ahead, strict=True)
        ]
    return tuple(stops)


def too_close(
    scene: Scene, contour: Contour, distance: float, *, height: float
) -> tuple[tuple[str, str, float], ...]:
    """Return the waypoints nearer than ``distance`` to a column or divider below ``height`` [m].

    Each entry holds the waypoint (``0``, or ``1.0`` in part 1), the column or divider, and the
    distance [m].
    """
    # The inset itself keeps the distance from walls.
    things = [s for s in scene.solids if s.kind != "wall" and s.z_min < height]
    tree = shapely.STRtree([Polygon(s.polygon) for s in things])
    nearest: dict[tuple[str, str], float] = {}
    for index, ring in enumerate(contour.parts):
        for number, corner in enumerate(ring):
            at = Point(corner)
            for hit in tree.query(at, predicate="dwithin", distance=distance - _SAME).tolist():
                label = f"{index}.{number}" if len(contour.parts) > 1 else str(number)
                away = float(at.distance(Polygon(things[hit].polygon)))
                key = (label, things[hit].owner)
                nearest[key] = min(away, nearest.get(key, math.inf))
    return tuple((label, owner, away) for (label, owner), away in nearest.items())


def _numbered(ring: shapely.LinearRing, outline: Ring, distance: float) -> tuple[int, Ring]:
    """Return the first edge of ``outline``, and the corners in the order of its edges."""
    corners = shapely.get_coordinates(shapely.normalize(ring).simplify(0.0))[:-1]
    # The orientation of rings in shapely is undefined.
    if _turns_left(corners) != _turns_left(np.array(outline)):
        corners = corners[::-1]
    arriving = _edges_behind(corners, np.array(outline), distance)
    start = int(np.argmin(arriving))
    ordered = np.roll(corners, -start, axis=0)
    return int(arriving[start]), tuple((float(x), float(y)) for x, y in ordered)


def _edges_behind(corners: Floats, outline: Floats, distance: float) -> npt.NDArray[np.intp]:
    """Return, for every corner, the edge of the outline whose inset is its arriving side."""
    start, end = outline, np.roll(outline, -1, axis=0)
    along = end - start
    length = np.linalg.norm(along, axis=1)
    along = along / np.maximum(length, _SAME)[:, None]
    before = np.roll(corners, 1, axis=0)
    side = corners - before
    side = side / np.maximum(np.linalg.norm(side, axis=1), _SAME)[:, None]
    middle = (corners + before) / 2.0
    parallel = side @ along.T
    offset = middle[:, None, :] - start[None, :, :]
    across = np.abs(offset[:, :, 0] * along[:, 1] - offset[:, :, 1] * along[:, 0])
    position = np.einsum("ijk,jk->ij", offset, along)
    beyond = np.maximum(0.0, np.maximum(-position, position - length))
    unlike = 2.0 * (1.0 - parallel) + np.abs(across - distance) + beyond
    nearest: npt.NDArray[np.intp] = np.argmin(unlike, axis=1)
    return nearest


def _turns_left(ring: Floats) -> bool:
    x, y = ring.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) > 0.0


def _headings(points: Sequence[Point2]) -> list[float]:
    ahead = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in itertools.pairwise(points)]
    return [*ahead, ahead[-1] if ahead else 0.0]


def _findings(region: Region, parts: tuple[Ring, ...], distance: float) -> tuple[str, ...]:
    if not parts:
        return (f"{region.name}: no place {distance:g} m from its walls, so no waypoints",)
    findings = []
    if len(parts) > 1:
        findings.append(
            f"{region.name}: {distance:g} m from its walls it falls into {len(parts)} parts"
        )
    corners = shapely.get_num_coordinates(Polygon(region.outline).simplify(0.0)) - 1
    missing = int(corners) - sum(map(len, parts))
    if missing > 0:
        findings.append(
            f"{region.name}: {missing} of its corners have no waypoint "
            f"{distance:g} m from the walls"
        )
    return tuple(findings)


def mission_file(job: ExportJob, *, era: bool = False) -> str:
    """Return the path of the mission's task file, relative to the folder of the world."""
    mission = job.world.mission
    name = file_name(mission.name if mission else "mission")
    return f"tasks/era/mission/{name}_task.yaml" if era else f"tasks/mission/{name}_route.yaml"


def write_tasks(job: ExportJob) -> tuple[Path, ...]:
    """Write a task for every space with a contour, and one for the mission.

    Notes report spaces without a contour or with several parts, and waypoints too close to a
    column or divider.
    """
    files: list[Path] = []
    settings, scene = job.settings, job.world.scene
    height = job.world.robot.height if job.world.robot else job.laser_height
    distance = settings.distance
    for region in scene.regions:
        contour = inset_contour(region, distance)
        job.notes.extend(contour.findings)
        for number, owner, away in too_close(scene, contour, distance, height=height):
            job.notes.append(f"{region.name}: waypoint {number} is only {away:.2f} m from {owner}")
        stops = contour_route(
            contour,
            first=settings.first,
            forward=settings.forward,
            closed=settings.closed,
            yaw=settings.yaw,
        )
        if stops:
            name = file_name(region.name)
            paths = f"tasks/{name}_route.yaml", f"tasks/era/{name}_task.yaml"
            files += _write(job, region.name, paths, _of_contour(contour, stops))
    if job.world.mission:
        paths = mission_file(job), mission_file(job, era=True)
        files += _write(job, job.world.mission.name, paths, _of_mission(job.world.mission))
    return tuple(files)


def _write(
    job: ExportJob, name: str, paths: tuple[str, str], waypoints: Sequence[dict[str, Any]]
) -> list[Path]:
    return [
        job.write(
            job.path(*path.split("/")),
            render(template, name=name, waypoints=waypoints),
        )
        for path, template in zip(paths, ("route.yaml.j2", "era_task.yaml.j2"), strict=True)
    ]


def _of_contour(contour: Contour, stops: Sequence[RouteStop]) -> list[dict[str, Any]]:
    several = len(contour.parts) > 1
    waypoints = []
    for stop in stops:
        space = f"{contour.space}-part-{stop.part}" if several else contour.space
        waypoints.append(
            {
                "id": f"{space}-point-{stop.number:04d}",
                "era_id": f"{space}-point-{stop.number}",
                "x": stop.x,
                "y": stop.y,
                "yaw": stop.yaw,
            }
        )
    return waypoints


def _of_mission(mission: Mission) -> list[dict[str, Any]]:
    """Return the mission's waypoints; the default yaw is the direction of arrival."""
    waypoints = []
    x, y = mission.start.x, mission.start.y
    for stop in mission.waypoints:
        yaw = math.atan2(stop.y - y, stop.x - x) if stop.yaw is None else stop.yaw
        waypoints.append({"id": stop.id, "era_id": stop.id, "x": stop.x, "y": stop.y, "yaw": yaw})
        x, y = stop.x, stop.y
    return waypoints
