"""Is there a way from the start to every waypoint, and if not, what is in it?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, TypeAlias

import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from grammars.model.behaviour import Behaviour, Hold, Walk
from grammars.model.free_space import (
    ConnectedParts,
    FreeSpace,
    inscribed_radius,
    link_shape,
    moving_links,
    still_links,
)
from grammars.model.geometry import Point2
from grammars.model.movers import own_joints
from grammars.model.robot import Robot
from grammars.model.scene import Doorway, Scene, SceneObject
from grammars.text.diagnostics import Diagnostic, Severity, Where

_THIN: Final = 0.02
"""Half the width [m] of what is thought to pass any gap."""
Spot: TypeAlias = tuple[str, Point2, Where]


def check_reach(
    scene: Scene, robot: Robot, points: Sequence[Spot], behaviours: Sequence[Behaviour]
) -> list[Diagnostic]:
    """Return why waypoints cannot be reached; ``points[0]`` is the start.

    The robot is a disc of its inscribed radius. Doors count as open, unless they are frozen or
    held; these only give warnings, since a door that stays shut may be the point of a test.
    """
    radius = inscribed_radius(robot.footprint)
    space = FreeSpace(scene, robot.height)
    parts = space.for_radius(radius)
    start, *waypoints = points
    home = parts.of(start[1])
    if home is None:
        return [_no_room(robot, start)]
    away = [p for p in waypoints if parts.of(p[1]) != home]
    findings = [
        _no_room(robot, p)
        if parts.of(p[1]) is None
        else _no_way(scene, robot, space, start, p, radius)
        for p in away
    ]
    reached = [p for p in waypoints if p not in away]
    shut = immobile_leaves(scene, robot, behaviours)
    if shut:
        findings.extend(_behind_doors(space, shut, start, reached, radius))
    return findings


def _no_room(robot: Robot, spot: Spot) -> Diagnostic:
    label, _, place = spot
    message = f"{label} leaves no room for {robot.name}"
    return Diagnostic(place, message, "a standing part of an object, or a wall, is too near")


def _no_way(
    scene: Scene, robot: Robot, space: FreeSpace, start: Spot, spot: Spot, radius: float
) -> Diagnostic:
    label, point, place = spot
    width = f"{robot.name} is {2 * radius:.2f} m wide"
    # If not even a thread passes, the building is closed there; else something is too narrow.
    if not _connected(space.for_radius(_THIN), start[1], point):
        hint = "an entryway may be missing in the floor plan, or not list both of its walls"
        return Diagnostic(place, f"there is no way from the start to {label}", hint)
    narrow = [
        f"{door.name} ({clear:.2f} m)"
        for door, clear in ((door, _clear_width(scene, door)) for door in scene.doorways)
        if clear < 2 * radius and _only_way(space, door, start[1], point)
    ]
    if narrow:
        message = f"the way to {label} leads through {' and '.join(narrow)}, {width}"
        return Diagnostic(place, message, "widen the doorway or take a narrower robot")
    message = f"the way to {label} is too narrow, {width}"
    return Diagnostic(place, message, "look for columns or walls that stand close to each other")


def _only_way(space: FreeSpace, door: Doorway, a: Point2, b: Point2) -> bool:
    """Return whether nothing gets from ``a`` to ``b`` while ``door`` is blocked."""
    blocked = Polygon(door.footprint).buffer(_THIN)
    return not _connected(space.for_radius(_THIN, [blocked]), a, b)


def _connected(parts: ConnectedParts, a: Point2, b: Point2) -> bool:
    first = parts.of(a)
    return first is not None and first == parts.of(b)


def _clear_width(scene: Scene, door: Doorway) -> float:
    """Return the width that posts leave free, measured along the doorway [m]."""
    passage = Polygon(door.footprint)
    to_local = door.frame.inverse()
    taken = 0.0
    for body in scene.objects:
        for link in still_links(body) if body.doorway == door.name else ():
            part = link_shape(body, link, body.initial).intersection(passage)
            xs = [to_local.apply((x, y))[0] for x, y in shapely.get_coordinates(part).tolist()]
            taken += max(xs) - min(xs) if xs else 0.0
    return door.width - taken


def _behind_doors(
    space: FreeSpace,
    shut: Mapping[str, Sequence[BaseGeometry]],
    start: Spot,
    points: Sequence[Spot],
    radius: float,
) -> list[Diagnostic]:
    parts = space.for_radius(radius, _leaves(shut))
    behind = [p for p in points if not _connected(parts, start[1], p[1])]
    if not behind:
        return []
    # Each shut door is opened alone: one that lets the robot through is the one to name.
    without = {name: space.for_radius(radius, _leaves(shut, but=name)) for name in shut}
    findings = []
    for label, point, place in behind:
        single = [n for n, opened in without.items() if _connected(opened, start[1], point)]
        doors = f"{' or '.join(single)} stays" if single else "several doors stay"
        message = f"{label} cannot be reached while {doors} as told"
        hint = "fine if that is what is tested"
        findings.append(Diagnostic(place, message, hint, Severity.WARNING))
    return findings


def _leaves(shut: Mapping[str, Sequence[BaseGeometry]], but: str = "") -> list[BaseGeometry]:
    return [shape for name, shapes in shut.items() if name != but for shape in shapes]


def immobile_leaves(
    scene: Scene, robot: Robot, behaviours: Sequence[Behaviour]
) -> dict[str, list[BaseGeometry]]:
    """Return outlines of links that could move and never do: frozen, held, movers at rest."""
    walking = {b.object for b in behaviours if isinstance(b, Walk)}
    held = {b.joint: b.position for b in behaviours if isinstance(b, Hold)}
    return {
        body.name: [
            link_shape(body, link, _positions(body, held))
            for link in moving_links(body)
            if link.z_min < robot.height
        ]
        for body in scene.objects
        if body.name not in walking
        and moving_links(body)
        and (body.frozen or all(f"{body.name}.{j.name}" in held for j in own_joints(body.joints)))
    }


def _positions(body: SceneObject, held: dict[str, float]) -> list[float]:
    return [
        initial if body.frozen else held.get(f"{body.name}.{joint.name}", initial)
        for joint, initial in zip(body.joints, body.initial, strict=True)
    ]
