"""Shapes of a world from above, each with its role.

Pictures, reports and terminals show the same shapes, in their own styles. All points are in the map
frame [m].
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Literal, TypeAlias

import numpy as np

from grammars.model.geometry import Floats, Point2, Pose2, Ring
from grammars.model.kinematics import driven_joints, is_cut, link_poses, placed_links
from grammars.model.mission import Mission
from grammars.model.movers import is_mover
from grammars.model.robot import Robot
from grammars.model.scene import Joint, Link, Scene, SceneObject, Solid

Points: TypeAlias = "Sequence[Point2] | Floats"
"""Points (n, 2) [m]."""
Form: TypeAlias = Literal["area", "outline", "line", "dots"]
_STEPS: Final = 28
"""Number of pieces of the arc of a door."""
_SIGMAS: Final = 2.0
"""Size of the ellipse around an estimate, in standard deviations."""


class ShapeRole(StrEnum):
    """Role of a shape; a ``NEAR_TRAIL`` is nearer to something than an oracle allows."""

    FLOOR = "floor"
    LOW = "low"
    WALL = "wall"
    SWING = "swing"
    DOOR = "door"
    POST = "post"
    MOVER = "mover"
    SPACE_NAME = "space name"
    OBJECT_NAME = "object name"
    MOVER_NAME = "mover name"
    WAYPOINT = "waypoint"
    REACHED = "reached"
    ROBOT = "robot"
    HEADING = "heading"
    ESTIMATE = "estimate"
    SPREAD = "spread"
    COSTMAP = "costmap"
    RETURN = "return"
    PLAN = "plan"
    TRAIL = "trail"
    NEAR_TRAIL = "near trail"
    TOUCHING_TRAIL = "touching trail"
    CONTACT = "contact"
    FAILURE = "failure"
    DECISION = "decision"


@dataclass(frozen=True, slots=True, eq=False)
class PlanShape:
    """Shape from above.

    ``parts`` are rings of an ``area`` (even-odd) or an ``outline``, lines, or single ``dots``.
    ``text`` is a name with the rings of its owner as parts, the number of a waypoint, or the
    measure of a deciding object.
    """

    role: ShapeRole
    form: Form
    parts: tuple[Points, ...]
    text: str = ""


@dataclass(frozen=True, slots=True)
class MeasuredMark:
    """Object that decides a verdict, or nearest place, in the map frame [m]; red if it ``fails``.

    ``line`` goes from the robot to the object called ``name``; ``words`` are its measure.
    ``rings`` outline the object, ``place`` is an area on the floor or a waypoint.
    """

    name: str
    line: tuple[Point2, Point2]
    words: str
    rings: tuple[Ring, ...] = ()
    place: Ring = ()
    fails: bool = True


def is_below(solid: Solid, cut: float) -> bool:
    """Return whether a solid lies below the height of the cut [m]."""
    return solid.z_min < cut and solid.z_max <= cut


def floor_shapes(scene: Scene) -> Iterator[PlanShape]:
    """Yield the free floor: all spaces and the passages between them."""
    for region in scene.regions:
        yield PlanShape(ShapeRole.FLOOR, "area", (region.outline, *region.holes), region.name)
    for doorway in scene.doorways:
        yield PlanShape(ShapeRole.FLOOR, "area", (doorway.footprint,), doorway.name)


def solid_shapes(scene: Scene, cut: float) -> Iterator[PlanShape]:
    """Yield the solids that cross the height ``cut`` [m], and those below it."""
    for solid in scene.solids:
        if is_below(solid, cut):
            yield PlanShape(ShapeRole.LOW, "area", (solid.polygon,))
        elif is_cut(solid, cut):
            yield PlanShape(ShapeRole.WALL, "area", (solid.polygon,))


def body_shapes(
    scene: Scene, positions: Mapping[str, float], cut: float | None = None
) -> Iterator[PlanShape]:
    """Yield the links of all objects, or those that cross the height ``cut`` [m].

    Movers are shown at any height, so that all of them are visible. ``positions`` [rad or m] are by
    scene-wide joint name; other joints are at their start.
    """
    for thing in scene.objects:
        moving = {joint.child for joint in thing.joints} if not thing.frozen else set()
        mobile = ShapeRole.MOVER if is_mover(thing.joints) else ShapeRole.DOOR
        for link, rings in placed_links(thing, positions):
            role = mobile if link.name in moving else ShapeRole.POST
            if rings and (cut is None or role is ShapeRole.MOVER or is_cut(link, cut)):
                yield PlanShape(role, "area", rings, thing.name)


def swing_shapes(scene: Scene, positions: Mapping[str, float]) -> Iterator[PlanShape]:
    """Yield the floor that each moving link can sweep: sectors of hinges, both ends of sliders.

    ``positions`` [rad or m] are those of all joints by scene-wide name.
    """
    for thing in scene.objects:
        if thing.frozen:
            continue
        own = [positions[f"{thing.name}.{joint.name}"] for joint in thing.joints]
        links = {link.name: link for link in thing.links}
        moving = driven_joints(thing)
        for index, joint in enumerate(thing.joints):
            if joint in moving:
                yield from _swing(thing, joint, links[joint.child], own, index)


def _swing(
    thing: SceneObject, joint: Joint, link: Link, positions: list[float], index: int
) -> Iterator[PlanShape]:
    def at(position: float, point: Point2) -> Point2:
        moved = [*positions[:index], position, *positions[index + 1 :]]
        return link_poses(thing, moved)[link.name].apply(point)

    if not (math.isfinite(joint.lower) and math.isfinite(joint.upper)):
        return
    if joint.kind == "prismatic":
        for end in (joint.lower, joint.upper):
            rings = tuple(tuple(at(end, corner) for corner in ring) for ring in link.polygons)
            yield PlanShape(ShapeRole.SWING, "outline", rings, thing.name)
        return
    corners = [corner for ring in link.polygons for corner in ring]
    tip = max(corners, key=lambda c: math.dist(c, joint.anchor))
    # One full turn is enough.
    upper = min(joint.upper, joint.lower + math.tau)
    angles = [joint.lower + (upper - joint.lower) * i / _STEPS for i in range(_STEPS + 1)]
    arc = tuple(at(angle, tip) for angle in angles)
    hinge = at(joint.lower, joint.anchor)
    yield PlanShape(ShapeRole.SWING, "area", ((hinge, *arc),), thing.name)
    yield PlanShape(ShapeRole.SWING, "line", (arc,), thing.name)


def space_names(scene: Scene) -> Iterator[PlanShape]:
    """Yield the name of every space, with its outline and its holes."""
    for region in scene.regions:
        rings = (region.outline, *region.holes)
        yield PlanShape(ShapeRole.SPACE_NAME, "area", rings, region.name)


def object_names(scene: Scene, positions: Mapping[str, float]) -> Iterator[PlanShape]:
    """Yield the name of every object with a shape, with its current rings."""
    for thing in scene.objects:
        rings = tuple(ring for _, placed in placed_links(thing, positions) for ring in placed)
        if rings:
            role = ShapeRole.MOVER_NAME if is_mover(thing.joints) else ShapeRole.OBJECT_NAME
            yield PlanShape(role, "area", rings, thing.name)


def waypoint_shapes(mission: Mission, reached: int = 0) -> Iterator[PlanShape]:
    """Yield the waypoints with numbers from one; the first ``reached`` ones are reached."""
    for number, waypoint in enumerate(mission.waypoints, start=1):
        role = ShapeRole.REACHED if number <= reached else ShapeRole.WAYPOINT
        yield PlanShape(role, "dots", (((waypoint.x, waypoint.y),),), str(number))


def footprint_shape(pose: Pose2, robot: Robot) -> PlanShape:
    """Return the outline of a robot at a pose."""
    return PlanShape(ShapeRole.ROBOT, "area", (pose.apply_ring(robot.footprint),), robot.name)


def heading_shape(pose: Pose2, robot: Robot) -> PlanShape:
    """Return the line from the middle of a robot to its nose, at least 10 cm long."""
    nose = pose.apply((nose_reach(robot), 0.0))
    return PlanShape(ShapeRole.HEADING, "line", (((pose.x, pose.y), nose),))


def nose_reach(robot: Robot) -> float:
    """Return the reach of a robot's footprint forward [m], at least 10 cm."""
    return max(max(x for x, _ in robot.footprint), 0.1)


