"""Checks of the task of a robot in a scene."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Final

from shapely.geometry import Point, Polygon

from grammars.model.behaviour import Behaviour
from grammars.model.free_space import inscribed_radius, is_overlap
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from grammars.preflight._behaviours import (
    check_behaviours,
    check_events,
    check_times,
    check_triggers,
)
from grammars.preflight._checked import CheckedScene, sweeps
from grammars.preflight._doors import check_openings, colliding_doors
from grammars.preflight._mission import Spot, spots_of
from grammars.preflight._parts import check_meetings, check_walls
from grammars.preflight._reach import check_reach
from grammars.preflight._walks import check_walks
from grammars.text.diagnostics import Finding, Where

_TOLERANCE: Final = 1e-9
_ROUNDED: Final = 0.01
"""Largest error of multiples of pi / 4 that people write with two decimals."""


def check_run(
    scene: Scene,
    robot: Robot,
    mission: Mission,
    behaviours: Sequence[Behaviour],
    *,
    limit: float = math.inf,
    where: Where | None = None,
    places: Mapping[str, Where] | None = None,
) -> tuple[Finding, ...]:
    """Return the problems of ``mission`` for ``robot`` with the given ``behaviours``.

    Errors: start or waypoint inside a wall, outside all rooms or nearer to a wall than half the
    width of the robot; unreachable waypoints, with the doorway that is too narrow; behaviours of
    joints that cannot move; legs and waypoints that the mission lacks. Warnings:
    waypoints behind shut doors or under a leaf; leaves that move through walls or other objects;
    times beyond the limit; triggers out of reach of the robot; events that never happen; routes
    through walls.

    A run ends after ``limit`` [s]. ``where`` is the place of the mission; ``places`` has finer
    ones: ``start``, ids of waypoints, names of joints and objects.
    """
    checked = CheckedScene(scene, places or {}, where or Where(mission.name), behaviours)
    home, *waypoints = spots_of(mission, checked.places, checked.home)
    sound = [home] if _check_spot(checked, robot, home) else []
    sound += [spot for spot in waypoints if _check_spot(checked, robot, spot)]
    # Only free spots can have a way between them.
    body = Polygon(mission.start.apply_ring(robot.footprint))
    if home in sound and _check_start(checked, robot, body, home):
        check_reach(checked, robot, home, sound[1:])
    _check_mission(checked, mission, [home, *waypoints])
    check_openings(checked, robot)
    check_events(checked, mission)
    check_walks(checked, robot, body)
    # The next checks need the joints of all behaviours.
    if check_behaviours(checked):
        check_times(checked, limit)
        _check_doors(checked, sound)
        check_triggers(checked, robot, mission)
    return checked.findings.all


def _check_spot(checked: CheckedScene, robot: Robot, spot: Spot) -> bool:
    """Report why a robot cannot stand on a spot; return whether it can."""
    label, point, where = spot
    radius = inscribed_radius(robot.footprint)
    distance, owner = checked.floor.solids.nearest(*point, z_max=robot.height)
    if distance == 0.0:
        checked.error(where, f"{label} is inside {owner}", "move it into a room")
    elif not checked.floor.holds(point):
        message = f"{label} ({point[0]:g}, {point[1]:g}) is outside all rooms"
        hint = "check the signs of x and y, and that the mission belongs to this floor plan"
        checked.error(where, message, hint)
    elif distance < radius - _TOLERANCE:
        message = f"{label} is {distance:.2f} m from {owner}, {robot.name} needs {radius:.2f} m"
        checked.error(where, message, f"move it {radius - distance:.2f} m away from the wall")
    else:
        return True
    return False


def _check_start(checked: CheckedScene, robot: Robot, body: Polygon, home: Spot) -> bool:
    """Report what overlaps the ``body`` of the robot at the start; return whether nothing does."""
    owners = checked.floor.solids.hit_by(body, 0.0, robot.height)
    hits = [owner for owner, overlap in owners.items() if overlap.area > 1e-6]
    hits += [
        f"the {part.link.name} of {part.body.name}"
        for part in checked.at_start
        if part.link.z_min < robot.height and is_overlap(part.shape.intersection(body))
    ]
    if hits:
        message = f"at the start {robot.name} overlaps {' and '.join(hits)}"
        checked.error(home.where, message, "move or turn the start")
    return not hits


def _check_mission(checked: CheckedScene, mission: Mission, spots: Sequence[Spot]) -> None:
    """Warn of headings in a wrong unit, places twice in a row, and ids that are other numbers."""
    yaws = [mission.start.yaw, *(w.yaw for w in mission.waypoints)]
    for spot, yaw in zip(spots, yaws, strict=True):
        if yaw is None:
            continue
        turns, degrees = abs(yaw) / math.tau, math.degrees(yaw)
        message = f"the yaw of {spot.label}, {yaw:g} rad, is {turns:.1f} turns"
        if turns > 1.0:
            checked.warn(spot.where, message, f'write "{yaw:g} deg" if degrees are meant')
        quarters = abs(degrees) / (math.pi / 4)
        message = f"the yaw of {spot.label} is {degrees:.3g} deg"
        if 0.5 < quarters < 8.5 and abs(quarters - round(quarters)) < _ROUNDED:
            checked.warn(spot.where, message, f'write "{degrees:.3g} rad" if radians are meant')
    for (before, spot), yaw in zip(itertools.pairwise(spots), yaws[1:], strict=True):
        if math.dist(before.point, spot.point) < _TOLERANCE and yaw is None:
            message = f"{spot.label} is where {before.label} is: there is nothing to drive"
            checked.warn(spot.where, message, "move it, or leave it out")
    numbers = {str(number): number for number, _ in enumerate(mission.waypoints, start=1)}
    for number, waypoint in enumerate(mission.waypoints, start=1):
        if numbers.get(waypoint.id, number) != number:
            message = f'waypoint {number} has the id "{waypoint.id}", the number of another one'
            checked.warn(waypoint.id, message, "legs count from 1: give it a name instead")


def _check_doors(checked: CheckedScene, spots: Sequence[Spot]) -> None:
    """Report collisions of leaves during their behaviours, and spots that they sweep over."""
    swept = [
        part
        for body in checked.scene.objects
        if body.name in checked.ranges
        for part in sweeps(body, tuple(checked.ranges[body.name].items()))
    ]
    check_walls(checked, swept, "during its behaviour")
    # The scene check has reported doors that overlap when shut.
    check_meetings(checked, swept, "during their behaviours", colliding_doors(checked.scene))
    for label, point, where in spots:
        spot = Point(point).buffer(0.02)
        for part in swept:
            if is_overlap(part.shape.intersection(spot)):
                message = f"{part.body.name} sweeps over {label}"
                checked.warn(where, message, "the robot may be hit there")
