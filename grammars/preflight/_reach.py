"""Is there a way from the start to every waypoint, and if not, what is in it?"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
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
from grammars.model.movers import is_mover, own_joints
from grammars.model.robot import Robot
from grammars.model.scene import Doorway, Scene, SceneObject
from grammars.preflight._checked import free_space
from grammars.text.diagnostics import Diagnostic, Severity, Where

_THIN: Final = 0.02
"""Half the width [m] of what is thought to pass any gap."""
_MOST_NAMED: Final = 3
"""So many doors are named, of more how many they are."""
Spot: TypeAlias = tuple[str, Point2, Where]


def check_reach(
    scene: Scene, robot: Robot, points: Sequence[Spot], behaviours: Sequence[Behaviour]
) -> list[Diagnostic]:
    """Return why waypoints cannot be reached; ``points[0]`` is the start.

    The robot is a disc of its inscribed radius. Doors count as open, unless they are frozen or
    held; these only give warnings, since a door that stays shut may be the point of a test.
    """
    radius = inscribed_radius(robot.footprint)
    space = free_space(scene, robot.height)
    parts = space.for_radius(radius)
    home, *waypoints = points
    part = parts.of(home[1])
    if part is None:
        return [_no_room(robot, home)]
    away = [p for p in waypoints if parts.of(p[1]) != part]
    reasons = [
        _no_room(robot, p)
        if parts.of(p[1]) is None
        else _no_way(scene, robot, space, home, p, 2.0 * radius)
        for p in away
    ]
    findings = _once_for_all(zip(away, reasons, strict=True))
    reached = [p for p in waypoints if p not in away]
    shut = immobile_leaves(scene, robot.height, behaviours)
    if shut:
        movers = {body.name for body in scene.objects if is_mover(body.joints)}
        findings.extend(_behind_doors(space, shut, movers, home, reached, radius))
    return findings


def _once_for_all(found: Iterable[tuple[Spot, Diagnostic]]) -> list[Diagnostic]:
    """Return what is wrong with several waypoints for one reason as one finding."""
    reasons: dict[tuple[str, str], list[tuple[Spot, Diagnostic]]] = {}
    for spot, one in found:
        reasons.setdefault((one.message.replace(spot[0], "…"), one.hint), []).append((spot, one))
    return [
        first
        if len(same) == 1
        else replace(
            first, message=first.message.replace(label, f"{label} and {len(same) - 1} more")
        )
        for same in reasons.values()
        for (label, _, _), first in same[:1]
    ]


def _no_room(robot: Robot, spot: Spot) -> Diagnostic:
    label, _, place = spot
    message = f"{label} leaves no room for {robot.name}"
    return Diagnostic(place, message, "a standing part of an object, or a wall, is too near")


def _no_way(
    scene: Scene, robot: Robot, space: FreeSpace, start: Spot, spot: Spot, needed: float
) -> Diagnostic:
    label, point, place = spot
    width = f"{robot.name} is {needed:.2f} m wide"
    # If not even a thread passes, the building is closed there; else something is too narrow.
    if not _connected(space.for_radius(_THIN), start[1], point):
        hint = "an entryway may be missing in the floor plan, or not list both of its walls"
        return Diagnostic(place, f"there is no way from the start to {label}", hint)
    narrow = [
        f"{door.name} ({clear:.2f} m)"
        for door, clear in ((door, _clear_width(scene, door)) for door in scene.doorways)
        if clear < needed and _only_way(space, door, start[1], point)
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
    movers: Container[str],
    start: Spot,
    points: Sequence[Spot],
    radius: float,
) -> list[Diagnostic]:
    parts = space.for_radius(radius, _leaves(shut))
    behind = [p for p in points if not _connected(parts, start[1], p[1])]
    if not behind:
        return []
    ways: dict[frozenset[str], ConnectedParts] = {}

    def open_way(point: Point2, opened: frozenset[str]) -> bool:
        if opened not in ways:
            ways[opened] = space.for_radius(radius, _leaves(shut, opened))
        return _connected(ways[opened], start[1], point)

    findings = []
    for label, point, place in behind:
        # Each shut door is opened alone: one that lets the robot through is the one to name.
        names = [name for name in shut if open_way(point, frozenset({name}))]
        link = "or"
        if not names:
            names, link = _needed(shut, partial(open_way, point)), "and"
        message = f"{label} cannot be reached while {_in_the_way(names, link, movers)}"
        hint = "fine if that is what is tested"
        findings.append(Diagnostic(place, message, hint, Severity.WARNING))
    return findings


def _needed(names: Iterable[str], lets_through: Callable[[frozenset[str]], bool]) -> list[str]:
    """Return doors that have to be open together, of which none could stay shut."""
    opened = frozenset(names)
    for name in names:
        if lets_through(opened - {name}):
            opened -= {name}
    return [name for name in names if name in opened]


def _in_the_way(names: Sequence[str], link: str, movers: Container[str]) -> str:
    """Say that doors stay as told and that movers, who are told nothing, stand there."""
    doors = [name for name in names if name not in movers]
    people = [name for name in names if name in movers]
    several = link == "and"
    said = [
        f"{_listed(group, link)} {many if several and len(group) > 1 else one}"
        for group, one, many in (
            (doors, "stays as told", "stay as told"),
            (people, "stands in the way", "stand in the way"),
        )
        if group
    ]
    return f" {link} ".join(said)


def _listed(names: Sequence[str], link: str) -> str:
    more = len(names) - _MOST_NAMED
    if more > 0:
        return f"{', '.join(names[:_MOST_NAMED])} and {more} more"
    return f" {link} ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def _leaves(
    shut: Mapping[str, Sequence[BaseGeometry]], but: Container[str] = ()
) -> list[BaseGeometry]:
    return [shape for name, shapes in shut.items() if name not in but for shape in shapes]


def immobile_leaves(
    scene: Scene, height: float, behaviours: Sequence[Behaviour]
) -> dict[str, list[BaseGeometry]]:
    """Return outlines of links below ``height`` [m] that could move and never do.

    Those are frozen, held, or movers at rest.
    """
    walking = {b.object for b in behaviours if isinstance(b, Walk)}
    held = {b.joint: b.position for b in behaviours if isinstance(b, Hold)}
    return {
        body.name: [
            link_shape(body, link, _positions(body, held))
            for link in moving_links(body)
            if link.z_min < height
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
