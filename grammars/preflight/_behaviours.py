"""Checks of behaviours that move about or wait: routes through walls, events that never come."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.model.behaviour import (
    Behaviour,
    Event,
    Hold,
    JointActs,
    LegBegins,
    Reaction,
    Trigger,
    Walk,
    WaypointReached,
)
from grammars.model.free_space import (
    SNAP_DISTANCE,
    hulls_between,
    inscribed_radius,
    is_overlap,
    link_shape,
    moving_links,
    still_links,
    swept_area,
    swept_pieces,
    valid_polygon,
)
from grammars.model.geometry import Pose2, Ring
from grammars.model.kinematics import WORLD
from grammars.model.mission import Mission
from grammars.model.movers import CORNER, PLANAR_JOINTS, Route, is_fixed, is_mover, own_joints
from grammars.model.robot import Robot
from grammars.model.scene import Link, Scene, SceneObject
from grammars.preflight._checked import CheckedScene, free_space
from grammars.preflight._reach import immobile_leaves
from grammars.preflight._standing import check_inside
from grammars.preflight._sweeps import starts_in_wall
from grammars.text.diagnostics import Diagnostic, Severity, Where, did_you_mean

_ROUTE_STEP: Final = 0.1
_TURN_STEPS: Final = 46
"""Placements of a mover that turns round: 4 degrees apart, as leaves are swept."""


def check_walks(checked: CheckedScene, behaviours: Sequence[Behaviour]) -> list[Diagnostic]:
    """Return what is wrong with the routes of movers.

    Errors: walks of what is no mover, points inside of a wall or outside of every room, ways that
    lead through a wall, movers that stand in one. Warnings: bodies that brush a wall, or walk
    through what stands still, doors that stay as told included, or rest outside of the building.
    """
    bodies = {body.name: body for body in checked.scene.objects}
    walking = {walk.object for walk in behaviours if isinstance(walk, Walk)}
    resting = [
        body for body in checked.scene.objects if is_mover(body.joints) and body.name not in walking
    ]
    findings = [problem for body in resting for problem in starts_in_wall(checked, body)]
    findings += check_inside(checked, resting)
    for walk in behaviours:
        if not isinstance(walk, Walk):
            continue
        place = checked.place(walk.joint)
        body = bodies.get(walk.object)
        if body is None:
            hint = did_you_mean(walk.object, bodies)
            findings.append(Diagnostic(place, f'there is no object "{walk.object}"', hint))
        elif body.frozen or not is_mover(body.joints):
            why = "frozen" if body.frozen else "an object, not a mover"
            findings.append(Diagnostic(place, f"{body.name} cannot walk, it is {why}"))
        else:
            findings.extend(_check_route(checked, body, walk, place, behaviours))
    return findings


def _check_route(
    checked: CheckedScene,
    body: SceneObject,
    walk: Walk,
    place: Where,
    behaviours: Sequence[Behaviour],
) -> list[Diagnostic]:
    low = min(link.z_min for link in body.links if link.polygons)
    high = max(link.z_max for link in body.links if link.polygons)
    rooms = [valid_polygon(r.outline) for r in checked.scene.regions]
    rooms.extend(valid_polygon(d.footprint).buffer(0.02) for d in checked.scene.doorways)
    findings = []
    for number, point in enumerate(walk.route, start=1):
        label = f"point {number} of the route of {body.name} ({point[0]:g}, {point[1]:g})"
        distance, owner = checked.obstacles.nearest(*point, z_max=high)
        if distance == 0.0:
            findings.append(Diagnostic(place, f"{label} is inside of {owner}", "move it"))
        elif not any(room.covers(Point(point)) for room in rooms):
            hint = "check its frame and the signs of x and y"
            findings.append(Diagnostic(place, f"{label} is outside of every room", hint))
    # A way from a point that is wrong says nothing new.
    return findings or _check_way(checked, body, walk, place, (low, high), behaviours)


def _check_way(
    checked: CheckedScene,
    body: SceneObject,
    walk: Walk,
    place: Where,
    heights: tuple[float, float],
    behaviours: Sequence[Behaviour],
) -> list[Diagnostic]:
    ends = [*walk.route, walk.route[0]] if walk.manner == "round" else walk.route
    through = list(checked.obstacles.hit_by(LineString(ends), *heights))
    if through:
        message = f"{body.name} walks through {' and '.join(through)}"
        return [Diagnostic(place, message, "lead the route through a doorway")]
    walked = [(link, _walked_area(body, link, walk, behaviours)) for link in moving_links(body)]
    brushed = [
        owner
        for link, area in walked
        for owner, part in checked.obstacles.hit_by(area, link.z_min, link.z_max).items()
        if is_overlap(part)
    ]
    met = [
        name for link, area in walked for name in _met(checked.scene, body, link, area, behaviours)
    ]
    return [
        Diagnostic(
            place,
            f"{body.name} {what} {' and '.join(dict.fromkeys(names))} on its way",
            "nothing stops a mover but the robot: move the route",
            Severity.WARNING,
        )
        for what, names in (("brushes", brushed), ("walks through", met))
        if names
    ]


def _met(
    scene: Scene,
    body: SceneObject,
    link: Link,
    area: BaseGeometry,
    behaviours: Sequence[Behaviour],
) -> list[str]:
    """Return the objects of which something stands still where ``link`` of a mover walks."""
    shut = immobile_leaves(scene, link.z_max, behaviours)
    met = []
    for other in scene.objects:
        standing = [
            link_shape(other, part, other.initial)
            for part in still_links(other)
            if part.z_min < link.z_max and part.z_max > link.z_min
        ]
        # Doors that never move are as still as furniture.
        if not is_mover(other.joints):
            standing += shut.get(other.name, ())
        if other is not body and any(is_overlap(area.intersection(s)) for s in standing):
            met.append(other.name)
    return met


def _walked_area(
    body: SceneObject, link: Link, walk: Walk, behaviours: Sequence[Behaviour]
) -> BaseGeometry:
    """Return the floor that ``link`` of a mover covers while its body walks the route."""
    poses = _walked_poses(walk)
    rings = _walking_rings(body, link, behaviours)
    return shapely.union_all([hull for ring in rings for hull in hulls_between(poses, ring)])


def _walked_poses(walk: Walk) -> list[Pose2]:
    """Return the poses of a walking body, there and back, close to each other."""
    route = Route(walk)
    # A round turns in its first corner only when it comes there again.
    length = route.length + (CORNER if route.closed else 0.0)
    ways = np.linspace(0.0, length, max(2, int(length / _ROUTE_STEP) + 1)).tolist()
    forward = [Pose2(*route.point(way), route.yaw(way)) for way in ways]
    if walk.manner != "back-and-forth" or walk.facing != "ahead":
        return forward
    turns = [Pose2(yaw=float(turned)) for turned in np.linspace(0.0, math.pi, _TURN_STEPS)]
    back = [pose @ turns[-1] for pose in reversed(forward)]
    first, last = forward[0], forward[-1]
    return [
        *forward,
        *(last @ turn for turn in turns),
        *back,
        *(first @ turn for turn in reversed(turns)),
    ]


def _walking_rings(body: SceneObject, link: Link, behaviours: Sequence[Behaviour]) -> list[Ring]:
    """Return what ``link`` covers in the frame of the body that walks, as convex outlines.

    Those at the start, and those on the way to where behaviours send the joints in between.
    """
    at_home = dataclasses.replace(
        body, pose=Pose2(), initial=(*(0.0 for _ in PLANAR_JOINTS), *body.initial[3:])
    )
    ranges = {}
    for behaviour in behaviours:
        if isinstance(behaviour, Walk):
            continue
        for joint, start in zip(body.joints, at_home.initial, strict=True):
            if behaviour.joint == f"{body.name}.{joint.name}":
                sent = (start, *behaviour.positions)
                ranges[joint.name] = (min(sent), max(sent))
    return [
        tuple((float(x), float(y)) for x, y in shapely.get_coordinates(piece)[:-1])
        for piece in swept_pieces(at_home, link, ranges)
    ]


_WaitingBehaviour: TypeAlias = Reaction | Walk


def check_events(
    checked: CheckedScene, mission: Mission, behaviours: Sequence[Behaviour]
) -> list[Diagnostic]:
    """Return errors for events that name what is not there, warnings for those that never come."""
    waiting = [(b, b.event) for b in behaviours if isinstance(b, Reaction | Walk) and b.event]
    unknown = {
        behaviour.joint: _unknown_names(
            checked.scene, mission, event, checked.place(behaviour.joint)
        )
        for behaviour, event in waiting
    }
    findings = [problem for problems in unknown.values() for problem in problems]
    return findings + [
        Diagnostic(
            checked.place(behaviour.joint),
            f"{_name(behaviour)} waits for {_event_text(event)}, which never happens",
            "say what makes it happen, or wait for something else",
            Severity.WARNING,
        )
        for behaviour, event in _never_coming(checked.scene, behaviours)
        if not unknown[behaviour.joint]
    ]


def _name(behaviour: _WaitingBehaviour) -> str:
    return behaviour.object if isinstance(behaviour, Walk) else behaviour.joint


def _event_text(event: JointActs) -> str:
    act = "fire" if event.act == "fires" else "move"
    return f"{' or '.join(event.joints)} to {act}"


def _unknown_names(scene: Scene, mission: Mission, event: Event, place: Where) -> list[Diagnostic]:
    ids = [waypoint.id for waypoint in mission.waypoints]
    if isinstance(event, LegBegins) and not 1 <= event.leg <= len(ids):
        message = f"there is no leg {event.leg}, mission {mission.name} has {len(ids)}"
        return [Diagnostic(place, message, "legs are counted from 1")]
    if isinstance(event, WaypointReached) and event.waypoint not in ids:
        message = f'mission {mission.name} has no waypoint "{event.waypoint}"'
        return [Diagnostic(place, message, did_you_mean(event.waypoint, ids))]
    if isinstance(event, JointActs):
        known = scene.joint_names
        return [
            Diagnostic(place, f'there is no joint "{name}" in the scene', did_you_mean(name, known))
            for name in event.joints
            if name not in known
        ]
    return []


def _never_coming(
    scene: Scene, behaviours: Sequence[Behaviour]
) -> list[tuple[_WaitingBehaviour, JointActs]]:
    """Return who waits for what cannot come; those who wait in a circle wait for ever."""
    movable = _movable(scene, behaviours)
    fires = {b.joint for b in behaviours if isinstance(b, Trigger)}
    waiting = [b for b in behaviours if isinstance(b, Reaction | Walk)]
    # What comes may set off more: until nothing new comes.
    while True:
        coming = [b for b in waiting if _can_come(b.event, fires, movable)]
        waiting = [b for b in waiting if b not in coming]
        if not coming:
            return [(b, b.event) for b in waiting if isinstance(b.event, JointActs)]
        fires |= {b.joint for b in coming if isinstance(b, Reaction)}
        movable |= {joint for b in coming if isinstance(b, Walk) for joint in b.joints}


def _can_come(event: Event | None, fires: set[str], movable: set[str]) -> bool:
    if not isinstance(event, JointActs):
        return True
    return not (fires if event.act == "fires" else movable).isdisjoint(event.joints)


def _movable(scene: Scene, behaviours: Sequence[Behaviour]) -> set[str]:
    """Return the joints that a behaviour or the robot can move, those of movers left out."""
    held = {b.joint for b in behaviours if isinstance(b, Hold)}
    return {
        f"{body.name}.{joint.name}"
        for body in scene.objects
        if not body.frozen
        for joint in own_joints(body.joints)
    } - held


def check_triggers(
    checked: CheckedScene, robot: Robot, mission: Mission, behaviours: Sequence[Behaviour]
) -> list[Diagnostic]:
    """Return a warning for every trigger whose distance the robot can never get down to.

    The robot is a disc of its inscribed radius that goes wherever there is a way from its start,
    through all doors that are not held shut: what is said never to happen never does.
    """
    triggers = [b for b in behaviours if isinstance(b, Trigger)]
    if not triggers:
        return []
    scene = checked.scene
    shut = [
        s for shapes in immobile_leaves(scene, robot.height, behaviours).values() for s in shapes
    ]
    parts = free_space(scene, robot.height).for_radius(inscribed_radius(robot.footprint), shut)
    home_part = parts.of((mission.start.x, mission.start.y))
    if home_part is None:
        return []
    radius = max(math.hypot(*corner) for corner in robot.footprint)
    findings = []
    for trigger in triggers:
        measured = _measured_from(scene, trigger)
        # Bounds in favour of the trigger: it is said to never fire only when that is certain.
        nearest = measured.distance(parts.parts[home_part]) - SNAP_DISTANCE
        if trigger.to == "footprint":
            nearest -= radius
        if nearest >= trigger.distance:
            point = f"{trigger.joint.partition('.')[0]}'s {trigger.of}"
            message = f"{trigger.joint} never fires: {robot.name} gets no nearer to {point}"
            findings.append(
                Diagnostic(
                    checked.place(trigger.joint),
                    f"{message} than {nearest:.2f} m, it must be within {trigger.distance:g} m",
                    "take a larger distance, or look for what is in the way",
                    Severity.WARNING,
                )
            )
    return findings


def _measured_from(scene: Scene, trigger: Trigger) -> BaseGeometry:
    """Return where the distance of a trigger is measured from, wherever its joint may be."""
    name, _, joint_name = trigger.joint.partition(".")
    body = next(b for b in scene.objects if b.name == name)
    joint = next(j for j in body.joints if j.name == joint_name)
    if trigger.of == "doorway":
        doorway = next(d for d in scene.doorways if d.name == body.doorway)
        return Polygon(doorway.footprint).centroid
    ranges = {j.name: (j.lower, j.upper) for j in body.joints if not is_fixed(j)}
    if trigger.of == "leaf":
        link = next(part for part in body.links if part.name == joint.child)
        return swept_area(body, link, ranges)
    if joint.parent == WORLD or joint.parent in {part.name for part in still_links(body)}:
        hinge = joint.kind == "revolute" and trigger.of == "hinge"
        foot = joint.anchor if hinge else (0.0, 0.0)
        return Point(body.pose.apply(foot))
    link = next(part for part in body.links if part.name == joint.parent)
    return swept_area(body, link, ranges)
