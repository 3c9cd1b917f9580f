"""Checks of movers: routes through walls and furniture, and movers that stand in a wall."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from typing import Final

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.model.behaviour import Walk
from grammars.model.free_space import (
    hulls_between,
    is_overlap,
    link_shapes,
    moving_links,
    swept_pieces,
)
from grammars.model.geometry import Pose2
from grammars.model.movers import CORNER, PLANAR_JOINTS, Route, is_mover
from grammars.model.robot import Robot
from grammars.model.scene import Link, SceneObject
from grammars.preflight._checked import CheckedScene, Footprint
from grammars.preflight._parts import check_inside, check_starts

_ROUTE_STEP: Final = 0.1
_SAME_PLACE: Final = 0.05
"""Distance [m] up to which a walk begins where its mover stands."""
_STRAIGHT: Final = 1e-9
_TURN_STEPS: Final = 46
"""Placements of a mover that turns round: 4 degrees apart, like those of leaves."""


def check_walks(checked: CheckedScene, robot: Robot, start: Polygon) -> None:
    """Report problems of the routes of movers; ``start`` is the robot's body at the start.

    Errors: walks of frozen movers, walks that begin elsewhere than their mover stands, points
    inside a wall or outside all rooms, routes through a wall, movers that stand in one. Warnings:
    bodies that touch a wall, walk through still objects (including shut doors), walk over the
    start without yielding or rest outside the building.
    """
    bodies = {body.name: body for body in checked.scene.objects}
    walks = [walk for walk in checked.behaviours if isinstance(walk, Walk)]
    walking = {walk.object for walk in walks}
    resting = [b for b in bodies.values() if is_mover(b.joints) and b.name not in walking]
    check_starts(checked, resting)
    check_inside(checked, resting)
    for walk in walks:
        body = bodies[walk.object]
        if body.frozen:
            checked.error(walk.joint, f"{body.name} cannot walk, it is frozen")
        # A route with a wrong point needs no further checks.
        elif _check_points(checked, body, walk):
            _check_way(checked, body, walk)
            _check_begin(checked, body, walk)
            _check_crossing(checked, body, walk, robot, start)


def _check_begin(checked: CheckedScene, body: SceneObject, walk: Walk) -> None:
    """Report a walk that begins elsewhere than its mover stands."""
    (x, y), (to_x, to_y) = body.pose.apply((body.initial[0], body.initial[1])), walk.route[0]
    away = math.dist((x, y), (to_x, to_y))
    if away > _SAME_PLACE:
        message = (
            f"{body.name} stands at ({x:.2f}, {y:.2f}), but its walk begins at "
            f"({to_x:.2f}, {to_y:.2f}), {away:.2f} m away"
        )
        hint = f"begin the route where it stands, or place it there: {checked.place(body.name)}"
        checked.error(walk.joint, message, hint)


def _check_crossing(
    checked: CheckedScene, body: SceneObject, walk: Walk, robot: Robot, start: Polygon
) -> None:
    """Warn of a walk over the start of a robot to which it does not yield."""
    if walk.yielding is None and any(
        part.link.z_min < robot.height and is_overlap(part.shape.intersection(start))
        for part in _swept_by_walk(checked, body, walk)
    ):
        message = f"{body.name} walks over the start of {robot.name}"
        checked.warn(walk.joint, message, "let it yield, or lead its route round the start")


def resting_places(checked: CheckedScene, height: float) -> dict[str, list[BaseGeometry]]:
    """Return the outlines below ``height`` [m] of movers where they end their walks, by name."""
    walks = {b.object: b for b in checked.behaviours if isinstance(b, Walk) and b.manner == "once"}
    places = {}
    for body in checked.scene.objects:
        if body.name in walks and not body.frozen:
            home, end = _at_home(body), _walked_poses(walks[body.name])[-1]
            shapes = link_shapes(home, (end.x, end.y, end.yaw, *home.initial[3:]))
            low = (link for link in moving_links(body) if link.z_min < height)
            places[body.name] = [shapes[link.name] for link in low]
    return places


def _check_points(checked: CheckedScene, body: SceneObject, walk: Walk) -> bool:
    """Report points of a route inside walls or outside rooms; return whether all are valid."""
    _, high = _heights(body)
    sound = True
    for number, point in enumerate(walk.route, start=1):
        label = f"point {number} of the route of {body.name} ({point[0]:g}, {point[1]:g})"
        distance, owner = checked.floor.solids.nearest(*point, z_max=high)
        if distance == 0.0:
            checked.error(walk.joint, f"{label} is inside {owner}", "move it")
            sound = False
        elif not checked.floor.holds(point):
            hint = "check its frame and the signs of x and y"
            checked.error(walk.joint, f"{label} is outside all rooms", hint)
            sound = False
    return sound


def _heights(body: SceneObject) -> tuple[float, float]:
    links = [link for link in body.links if link.polygons]
    return min(link.z_min for link in links), max(link.z_max for link in links)


def _check_way(checked: CheckedScene, body: SceneObject, walk: Walk) -> None:
    ends = [*walk.route, walk.route[0]] if walk.manner == "round" else walk.route
    through = checked.floor.solids.hit_by(LineString(ends), *_heights(body))
    if through:
        message = f"{body.name} walks through {' and '.join(through)}"
        checked.error(walk.joint, message, "lead the route through a doorway")
        return
    swept = _swept_by_walk(checked, body, walk)
    walls = [owner for part in swept for owner in checked.walls_at(part)]
    # Doors that never move count as furniture.
    still = [part for part in checked.floor.start if not part.jointed]
    still += [p for parts in checked.shut.values() for p in parts if not is_mover(p.body.joints)]
    near = {s.body.name for part in swept for s in still if s.body is not body and part.meets(s)}
    crossed = [other.name for other in checked.scene.objects if other.name in near]
    for verb, names in (("brushes", walls), ("walks through", crossed)):
        if names:
            message = f"{body.name} {verb} {' and '.join(dict.fromkeys(names))} on its way"
            hint = "only the robot stops a mover: move the route"
            checked.warn(walk.joint, message, hint)


def _swept_by_walk(checked: CheckedScene, body: SceneObject, walk: Walk) -> list[Footprint]:
    """Return the swept footprints of the links of a mover during its walk.

    Its other joints take all positions between their start and the targets of behaviours.
    """
    at_home = _at_home(body)
    starts = dict(zip((joint.name for joint in body.joints), at_home.initial, strict=True))
    ranges = tuple(
        (name, min(starts[name], low), max(starts[name], high))
        for name, (low, high) in checked.ranges.get(body.name, {}).items()
        if name in starts
    )
    return [
        Footprint(body, link, _walked_area(at_home, link, ranges, walk), jointed=True)
        for link in moving_links(body)
    ]


def _at_home(body: SceneObject) -> SceneObject:
    """Return a mover with its body at the origin of the world."""
    initial = (*(0.0 for _ in PLANAR_JOINTS), *body.initial[3:])
    return dataclasses.replace(body, pose=Pose2(), initial=initial)


# Most points of a search do not change walks.
@functools.lru_cache(maxsize=64)
def _walked_area(
    at_home: SceneObject, link: Link, ranges: tuple[tuple[str, float, float], ...], walk: Walk
) -> BaseGeometry:
    poses = _without_straight(_walked_poses(walk))
    # The pieces are convex, as hulls_between requires.
    pieces = swept_pieces(at_home, link, {name: (low, high) for name, low, high in ranges})
    rings = map(shapely.get_coordinates, pieces)
    hulls = [hull for ring in rings for hull in hulls_between(poses, ring[:-1].tolist())]
    return shapely.union_all(hulls)


def _walked_poses(walk: Walk) -> list[Pose2]:
    """Return the poses of a walking body, there and back, close to each other."""
    route = Route(walk)
    # A round turns in its first corner only at the end of a lap.
    length = route.length + (CORNER if route.closed else 0.0)
    ways = np.linspace(0.0, length, max(2, int(length / _ROUTE_STEP) + 1)).tolist()
    forward = [Pose2(*route.point(way), route.yaw(way)) for way in ways]
    if walk.manner != "back-and-forth" or walk.facing != "ahead":
        return forward
    turns = [Pose2(yaw=float(yaw)) for yaw in np.linspace(0.0, math.pi, _TURN_STEPS)]
    back = [pose @ turns[-1] for pose in reversed(forward)]
    first, last = forward[0], forward[-1]
    return [
        *forward,
        *(last @ turn for turn in turns),
        *back,
        *(first @ turn for turn in reversed(turns)),
    ]


def _without_straight(poses: list[Pose2]) -> list[Pose2]:
    """Return the poses without those inside straight segments, which the hull of both ends covers.

    The union of many hulls takes most of the time of these checks.
    """
    turning = [poses[0]]
    for pose, following in itertools.pairwise(poses[1:]):
        way, step = turning[-1].inverse() @ pose, pose.inverse() @ following
        is_straight = abs(way.x * step.y - way.y * step.x) <= _STRAIGHT
        goes_on = way.x * step.x + way.y * step.y >= 0.0
        if not (is_straight and goes_on and way.yaw == step.yaw == 0.0):
            turning.append(pose)
    return [*turning, poses[-1]]
