"""Rules that recognise a feature in a run, one function each; see the model for their meaning."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.coverage._facts import MISSION, MOVED, Facts, room_at
from grammars.behaviour import Hold, KeyFrames, Reaction, Trigger, Walk
from grammars.movers import is_mover, own_joints
from grammars.robot import Robot

FAR: Final = 15.0
"""Waypoints this far apart [m] are far from each other."""
FEW: Final = 5
"""More waypoints than this are many."""
SPARE: Final = 0.2
"""A doorway with less room than this [m] on either side of the robot is narrow."""
SAME: Final = 0.5
"""Points nearer than this [m] are the same place."""


def functional(facts: Facts) -> bool:
    return facts.judges(MISSION, "mission", "loc")


def robustness(facts: Facts) -> bool:
    changes = facts.behaves(KeyFrames, Reaction, Walk)
    return changes and any(one.judges for one in facts.asked)


def safety(facts: Facts) -> bool:
    return facts.judges("clearance", "contact")


def performance(facts: Facts) -> bool:
    return facts.measures("elapsed", "mission.leg.elapsed", "path.length", "speed")


def sut(facts: Facts) -> str:
    return facts.spec.sut.name


def differential(facts: Facts) -> bool:
    return facts.spec.robot.drive.kind == "differential"


def omnidirectional(facts: Facts) -> bool:
    return facts.spec.robot.drive.kind == "omnidirectional"


def perfect_odometry(facts: Facts) -> bool:
    noise = facts.spec.robot.odometry
    return noise.translation == noise.rotation == noise.drift == 0.0


def erring_odometry(facts: Facts) -> bool:
    return not perfect_odometry(facts)


def bare_map(facts: Facts) -> bool:
    return facts.spec.map.doors == "none"


def furnished_map(facts: Facts) -> bool:
    return facts.spec.map.doors == "initial"


def one_waypoint(facts: Facts) -> bool:
    return len(facts.spec.mission.waypoints) == 1


def few_waypoints(facts: Facts) -> bool:
    return 2 <= len(facts.spec.mission.waypoints) <= FEW


def many_waypoints(facts: Facts) -> bool:
    return len(facts.spec.mission.waypoints) > FEW


def near(facts: Facts) -> bool:
    return facts.longest_leg < FAR


def far(facts: Facts) -> bool:
    return facts.longest_leg >= FAR


def one_room(facts: Facts) -> bool:
    return len(set(facts.rooms)) == 1


def across_rooms(facts: Facts) -> bool:
    return len(set(facts.rooms)) > 1


def crossed_rooms(facts: Facts) -> bool:
    """Say whether the robot has been in two of the rooms its mission is about."""
    if facts.trace is None:
        return False
    truth, wanted = facts.trace.ground_truth, set(facts.rooms) - {""}
    # Once a second is enough: no robot crosses a room in less.
    points = zip(truth.x[::20].tolist(), truth.y[::20].tolist(), strict=True)
    return len({room_at(facts.scene, point) for point in points} & wanted) > 1


def circuit(facts: Facts) -> bool:
    points = facts.points
    return len(points) > 2 and any(
        math.dist(point, earlier) < SAME
        for index, point in enumerate(points)
        for earlier in points[: max(0, index - 1)]
    )


def heading(facts: Facts) -> bool:
    return any(waypoint.yaw is not None for waypoint in facts.spec.mission.waypoints)


def doorways(facts: Facts) -> bool:
    return any(door.z_min <= 0.0 for door in facts.scene.doorways)


def narrow_doorways(facts: Facts) -> bool:
    least = _width(facts.spec.robot) + 2.0 * SPARE
    return any(door.z_min <= 0.0 and door.width < least for door in facts.scene.doorways)


def _width(robot: Robot) -> float:
    across = [y for _, y in robot.footprint]
    return max(across) - min(across)


def columns(facts: Facts) -> bool:
    return any(solid.kind == "column" for solid in facts.scene.solids)


def dividers(facts: Facts) -> bool:
    return any(solid.kind == "divider" for solid in facts.scene.solids)


def hinged(facts: Facts) -> bool:
    return any(
        joint.kind == "revolute" for o in facts.scene.objects for joint in own_joints(o.joints)
    )


def sliding(facts: Facts) -> bool:
    return any(
        joint.kind == "prismatic" for o in facts.scene.objects for joint in own_joints(o.joints)
    )


def furniture(facts: Facts) -> bool:
    return any(not own_joints(o.joints) and not is_mover(o.joints) for o in facts.scene.objects)


def agents(facts: Facts) -> bool:
    return any(is_mover(o.joints) for o in facts.scene.objects)


def static(facts: Facts) -> bool:
    return not facts.behaves(KeyFrames, Trigger, Reaction, Walk)


def posed(facts: Facts) -> bool:
    return facts.behaves(Hold)


def pushable(facts: Facts) -> bool:
    spoken_of = {behaviour.joint for behaviour in facts.spec.behaviours}
    return any(
        f"{thing.name}.{joint.name}" not in spoken_of
        for thing in facts.scene.objects
        if not thing.frozen
        for joint in own_joints(thing.joints)
    )


def timed(facts: Facts) -> bool:
    return facts.behaves(KeyFrames)


def keyed(facts: Facts) -> bool:
    return facts.happened("key frame ")


def triggers(facts: Facts) -> bool:
    return facts.behaves(Trigger)


def fired(facts: Facts) -> bool:
    return facts.happened("triggered ")


def reacting(facts: Facts) -> bool:
    return facts.behaves(Reaction)


def reacted(facts: Facts) -> bool:
    return facts.happened("reacts: ")


def walking(facts: Facts) -> bool:
    return facts.behaves(Walk)


def walked(facts: Facts) -> bool:
    """Say whether any walking joint has left where it stood."""
    if facts.trace is None:
        return False
    track, walks = (
        facts.trace.joints,
        {b.joint for b in facts.spec.behaviours if isinstance(b, Walk)},
    )
    columns = [i for i, name in enumerate(track.names) if name.rpartition(".")[0] + ".x" in walks]
    if not columns or not len(track.time):
        return False
    position = track.position[:, columns]
    return bool((np.abs(position - position[0]) > MOVED).any())
