"""Check of the way from the start to every waypoint."""

from __future__ import annotations

from collections.abc import (
    Callable,
    Collection,
    Container,
    Iterable,
    Iterator,
    Mapping,
    Sequence,
)
from functools import partial
from typing import Final

import shapely
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.model.behaviour import Reaction, WaypointReached
from grammars.model.free_space import (
    ConnectedParts,
    FreeSpace,
    inscribed_radius,
    valid_polygon,
)
from grammars.model.geometry import Point2
from grammars.model.movers import is_mover
from grammars.model.robot import Robot
from grammars.model.scene import Doorway
from grammars.preflight._checked import CheckedScene, Footprint, free_space
from grammars.preflight._mission import Spot
from grammars.preflight._walks import resting_places
from grammars.text.words import enumerate_words

_THIN: Final = 0.02
"""Radius [m] of a disc that counts as passing any gap."""
_STEP: Final = 0.03
"""Height [m] above which a threshold stops a robot, as in free space."""
_TOUCHING: Final = 1e-6
"""Area [m²] up to which a wall only touches a room."""
_MOST_NAMES: Final = 3
"""Names of doors in a message at most."""


def check_reach(checked: CheckedScene, robot: Robot, home: Spot, waypoints: Sequence[Spot]) -> None:
    """Report waypoints that cannot be reached from ``home``.

    The robot counts as a disc of its inscribed radius. Doors count as open unless they are frozen
    or held; shut doors give only warnings, since they may be the purpose of a test.
    """
    radius = inscribed_radius(robot.footprint)
    space = free_space(checked.scene, robot.height)
    parts = space.for_radius(radius)
    part = parts.of(home.point)
    if part is None:
        _report(checked, [home], *_no_room(checked, robot, home))
        return
    reached: list[Spot] = []
    away: dict[tuple[str, str], list[Spot]] = {}
    for spot in waypoints:
        there = parts.of(spot.point)
        if there == part:
            reached.append(spot)
        elif there is None:
            away.setdefault(_no_room(checked, robot, spot), []).append(spot)
        else:
            reason = _no_way(checked, robot, space, home.point, spot.point)
            away.setdefault(reason, []).append(spot)
    for reason, spots in away.items():
        _report(checked, spots, *reason)
    shut = checked.shut_below(robot.height) | resting_places(checked, robot.height)
    if shut:
        _check_doors(checked, space, shut, home.point, reached, radius)
    by_label = {spot.label: spot for spot in reached}
    for behaviour in checked.behaviours:
        if not isinstance(behaviour, Reaction) or not isinstance(behaviour.event, WaypointReached):
            continue
        awaited = by_label.get(f"waypoint {behaviour.event.waypoint}")
        start = [p.shape for p in _at_start(checked, behaviour) if p.link.z_min < robot.height]
        if awaited and not _connected(space.for_radius(radius, start), home.point, awaited.point):
            message = f"{behaviour.joint} waits for {awaited.label}, which it keeps out of reach"
            checked.warn(behaviour.joint, message, "let it wait for something in front of it")


def _at_start(checked: CheckedScene, behaviour: Reaction) -> list[Footprint]:
    """Return the movable parts of the object of a behaviour, where they start."""
    name = behaviour.joint.partition(".")[0]
    return [part for part in checked.at_start if part.body.name == name and part.jointed]


def _report(checked: CheckedScene, spots: Sequence[Spot], message: str, hint: str) -> None:
    """Report one problem of several spots."""
    first, *others = spots
    label = f"{first.label} and {len(others)} more" if others else first.label
    checked.error(first.where, message.replace("…", label), hint)


# In the messages, … stands for the spots.


def _no_room(checked: CheckedScene, robot: Robot, spot: Spot) -> tuple[str, str]:
    point, radius = Point(spot.point), inscribed_radius(robot.footprint)
    near = {
        part.body.name: None
        for part in _still_parts(checked, robot)
        if part.shape.distance(point) < radius
    }
    if near:
        message = f"… leaves no room for {robot.name} beside {_listed([*near], 'and')}"
        return message, "move one of them"
    message = f"… leaves no room for {robot.name}"
    return message, "walls are too near on both sides"


def _still_parts(checked: CheckedScene, robot: Robot) -> list[Footprint]:
    """Return the parts of objects in the height of the robot that no joint moves."""
    parts = checked.floor.start
    return [part for part in parts if not part.jointed and part.link.z_min < robot.height]


def _no_way(
    checked: CheckedScene, robot: Robot, space: FreeSpace, start: Point2, goal: Point2
) -> tuple[str, str]:
    """Return message and hint for a place without a way to it."""
    radius = inscribed_radius(robot.footprint)
    needed = 2.0 * radius
    width = f"{robot.name} is {needed:.2f} m wide"
    # If even a thin disc cannot pass, the building is closed; otherwise a passage is too narrow.
    is_closed = not _connected(space.for_radius(_THIN), start, goal)
    if not is_closed:
        narrow = [
            f"{door.name} ({clear:.2f} m)"
            for door in checked.scene.doorways
            if (clear := _clear_width(checked, door)) < needed
            and _only_way(space, door, start, goal)
        ]
        if narrow:
            message = f"the way to … leads through {' and '.join(narrow)}, {width}"
            return message, "widen the doorway or use a narrower robot"
    blocking = {
        reason: hint
        for reason, shape, hint in _obstacles(checked, robot)
        if _connected(ConnectedParts(space.area.union(shape).buffer(-radius)), start, goal)
    }
    if blocking:
        hint = next(iter(blocking.values()))
        message = f"{_listed([*blocking], 'or')} blocks the way to …"
        return message if is_closed else f"{message}, {width}", hint
    if is_closed:
        hint = "an entryway may be missing in the floor plan, or not list both of its walls"
        message = "there is no way from the start to …"
        return message, hint
    message = f"the way to … is too narrow, {width}"
    return message, "look for columns or walls close to each other"


