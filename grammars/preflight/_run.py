"""Checks of what a robot is asked to do in a scene."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Final

from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.model.behaviour import Behaviour, Hold, KeyFrames, Reaction, Trigger, Walk
from grammars.model.free_space import inscribed_radius, is_overlap, moving_links, swept_area
from grammars.model.geometry import Point2
from grammars.model.mission import Mission
from grammars.model.movers import PLANAR_JOINTS, is_mover
from grammars.model.robot import Robot
from grammars.model.scene import Joint, Link, Scene, SceneObject
from grammars.preflight._behaviours import check_events, check_triggers, check_walks
from grammars.preflight._checked import CheckedScene
from grammars.preflight._doors import colliding_doors
from grammars.preflight._reach import Spot, check_reach
from grammars.preflight._sweeps import Sweeps, object_hits, wall_hits
from grammars.text.diagnostics import Diagnostic, Severity, Where, did_you_mean

_TOLERANCE: Final = 1e-9
_ARRIVAL: Final = 0.5
"""So far from a waypoint [m] may a system be content; the tolerances of stacks are smaller."""


def check_run(
    scene: Scene,
    robot: Robot,
    mission: Mission,
    behaviours: Sequence[Behaviour],
    *,
    where: Where | None = None,
    places: Mapping[str, Where] | None = None,
) -> tuple[Diagnostic, ...]:
    """Return what cannot work when ``robot`` does ``mission`` while doors behave.

    Errors: start or waypoint inside a wall, outside of every room or nearer to a wall than half
    of the robot's width; waypoints without a way, and the doorway that is too narrow; behaviours
    of joints that do not exist, cannot move or would leave their limits. Warnings: waypoints
    behind doors that stay shut or under a leaf; leaves that move through walls or other objects;
    triggers the robot can never get near enough to. Events that are not there or never come, and
    routes through walls, are found as well.

    ``where`` is the mission's place; ``places`` gives finer ones: ``start``, ids of waypoints,
    names of joints and objects.
    """
    checked = CheckedScene(scene, places or {}, where or Where(mission.name))
    start = mission.start
    spots = [("the start", (start.x, start.y), checked.places.get("start", checked.home))]
    spots.extend(
        (f"waypoint {w.id}", (w.x, w.y), checked.places.get(w.id, checked.home))
        for w in mission.waypoints
    )
    problems = [_check_spot(checked, robot, *spot) for spot in spots]
    findings = [problem for problem in problems if problem is not None]
    sound = [spot for spot, problem in zip(spots, problems, strict=True) if problem is None]
    # A way is looked for between spots that stand free: from others there is none anyway.
    if problems[0] is None:
        findings.extend(_start_overlaps(checked, robot, mission, spots[0][2]))
        findings.extend(check_reach(scene, robot, sound, behaviours))
    findings.extend(check_events(checked, mission, behaviours))
    findings.extend(check_walks(checked, behaviours))
    unsound = check_behaviours(checked, behaviours)
    findings.extend(unsound)
    # Sweeps and triggers take for granted that every behaviour has its joint.
    if not unsound:
        findings.extend(_moving_doors(checked, behaviours, sound))
        findings.extend(check_triggers(checked, robot, mission, behaviours))
    return tuple(dict.fromkeys(findings))


def _check_spot(
    checked: CheckedScene, robot: Robot, label: str, point: Point2, place: Where
) -> Diagnostic | None:
    distance, owner = checked.obstacles.nearest(*point, z_max=robot.height)
    if distance == 0.0:
        return Diagnostic(place, f"{label} is inside of {owner}", "move it into a room")
    spot = Point(point)
    if not any(floor.covers(spot) for floor in checked.floors):
        return Diagnostic(
            place,
            f"{label} ({point[0]:g}, {point[1]:g}) is outside of every room",
            "check the signs of x and y, and whether the mission belongs to this floor plan",
        )
    radius = inscribed_radius(robot.footprint)
    if distance < radius - _TOLERANCE:
        return Diagnostic(
            place,
            f"{label} is {distance:.2f} m from {owner}, {robot.name} needs {radius:.2f} m",
            f"move it {radius - distance:.2f} m away from the wall",
        )
    return None


def _start_overlaps(
    checked: CheckedScene, robot: Robot, mission: Mission, place: Where
) -> list[Diagnostic]:
    """The start has a heading, so the whole footprint must fit there."""
    body = Polygon(mission.start.apply_ring(robot.footprint))
    found = checked.obstacles.hit_by(body, 0.0, robot.height)
    hits = [owner for owner, part in found.items() if part.area > 1e-6]
    if not hits:
        return []
    message = f"at the start {robot.name} stands in {' and '.join(hits)}"
    return [Diagnostic(place, message, "move or turn the start")]


def check_behaviours(checked: CheckedScene, behaviours: Sequence[Behaviour]) -> list[Diagnostic]:
    """Return errors for joints that are unknown, frozen, told twice or sent out of their limits."""
    joints = {f"{b.name}.{j.name}": (b, j) for b in checked.scene.objects for j in b.joints}
    findings: list[Diagnostic] = []
    told: set[str] = set()
    for behaviour in behaviours:
        if isinstance(behaviour, Walk):
            if not told.isdisjoint(behaviour.joints):
                message = f"{behaviour.object} has two behaviours"
                findings.append(Diagnostic(checked.place(behaviour.joint), message, "one must go"))
            told.update(behaviour.joints)
            continue
        name = behaviour.joint
        place = checked.place(name)
        if name not in joints:
            hint = did_you_mean(name, joints)
            findings.append(Diagnostic(place, f'there is no joint "{name}" in the scene', hint))
            continue
        if name in told:
            findings.append(Diagnostic(place, f"{name} has two behaviours", "one must go"))
        told.add(name)
        body, joint = joints[name]
        findings.extend(_one_behaviour(behaviour, body, joint, place))
    return findings


def _one_behaviour(
    behaviour: Hold | KeyFrames | Trigger | Reaction, body: SceneObject, joint: Joint, place: Where
) -> list[Diagnostic]:
    name = behaviour.joint
    positions = behaviour.positions
    initial = body.initial[body.joints.index(joint)]
    moves = any(abs(q - initial) > _TOLERANCE for q in positions)
    if body.frozen and (moves or not isinstance(behaviour, Hold)):
        return [
            Diagnostic(
                place,
                f"{name} is to move, but {body.name} is frozen",
                "leave out frozen, or the behaviour",
            )
        ]
    if is_mover(body.joints) and joint.name in PLANAR_JOINTS and not isinstance(behaviour, Hold):
        return [Diagnostic(place, f"{name} belongs to a mover", f"let {body.name} walk")]
    findings = [
        Diagnostic(
            place,
            f"{name} is sent to {q:g}, outside of its limits",
            f"between {joint.lower:g} and {joint.upper:g}",
        )
        for q in dict.fromkeys(positions)
        if not joint.lower - _TOLERANCE <= q <= joint.upper + _TOLERANCE
    ]
    stuck = not body.frozen and joint.upper - joint.lower < _TOLERANCE
    if stuck and not isinstance(behaviour, Hold):
        findings.append(Diagnostic(place, f"{name} is to move, but its limits leave no room"))
    if isinstance(behaviour, Trigger) and behaviour.of == "doorway" and not body.doorway:
        message = f"{name} measures from its doorway, but {body.name} stands in none"
        findings.append(Diagnostic(place, message, "measure from its hinge or leaf"))
    return findings


def _moving_doors(
    checked: CheckedScene, behaviours: Sequence[Behaviour], spots: Sequence[Spot]
) -> list[Diagnostic]:
    used: dict[str, dict[str, tuple[float, float]]] = {}
    for behaviour in behaviours:
        if isinstance(behaviour, Walk):
            continue
        name, _, joint = behaviour.joint.partition(".")
        positions = behaviour.positions
        used.setdefault(name, {})[joint] = (min(positions), max(positions))
    sweeps: Sweeps = [
        (body, link, _swept(body, link, tuple(used[body.name].items())))
        for body in checked.scene.objects
        if body.name in used
        for link in moving_links(body)
    ]
    findings = wall_hits(checked, sweeps, "as it is told to move")
    # Of doors that are in each other when shut that is said already.
    said = colliding_doors(checked)
    findings.extend(object_hits(checked, sweeps, "as they are told to move", said))
    for label, point, place in spots:
        spot = Point(point).buffer(0.02)
        for body, _, area in sweeps:
            if is_overlap(area.intersection(spot)):
                message = f"{body.name} sweeps over {label}"
                findings.append(
                    Diagnostic(place, message, "the robot may be hit there", Severity.WARNING)
                )
    return findings


@functools.lru_cache(maxsize=256)
def _swept(
    body: SceneObject, link: Link, told: tuple[tuple[str, tuple[float, float]], ...]
) -> BaseGeometry:
    """Return what a link covers while the joints named move through the ranges they are told.

    Scenarios and the points of a search mostly differ in when a door moves, not in how far.
    """
    used = dict(told)
    return swept_area(_starting_in_range(body, used), link, used)


def _starting_in_range(body: SceneObject, used: Mapping[str, tuple[float, float]]) -> SceneObject:
    """Return ``body`` with told joints starting inside the range they are told to move in."""
    # A joint is swept alone while the others stand at their start, and what a behaviour sets at
    # time 0 is never where the scene has it.
    initial = tuple(
        min(max(q, used[j.name][0]), used[j.name][1]) if j.name in used else q
        for j, q in zip(body.joints, body.initial, strict=True)
    )
    return dataclasses.replace(body, initial=initial)


def check_limit(
    mission: Mission, speeds: Mapping[str, float], *, limit: float, where: Where
) -> list[Diagnostic]:
    """Return a warning for a limit [s] in which no run can end its mission.

    The way is straight from waypoint to waypoint. ``speeds`` are the largest of the systems under
    test by name [m/s], ``where`` is the place of the limit.
    """
    points = [(mission.start.x, mission.start.y), *((w.x, w.y) for w in mission.waypoints)]
    legs = [math.dist(a, b) for a, b in itertools.pairwise(points)]
    # Only near to each waypoint: the first leg begins at the start itself, all others do not.
    ends = [_ARRIVAL, *([2.0 * _ARRIVAL] * (len(legs) - 1))]
    way = math.fsum(max(0.0, leg - end) for leg, end in zip(legs, ends, strict=True))
    late = [
        f"{name} at least {way / speed:.1f} s for {way:.1f} m at {speed:.2f} m/s"
        for name, speed in speeds.items()
        if way > limit * speed
    ]
    if not late:
        return []
    message = f"{limit:g} s are too short for mission {mission.name}: it takes {', '.join(late)}"
    hint = "give it a longer limit, or the runs end before the last waypoint"
    return [Diagnostic(where, message, hint, Severity.WARNING)]
