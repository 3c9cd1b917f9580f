"""Behaviours that wait for something: can it happen?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.behaviour import (
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
from grammars.diagnostics import Diagnostic, Severity, Where, did_you_mean
from grammars.kinematics import WORLD
from grammars.mission import Mission
from grammars.movers import is_fixed, own_joints
from grammars.preflight.free_space import SNAP, FreeSpace, inscribed_radius
from grammars.preflight.places import place_of
from grammars.preflight.reach import standing_leaves
from grammars.preflight.sweep import still_links, swept
from grammars.robot import Robot
from grammars.scene import Scene

_Waiting: TypeAlias = Reaction | Walk


def check_events(
    scene: Scene,
    mission: Mission,
    behaviours: Sequence[Behaviour],
    places: Mapping[str, Where],
    home: Where,
) -> list[Diagnostic]:
    """Return errors for events that name what is not there, warnings for those that never come."""
    waiting = [(b, b.event) for b in behaviours if isinstance(b, Reaction | Walk) and b.event]
    unknown = {
        behaviour.joint: _unknown(scene, mission, event, place_of(places, behaviour.joint, home))
        for behaviour, event in waiting
    }
    findings = [problem for problems in unknown.values() for problem in problems]
    return findings + [
        Diagnostic(
            place_of(places, behaviour.joint, home),
            f"{_name(behaviour)} waits for {_spelled(event)}, which never happens",
            "say what makes it happen, or wait for something else",
            Severity.WARNING,
        )
        for behaviour, event in _never(scene, behaviours)
        if not unknown[behaviour.joint]
    ]


def _name(behaviour: _Waiting) -> str:
    return behaviour.object if isinstance(behaviour, Walk) else behaviour.joint


def _spelled(event: JointActs) -> str:
    act = "fire" if event.act == "fires" else "move"
    return f"{' or '.join(event.joints)} to {act}"


def _unknown(scene: Scene, mission: Mission, event: Event, place: Where) -> list[Diagnostic]:
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


def _never(scene: Scene, behaviours: Sequence[Behaviour]) -> list[tuple[_Waiting, JointActs]]:
    """Return who waits for what cannot come; those who wait in a circle wait for ever."""
    movable = _movable(scene, behaviours)
    fires = {b.joint for b in behaviours if isinstance(b, Trigger)}
    waiting = [b for b in behaviours if isinstance(b, Reaction | Walk)]
    while True:
        coming = [b for b in waiting if _comes(b.event, fires, movable)]
        waiting = [b for b in waiting if b not in coming]
        if not coming:
            return [(b, b.event) for b in waiting if isinstance(b.event, JointActs)]
        fires |= {b.joint for b in coming if isinstance(b, Reaction)}
        movable |= {joint for b in coming if isinstance(b, Walk) for joint in b.joints}


def _comes(event: Event | None, fires: set[str], movable: set[str]) -> bool:
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
    scene: Scene,
    robot: Robot,
    mission: Mission,
    behaviours: Sequence[Behaviour],
    places: Mapping[str, Where],
    home: Where,
) -> list[Diagnostic]:
    """Return a warning for every trigger whose distance the robot can never get down to.

    The robot is a disc of its inscribed radius that goes wherever there is a way from its start,
    through all doors that are not held shut: what is said never to happen never does.
    """
    triggers = [b for b in behaviours if isinstance(b, Trigger)]
    if not triggers:
        return []
    shut = [s for shapes in standing_leaves(scene, robot, behaviours).values() for s in shapes]
    parts = FreeSpace(scene, robot.height).for_radius(inscribed_radius(robot.footprint), shut)
    home_part = parts.of((mission.start.x, mission.start.y))
    if home_part is None:
        return []
    radius = max(math.hypot(*corner) for corner in robot.footprint)
    findings = []
    for trigger in triggers:
        measured = _measured_from(scene, trigger)
        nearest = measured.distance(parts.parts[home_part]) - SNAP
        if trigger.to == "footprint":
            nearest -= radius
        if nearest >= trigger.distance:
            point = f"{trigger.joint.partition('.')[0]}'s {trigger.of}"
            message = f"{trigger.joint} never fires: {robot.name} gets no nearer to {point}"
            findings.append(
                Diagnostic(
                    place_of(places, trigger.joint, home),
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
        return swept(body, link, ranges)
    if joint.parent == WORLD or joint.parent in {part.name for part in still_links(body)}:
        hinge = joint.kind == "revolute" and trigger.of == "hinge"
        foot = joint.anchor if hinge else (0.0, 0.0)
        return Point(body.pose.apply(foot))
    link = next(part for part in body.links if part.name == joint.parent)
    return swept(body, link, ranges)