def spread_shape(centre: Pose2, spread: tuple[float, float, float]) -> PlanShape:
    """Return the ellipse two standard deviations around an estimate, as points.

    ``spread`` is xx, xy and yy of the covariance [m²].
    """
    xx, xy, yy = spread
    # Axes of the covariance; rounding may make the smaller of two variances negative.
    sizes, axes = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    angles = np.linspace(0.0, math.tau, 48, endpoint=False)
    unit = np.column_stack([np.cos(angles), np.sin(angles)])
    around = (centre.x, centre.y) + _SIGMAS * (unit * np.sqrt(np.maximum(sizes, 0.0)) @ axes.T)
    return PlanShape(ShapeRole.SPREAD, "outline", (around,))


def trail_shapes(
    trail: Points, clearances: Sequence[float] = (), limit: float | None = None
) -> Iterator[PlanShape]:
    """Yield the path of a robot by role: touching something, nearer than ``limit`` [m], free.

    ``clearances`` [m] belong to the points, NaN if unknown; without them the whole path is free. A
    piece between two points takes the role of its worse end.
    """
    points = np.asarray(trail, dtype=np.float64).reshape(-1, 2)
    if len(points) < 2:
        return
    distances = np.asarray(clearances, dtype=np.float64)
    if len(distances) != len(points):
        distances = np.full(len(points), np.nan)
    with np.errstate(invalid="ignore"):
        near = distances < limit if limit is not None else np.zeros(len(points), np.bool_)
        worst = np.where(distances <= 0.0, 2, np.where(near, 1, 0))
    pieces = np.maximum(worst[:-1], worst[1:])
    cuts = [0, *(np.flatnonzero(np.diff(pieces)) + 1).tolist(), len(pieces)]
    spans = list(itertools.pairwise(cuts))
    roles = (ShapeRole.TRAIL, ShapeRole.NEAR_TRAIL, ShapeRole.TOUCHING_TRAIL)
    for grade, role in enumerate(roles):
        lines = tuple(points[a : b + 1] for a, b in spans if pieces[a] == grade)
        if lines:
            yield PlanShape(role, "line", lines)


def mark_shapes(mark: MeasuredMark) -> Iterator[PlanShape]:
    """Yield the deciding object, the line to it, and the point with its measure."""
    role = ShapeRole.FAILURE if mark.fails else ShapeRole.DECISION
    yield PlanShape(role, "area", mark.rings)
    yield PlanShape(role, "outline", (mark.place,))
    yield PlanShape(role, "line", (mark.line,))
    yield PlanShape(role, "dots", ((mark.line[1],),), mark.words)