def _obstacles(checked: CheckedScene, robot: Robot) -> Iterator[tuple[str, BaseGeometry, str]]:
    """Yield each thing that may close a way alone, the floor that it takes, and a remedy."""
    for door in checked.scene.doorways:
        passage = valid_polygon(door.footprint).buffer(_THIN)
        if door.z_min > _STEP:
            reason = f"{door.name}, which begins {door.z_min:.2f} m above the floor,"
            yield reason, passage, "z of an entryway is the height of its middle"
        elif door.z_max < robot.height:
            reason = f"{door.name}, which ends {door.z_max:.2f} m above the floor,"
            yield reason, passage, f"make it higher: {robot.name} is {robot.height:.2f} m high"
    spaces = checked.scene.regions
    rooms = shapely.union_all([valid_polygon(space.outline, space.holes) for space in spaces])
    low = [(part.body.name, part.shape) for part in _still_parts(checked, robot)]
    solids = checked.floor.solids
    low += [
        (solid.owner, shape)
        for solid, shape in zip(solids.solids, solids.shapes, strict=True)
        if solid.z_min < robot.height
    ]
    taken: dict[str, list[BaseGeometry]] = {}
    for name, shape in low:
        inside = shape.intersection(rooms)
        if inside.area > _TOUCHING:
            taken.setdefault(name, []).append(inside)
    for name, shapes in taken.items():
        yield name, shapely.union_all(shapes), "move it, or make room beside it"


def _only_way(space: FreeSpace, door: Doorway, a: Point2, b: Point2) -> bool:
    """Return whether all ways from ``a`` to ``b`` lead through ``door``."""
    blocked = Polygon(door.footprint).buffer(_THIN)
    return not _connected(space.for_radius(_THIN, [blocked]), a, b)


def _connected(parts: ConnectedParts, a: Point2, b: Point2) -> bool:
    first = parts.of(a)
    return first is not None and first == parts.of(b)


def _clear_width(checked: CheckedScene, door: Doorway) -> float:
    """Return the width of a doorway between its posts [m]."""
    passage = Polygon(door.footprint)
    to_local = door.frame.inverse()
    width = 0.0
    for part in checked.floor.start:
        if part.body.doorway == door.name and not part.jointed:
            post = part.shape.intersection(passage)
            xs = [to_local.apply((x, y))[0] for x, y in shapely.get_coordinates(post).tolist()]
            width += max(xs) - min(xs) if xs else 0.0
    return door.width - width


def _check_doors(
    checked: CheckedScene,
    space: FreeSpace,
    shut: Mapping[str, Sequence[BaseGeometry]],
    start: Point2,
    spots: Iterable[Spot],
    radius: float,
) -> None:
    """Report spots behind doors that stay shut, with the doors that would have to open."""
    ways: dict[frozenset[str], ConnectedParts] = {}

    def has_way(goal: Point2, opened: frozenset[str]) -> bool:
        if opened not in ways:
            closed = [s for name, shapes in shut.items() if name not in opened for s in shapes]
            ways[opened] = space.for_radius(radius, closed)
        return _connected(ways[opened], start, goal)

    movers = {body.name for body in checked.scene.objects if is_mover(body.joints)}
    for label, point, where in spots:
        if has_way(point, frozenset()):
            continue
        # Look for single doors that open the way, otherwise for several.
        names = [name for name in shut if has_way(point, frozenset({name}))]
        link = "or"
        if not names:
            names, link = _needed(shut, partial(has_way, point)), "and"
        message = f"{label} cannot be reached while {_in_the_way(names, link, movers)}"
        checked.warn(where, message, "ignore this if it is the purpose of the test")


def _needed(names: Collection[str], lets_through: Callable[[frozenset[str]], bool]) -> list[str]:
    """Return a minimal set of doors that must be open together."""
    opened = frozenset(names)
    for name in names:
        if lets_through(opened - {name}):
            opened -= {name}
    return [name for name in names if name in opened]


def _in_the_way(names: Sequence[str], link: str, movers: Container[str]) -> str:
    """Return a phrase about shut doors and standing movers."""
    doors = [name for name in names if name not in movers]
    people = [name for name in names if name in movers]
    several = link == "and"
    parts = [
        f"{_listed(group, link)} {many if several and len(group) > 1 else one}"
        for group, one, many in (
            (doors, "stays shut", "stay shut"),
            (people, "stands in the way", "stand in the way"),
        )
        if group
    ]
    return f" {link} ".join(parts)


def _listed(names: Sequence[str], link: str) -> str:
    more = len(names) - _MOST_NAMES
    if more > 0:
        return f"{', '.join(names[:_MOST_NAMES])} and {more} more"
    return enumerate_words(names, link)
