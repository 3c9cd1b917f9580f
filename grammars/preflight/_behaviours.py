"""Checks of behaviours: joints that cannot follow, events and triggers that never come."""

from __future__ import annotations

import math
from typing import Final, TypeAlias

from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.model.behaviour import (
    Event,
    Hold,
    JointActs,
    KeyFrames,
    LegBegins,
    Reaction,
    Trigger,
    Walk,
    WaypointReached,
)
from grammars.model.free_space import (
    SNAP_DISTANCE,
    inscribed_radius,
    moving_links,
    swept_area,
)
from grammars.model.mission import Mission
from grammars.model.movers import PLANAR_JOINTS, is_fixed, is_mover, own_joints
from grammars.model.robot import Robot
from grammars.model.scene import Joint, Scene, SceneObject
from grammars.preflight._checked import CheckedScene, free_space
from grammars.text.diagnostics import Findings, Where, did_you_mean

_TOLERANCE: Final = 1e-9
_WaitingBehaviour: TypeAlias = Reaction | Walk


def check_behaviours(checked: CheckedScene) -> bool:
    """Find joints that are unknown, frozen, told twice or sent out of their limits.

    Returns whether all behaviours can be followed.
    """
    joints = {f"{b.name}.{j.name}": (b, j) for b in checked.scene.objects for j in b.joints}
    problems = Findings()
    served: set[str] = set()
    for behaviour in checked.behaviours:
        name, where = behaviour.joint, checked.place(behaviour.joint)
        walks = isinstance(behaviour, Walk)
        if not walks and name not in joints:
            message = f'there is no joint "{name}" in the scene'
            problems.error(where, message, did_you_mean(name, joints))
            continue
        moved = behaviour.joints if isinstance(behaviour, Walk) else (name,)
        if not served.isdisjoint(moved):
            subject = behaviour.object if isinstance(behaviour, Walk) else name
            problems.error(where, f"{subject} has two behaviours", "one must go")
        served.update(moved)
        if not isinstance(behaviour, Walk):
            _check_behaviour(problems, where, behaviour, *joints[name])
    checked.findings.add(problems.all)
    return not problems.all


def _check_behaviour(
    problems: Findings,
    where: Where,
    behaviour: Hold | KeyFrames | Trigger | Reaction,
    body: SceneObject,
    joint: Joint,
) -> None:
    """Find why a joint cannot follow its behaviour."""
    name, positions = behaviour.joint, behaviour.positions
    initial = body.initial[body.joints.index(joint)]
    holds = isinstance(behaviour, Hold)
    moves = not holds or any(abs(q - initial) > _TOLERANCE for q in positions)
    if body.frozen and moves:
        message = f"{name} is to move, but {body.name} is frozen"
        problems.error(where, message, "leave out frozen, or the behaviour")
        return
    if is_mover(body.joints) and joint.name in PLANAR_JOINTS and not holds:
        problems.error(where, f"{name} belongs to a mover", f"let {body.name} walk")
        return
    for q in dict.fromkeys(positions):
        if not joint.lower - _TOLERANCE <= q <= joint.upper + _TOLERANCE:
            message = f"{name} is sent to {q:g}, outside of its limits"
            problems.error(where, message, f"between {joint.lower:g} and {joint.upper:g}")
    if not body.frozen and joint.upper - joint.lower < _TOLERANCE and not holds:
        problems.error(where, f"{name} is to move, but its limits leave no room")
    if isinstance(behaviour, Trigger) and behaviour.of == "doorway" and not body.doorway:
        message = f"{name} measures from its doorway, but {body.name} stands in none"
        problems.error(where, message, "measure from its hinge or leaf")


def check_events(checked: CheckedScene, mission: Mission) -> None:
    """Find events that name what is not there, and those that never come."""
    waiting = [b for b in checked.behaviours if isinstance(b, Reaction | Walk) and b.event]
    sound = {b.joint for b in waiting if _check_names(checked, mission, b)}
    for behaviour, event in _never_coming(checked):
        if behaviour.joint in sound:
            name = behaviour.object if isinstance(behaviour, Walk) else behaviour.joint
            acts = f"{' or '.join(event.joints)} to {'fire' if event.act == 'fires' else 'move'}"
            message = f"{name} waits for {acts}, which never happens"
            hint = "say what makes it happen, or wait for something else"
            checked.warn(behaviour.joint, message, hint)


