"""Checks of behaviours: joints that cannot move, times, and events that never happen."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, TypeAlias

from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.model.behaviour import (
    Behaviour,
    Event,
    Hold,
    JointActs,
    KeyFrames,
    LegBegins,
    Reaction,
    Servo,
    Trigger,
    Walk,
    WaypointReached,
)
from grammars.model.free_space import (
    SNAP_DISTANCE,
    circumscribed_radius,
    inscribed_radius,
    moving_links,
    swept_area,
)
from grammars.model.mission import Mission
from grammars.model.movers import is_fixed, own_joints
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from grammars.preflight._checked import CheckedScene, free_space
from grammars.text.diagnostics import Findings, did_you_mean

_TOLERANCE: Final = 1e-9
_FASTEST: Final = 10.0
"""Speed [m/s] above which a unit is almost surely wrong."""
_FASTEST_TURN: Final = 20.0
"""The same of a joint that turns [rad/s]."""
_WaitingBehaviour: TypeAlias = Reaction | Walk


def check_behaviours(checked: CheckedScene) -> bool:
    """Report behaviours of joints that cannot move; return whether there are none."""
    joints = {
        f"{body.name}.{joint.name}": (body, joint, initial)
        for body in checked.scene.objects
        for joint, initial in zip(body.joints, body.initial, strict=True)
    }
    problems = Findings()
    for behaviour in checked.behaviours:
        if isinstance(behaviour, Walk):
            continue
        name, where = behaviour.joint, checked.place(behaviour.joint)
        body, joint, initial = joints[name]
        holds = isinstance(behaviour, Hold)
        stays = holds and all(abs(q - initial) <= _TOLERANCE for q in behaviour.positions)
        if body.frozen and not stays:
            message = f"{name} should move, but {body.name} is frozen"
            problems.error(where, message, "remove frozen, or the behaviour")
        elif joint.upper - joint.lower < _TOLERANCE and not holds:
            problems.error(where, f"{name} should move, but its limits leave no room")
    checked.findings.add(problems.all)
    return not problems.all


def check_times(checked: CheckedScene, limit: float) -> None:
    """Warn of motions that are too late, too slow or too fast for a run of ``limit`` [s]."""
    scene = checked.scene
    turning = {
        f"{b.name}.{j.name}" for b in scene.objects for j in b.joints if j.kind == "revolute"
    }
    frictions = {f"{b.name}.{j.name}": j.friction for b in scene.objects for j in b.joints}
    for behaviour in checked.behaviours:
        where = behaviour.joint
        late = [time for time in _times(behaviour) if time > limit]
        if late:
            message = f"{late[0]:g} s is longer than a run, which ends after {limit:g} s"
            checked.warn(where, message, "use a shorter time, or a longer limit")
        motion = None if isinstance(behaviour, Hold | Walk) else behaviour.motion
        turns = motion is not None and where in turning
        most, unit = (_FASTEST_TURN, "deg/s") if turns else (_FASTEST, "m/s")
        rate = behaviour.speed if isinstance(behaviour, Walk) else getattr(motion, "rate", 0.0)
        shown = f"{math.degrees(rate) if turns else rate:.4g} {unit}"
        if rate > most:
            checked.warn(where, f"{shown} is too fast for any door or person", "check the unit")
        if isinstance(motion, Servo) and motion.effort <= frictions[where]:
            unit = "N m" if turns else "N"
            message = (
                f"a servo with {motion.effort:g} {unit} does not move a joint with a friction of "
                f"{frictions[where]:g} {unit}"
            )
            checked.warn(where, message, "use more effort")
        ways = _ways(behaviour, scene.initial_joints, limit)
        if isinstance(behaviour, Trigger | Reaction) and not ways[0][0]:
            checked.warn(where, "nothing moves: start and end are one position")
        elif rate and ways and all(way > rate * time * (1.0 + _TOLERANCE) for way, time in ways):
            way, time = ways[0]
            message = f"the motion takes {way / rate:.1f} s at {shown}, but has only {time:g} s"
            checked.warn(where, message, "use a higher speed, or more time")


def _times(behaviour: Behaviour) -> tuple[float, ...]:
    """Return the times [s] that a behaviour waits at least."""
    match behaviour:
        case KeyFrames(frames=frames):
            return tuple(frame.time for frame in frames)
        case Reaction(delay=delay):
            return (delay,)
        case Walk(start=start, pause=pause):
            return (start, pause)
    return ()


def _ways(
    behaviour: Behaviour, initial: Mapping[str, float], limit: float
) -> list[tuple[float, float]]:
    """Return the ways [rad or m] of motions, and the time [s] for each."""
    match behaviour:
        case Trigger(start=start, end=end) | Reaction(start=start, end=end):
            return [(abs(end - start), limit)]
        case Walk(route=(first, second, *_), start=begin) if begin < limit:
            return [(math.dist(first, second), limit - begin)]
        case KeyFrames(frames=frames):
            ends = [*(frame.time for frame in frames[1:]), limit]
            starts = [initial[behaviour.joint], *behaviour.positions]
            moves = zip(frames, starts, ends, strict=False)
            return [(abs(f.position - q), t - f.time) for f, q, t in moves if 0.0 < f.time < t]
    return []


def check_events(checked: CheckedScene, mission: Mission) -> None:
    """Report events with unknown names, and events that never happen."""
    waiting = [b for b in checked.behaviours if isinstance(b, Reaction | Walk) and b.event]
    sound = {b.joint for b in waiting if _check_names(checked, mission, b)}
    for behaviour, event in _never_coming(checked):
        if behaviour.joint in sound:
            name = behaviour.object if isinstance(behaviour, Walk) else behaviour.joint
            acts = f"{' or '.join(event.joints)} to {'fire' if event.act == 'fires' else 'move'}"
            message = f"{name} waits for {acts}, which never happens"
            hint = "add a behaviour that causes it, or wait for another event"
            checked.warn(behaviour.joint, message, hint)


def _check_names(checked: CheckedScene, mission: Mission, waiting: _WaitingBehaviour) -> bool:
    """Report a leg or waypoint that the mission lacks; return whether it has it."""
    event, ids = waiting.event, [waypoint.id for waypoint in mission.waypoints]
    if isinstance(event, LegBegins) and not 1 <= event.leg <= len(ids):
        message = f"there is no leg {event.leg}, mission {mission.name} has {len(ids)}"
        checked.error(waiting.joint, message, "legs count from 1")
        return False
    if isinstance(event, WaypointReached) and event.waypoint not in ids:
        message = f'mission {mission.name} has no waypoint "{event.waypoint}"'
        checked.error(waiting.joint, message, did_you_mean(event.waypoint, ids))
        return False
    return True


def _never_coming(checked: CheckedScene) -> list[tuple[_WaitingBehaviour, JointActs]]:
    """Return the behaviours that wait for impossible events, also in circles."""
    movable = _movable(checked)
    fires = {b.joint for b in checked.behaviours if isinstance(b, Trigger)}
    waiting = [b for b in checked.behaviours if isinstance(b, Reaction | Walk)]
    # Events cause further events: repeat until there are no new ones.
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
    """Return the joints that a behaviour or the robot can move, without those of movers."""
    return {
        f"{body.name}.{joint.name}"
        for body in checked.scene.objects
        if not body.frozen
        for joint in own_joints(body.joints)
    } - {b.joint for b in checked.behaviours if isinstance(b, Hold)}


def check_triggers(checked: CheckedScene, robot: Robot, mission: Mission) -> None:
    """Warn of triggers whose distance the robot can never reach, or never leaves.

    The robot counts as a disc of its inscribed radius that can pass all doors not held shut, so
    that no warning is wrong.
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
    radius = circumscribed_radius(robot.footprint)
    for trigger in triggers:
        # Underestimate the distance, so that no warning is wrong.
        origin = _measured_from(checked.scene, trigger)
        nearest = origin.distance(parts.parts[home]) - SNAP_DISTANCE
        if trigger.to == "footprint":
            nearest -= radius
        point = f"{trigger.joint.partition('.')[0]}'s {trigger.of}"
        spots = [Point(mission.start.x, mission.start.y)]
        spots += [Point(one.x, one.y) for one in mission.waypoints]
        if all(spot.hausdorff_distance(origin) <= trigger.distance for spot in spots):
            message = (
                f"{trigger.joint} fires at once: start and waypoints are within "
                f"{trigger.distance:g} m of {point}"
            )
            checked.warn(trigger.joint, message, "use a smaller distance")
        if nearest >= trigger.distance:
            checked.warn(
                trigger.joint,
                f"{trigger.joint} never fires: {robot.name} stays at least {nearest:.2f} m away "
                f"from {point}, but must be within {trigger.distance:g} m",
                "use a larger distance, or remove obstacles",
            )


def _measured_from(scene: Scene, trigger: Trigger) -> BaseGeometry:
    """Return the origin of the distance of a trigger, for all positions of its joint."""
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