def _check_names(checked: CheckedScene, mission: Mission, waiting: _WaitingBehaviour) -> bool:
    """Find what an event names that is not there; return whether there is all of it."""
    event, ids = waiting.event, [waypoint.id for waypoint in mission.waypoints]
    known = checked.scene.joint_names
    if isinstance(event, LegBegins) and not 1 <= event.leg <= len(ids):
        message = f"there is no leg {event.leg}, mission {mission.name} has {len(ids)}"
        checked.error(waiting.joint, message, "legs are counted from 1")
        return False
    if isinstance(event, WaypointReached) and event.waypoint not in ids:
        message = f'mission {mission.name} has no waypoint "{event.waypoint}"'
        checked.error(waiting.joint, message, did_you_mean(event.waypoint, ids))
        return False
    joints = event.joints if isinstance(event, JointActs) else ()
    unknown = [name for name in joints if name not in known]
    for name in unknown:
        message = f'there is no joint "{name}" in the scene'
        checked.error(waiting.joint, message, did_you_mean(name, known))
    return not unknown


def _never_coming(checked: CheckedScene) -> list[tuple[_WaitingBehaviour, JointActs]]:
    """Return who waits for what cannot come; those who wait in a circle wait for ever."""
    movable = _movable(checked)
    fires = {b.joint for b in checked.behaviours if isinstance(b, Trigger)}
    waiting = [b for b in checked.behaviours if isinstance(b, Reaction | Walk)]
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


def _movable(checked: CheckedScene) -> set[str]:
    """Return the joints that a behaviour or the robot can move, those of movers left out."""
    held = {b.joint for b in checked.behaviours if isinstance(b, Hold)}
    return {
        f"{body.name}.{joint.name}"
        for body in checked.scene.objects
        if not body.frozen
        for joint in own_joints(body.joints)
    } - held


def check_triggers(checked: CheckedScene, robot: Robot, mission: Mission) -> None:
    """Find triggers whose distance the robot can never get down to.

    The robot is a disc of its inscribed radius that goes wherever there is a way from its start,
    through all doors that are not held shut: what is said never to happen never does.
    """
    triggers = [b for b in checked.behaviours if isinstance(b, Trigger)]
    if not triggers:
        return
    shut = [s for shapes in checked.shut_below(robot.height).values() for s in shapes]
    space = free_space(checked.scene, robot.height)
    parts = space.for_radius(inscribed_radius(robot.footprint), shut)
    home = parts.of((mission.start.x, mission.start.y))
    if home is None:
        return
    radius = max(math.hypot(*corner) for corner in robot.footprint)
    for trigger in triggers:
        # Bounds in favour of the trigger: it is said to never fire only when that is certain.
        measured = _measured_from(checked.scene, trigger)
        nearest = measured.distance(parts.parts[home]) - SNAP_DISTANCE
        if trigger.to == "footprint":
            nearest -= radius
        if nearest >= trigger.distance:
            point = f"{trigger.joint.partition('.')[0]}'s {trigger.of}"
            checked.warn(
                trigger.joint,
                f"{trigger.joint} never fires: {robot.name} gets no nearer to {point} than "
                f"{nearest:.2f} m, it must be within {trigger.distance:g} m",
                "take a larger distance, or look for what is in the way",
            )


def _measured_from(scene: Scene, trigger: Trigger) -> BaseGeometry:
    """Return where the distance of a trigger is measured from, wherever its joint may be."""
    name, _, joint_name = trigger.joint.partition(".")
    body = next(b for b in scene.objects if b.name == name)
    joint = next(j for j in body.joints if j.name == joint_name)
    if trigger.of == "doorway":
        doorway = next(d for d in scene.doorways if d.name == body.doorway)
        return Polygon(doorway.footprint).centroid
    moving = {link.name: link for link in moving_links(body)}
    part = moving.get(joint.child if trigger.of == "leaf" else joint.parent)
    if part is not None:
        ranges = {j.name: (j.lower, j.upper) for j in body.joints if not is_fixed(j)}
        return swept_area(body, part, ranges)
    hinge = joint.kind == "revolute" and trigger.of == "hinge"
    return Point(body.pose.apply(joint.anchor if hinge else (0.0, 0.0)))
