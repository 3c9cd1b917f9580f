"""Placement of objects in a frame of the floor plan, or fitted into an entryway: the hinge at the
jamb and the leaf in the plane of the wall, mirrored if necessary.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from dataclasses import dataclass
from typing import Final

from shapely.geometry import Point, Polygon

from grammars.floorplan import Feature, FloorPlan, Opening
from grammars.model.geometry import Point2, Pose2, Ring
from grammars.model.kinematics import link_poses
from grammars.model.movers import own_joints
from grammars.model.scene import Doorway, Joint, Link, SceneObject
from grammars.scenery.composition._amounts import closed_positions
from grammars.scenery.model import At, FrameName, In, Instance, ObjectModel, Word
from grammars.text.diagnostics import Findings, InputError, did_you_mean


def mirrored_links(links: tuple[Link, ...], across: Point2) -> tuple[Link, ...]:
    """Return links reflected about the line through the origin along the axis ``across``."""
    return tuple(
        dataclasses.replace(
            link, polygons=tuple(tuple(_reflect(p, across) for p in r) for r in link.polygons)
        )
        for link in links
    )


def mirrored_joints(joints: tuple[Joint, ...], across: Point2) -> tuple[Joint, ...]:
    """Return joints reflected the same way; the direction of rotation reverses."""
    return tuple(
        dataclasses.replace(joint, axis=_reflect(joint.axis, across))
        if joint.kind == "prismatic"
        else dataclasses.replace(
            joint,
            anchor=_reflect(joint.anchor, across),
            # Adding 0.0 turns -0.0 into 0.0, so that equal doors have equal bytes.
            lower=-joint.upper + 0.0,
            upper=-joint.lower + 0.0,
            rest=-joint.rest + 0.0,
        )
        for joint in joints
    )


def _reflect(point: Point2, across: Point2) -> Point2:
    along = point[0] * across[0] + point[1] * across[1]
    return (2 * along * across[0] - point[0], 2 * along * across[1] - point[1])


SLIDER_GAP: Final = 0.01
"""Gap between a sliding leaf and the face of its wall [m]."""
_HALF: Final = 2 / 3
"""Largest width of one of two leaves that slide apart, as a share of the doorway."""
_FIT: Final = 1e-3
_HIGHER: Final = 0.01
"""Tolerance for leaves higher than their doorway [m]."""
_PROBE: Final = 0.15
"""Distance from the faces of a wall at which its spaces are looked up [m]."""
_AXES: Final[tuple[Point2, ...]] = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))


@dataclass(frozen=True, slots=True)
class ObjectPlacement:
    """Pose of an object frame in the world; a mirrored object is the mirror image of its model."""

    pose: Pose2
    mirrored: bool = False
    across: Point2 = (1.0, 0.0)


@dataclass(frozen=True, slots=True)
class _Gap:
    """The hole in a wall in the frame of the opening: x from ``start`` to ``end``, y into the wall.

    With ``left``, the hinge is (or the slider goes) on the left; with ``outwards``, the outer face
    of the wall counts; both are seen from the first room.
    """

    opening: Opening
    start: float
    end: float
    left: bool
    outwards: bool

    @property
    def width(self) -> float:
        return self.end - self.start

    @property
    def middle(self) -> float:
        return (self.start + self.end) / 2


def place_in_entryway(
    plan: FloorPlan, instance: Instance, model: ObjectModel, how: In
) -> ObjectPlacement:
    """Return the placement of an object in an entryway.

    Raises :class:`InputError` for unknown entryways and spaces, for objects that do not match the
    sentence, and for doors wider than the hole.
    """
    opening = _entryway(plan, how.entryway)
    xs = [opening.frame.inverse().apply((p[0], p[1]))[0] for p in opening.near]
    outwards = bool(how.manner) and _towards(plan, opening, how.towards) == "out"
    seen_outside = how.seen_from is not None and _towards(plan, opening, how.seen_from) == "out"
    gap = _Gap(opening, min(xs), max(xs), (how.side == "left") != seen_outside, outwards)
    if how.manner == "hinge":
        return _hinged(instance, model, how, gap)
    if how.manner == "sliding":
        return _sliding(instance, model, how, gap)
    joints = own_joints(model.joints)
    if len(joints) == 1 and joints[0].kind == "revolute":
        message = f"{instance.name}: the side of the hinge is missing"
        hint = "add hinge left or hinge right, and opening inwards or outwards"
        raise InputError.at(how.entryway.where, message, hint)
    return ObjectPlacement(opening.frame @ Pose2(gap.middle, opening.depth / 2, how.yaw))


def _towards(plan: FloorPlan, opening: Opening, side: str | Word) -> str:
    """Return ``in`` or ``out``; a space is searched on both sides of the wall."""
    if isinstance(side, str):
        return side
    outlines = {s.name: Polygon(s.outline, s.holes) for s in plan.spaces}
    if side.text not in outlines:
        hint = did_you_mean(side.text, outlines)
        raise InputError.at(side.where, f'there is no space "{side}"', hint)
    x = sum(opening.frame.inverse().apply((p[0], p[1]))[0] for p in opening.near) / len(
        opening.near
    )
    probes = {
        "in": Point(opening.frame.apply((x, -_PROBE))),
        "out": Point(opening.frame.apply((x, opening.depth + _PROBE))),
    }
    owners = {w.id: w.space for w in plan.walls}
    walls = [owners.get(w, "") for w in opening.walls]
    # The listed walls of an entryway determine its spaces. The floor on both sides matters for
    # plans that list only one wall.
    by_wall = dict(zip(walls, ("in", "out"), strict=False))
    beside_it = [way for way, p in probes.items() if outlines[side.text].covers(p)]
    if not walls and len(beside_it) > 1:
        raise InputError.at(
            side.where,
            f"{side} lies on both sides of {opening.name}",
            "write opening inwards (to the right, seen along the entryway) or outwards",
        )
    direction = by_wall.get(side.text) or next(iter(beside_it), None)
    if direction is None:
        beside = sorted(
            {n for n, o in outlines.items() if any(o.covers(p) for p in probes.values())}
            | {name for name in walls if name}
        )
        raise InputError.at(
            side.where,
            f"{opening.name} does not lead to {side}",
            f"it leads to {' and '.join(beside)}" if beside else "",
        )
    return direction


def _only_joint(instance: Instance, model: ObjectModel, how: In, kind: str) -> Joint:
    joints = own_joints(model.joints)
    if len(joints) == 1 and joints[0].kind == kind:
        return joints[0]
    leaf = "with one leaf on one hinge" if kind == "revolute" else "with one sliding leaf"
    message = f"{instance.name}: {how.manner} {how.side} is for doors {leaf}"
    hint = f"{model.name} has other joints; place it with in {how.entryway} alone, or with at …"
    raise InputError.at(how.entryway.where, message, hint)


def _opening_way(joint: Joint, closed: float) -> float:
    """Return the sign of the opening motion of a joint: towards the farther limit."""
    # So a door with limits of -5 and 110 degrees opens towards 110.
    return 1.0 if joint.upper - closed >= closed - joint.lower else -1.0


def _hinged(instance: Instance, model: ObjectModel, how: In, gap: _Gap) -> ObjectPlacement:
    """Return the pose with the hinge at the jamb and the leaf flush with the face it opens to."""
    joint = _only_joint(instance, model, how, "revolute")
    turns = _opening_way(joint, _closed(model, joint))
    leaf = _corners(model, joint.child)
    along = _leaf_direction(leaf, joint.anchor)
    # All links count: a post or frame must also fit into the hole.
    low, high = _extent([c for link in model.links for c in _corners(model, link.name)], along)
    if high - low > gap.width + _FIT:
        name, width = instance.name, high - low
        message = f"{name} is {width:.3f} m wide, {gap.opening.name} only {gap.width:.3f} m"
        findings = Findings()
        hint = "use a narrower door or widen the entryway"
        findings.error(how.entryway.where, message, hint)
        # Check the height here too, because no later check sees a door without a place.
        link = next(link for link in model.links if link.name == joint.child)
        problem = height_problem(name, link, gap.opening)
        if problem:
            findings.error(instance.where, *problem)
        findings.raise_errors()
    side = 1.0 if gap.left else -1.0
    face = 1.0 if gap.outwards else -1.0
    # A leaf on the right side that would open in the wrong direction is mirrored.
    mirrored = side * turns != face
    depth = _extent(leaf, (-along[1] * turns, along[0] * turns))[1] + how.recess
    pose = Pose2(
        (gap.start if gap.left else gap.end) - side * low,
        (gap.opening.depth if gap.outwards else 0.0) - face * depth,
        (0.0 if gap.left else math.pi) - math.atan2(along[1], along[0]),
    )
    return ObjectPlacement(gap.opening.frame @ pose, mirrored, along)


def height_problem(name: str, leaf: Link, hole: Opening | Doorway) -> tuple[str, str] | None:
    """Return a message and a hint if the leaf of object ``name`` is higher than a doorway."""
    if leaf.z_max <= hole.z_max + _HIGHER:
        return None
    message = (
        f"the {leaf.name} of {name} is {leaf.z_max:.2f} m high, {hole.name} only {hole.z_max:.2f} m"
    )
    return message, "use a lower door or make the entryway higher"


def _sliding(instance: Instance, model: ObjectModel, how: In, gap: _Gap) -> ObjectPlacement:
    """Return the pose with the leaf in front of the hole, close to the face of the wall.

    A leaf of about half the width is one of two that slide apart: they meet in the middle.
    """
    joint = _only_joint(instance, model, how, "prismatic")
    way = _opening_way(joint, _closed(model, joint))
    slides = math.atan2(joint.axis[1] * way, joint.axis[0] * way)
    turned = Pose2(0.0, 0.0, (math.pi if gap.left else 0.0) - slides)
    leaf = turned.apply_ring(tuple(_corners(model, joint.child)))
    everything = [turned.apply(c) for link in model.links for c in _corners(model, link.name)]
    low, high = _extent(leaf, (1.0, 0.0))
    near, far = _extent(everything, (0.0, 1.0))
    # The gap is between the wall and the nearest part of the object, such as a rail.
    y = gap.opening.depth + SLIDER_GAP - near if gap.outwards else -SLIDER_GAP - far
    x = gap.middle - (low + high) / 2
    if high - low <= _HALF * gap.width:
        x = gap.middle - (high if gap.left else low)
    return ObjectPlacement(gap.opening.frame @ Pose2(x, y, turned.yaw))


def _closed(model: ObjectModel, joint: Joint) -> float:
    return closed_positions(model)[model.joints.index(joint)]


def _corners(model: ObjectModel, name: str) -> list[Point2]:
    """Return the corners of a link of the closed object, in the object frame."""
    closed = closed_positions(model)
    body = SceneObject(model.name, model.name, Pose2(), model.links, model.joints, closed)
    pose = link_poses(body, closed)[name]
    link = next(part for part in model.links if part.name == name)
    return [corner for ring in link.polygons for corner in pose.apply_ring(ring)]


def _leaf_direction(leaf: list[Point2], anchor: Point2) -> Point2:
    x = sum(p[0] for p in leaf) / len(leaf) - anchor[0]
    y = sum(p[1] for p in leaf) / len(leaf) - anchor[1]
    return max(_AXES, key=lambda axis: axis[0] * x + axis[1] * y)


def _extent(points: list[Point2] | Ring, along: Point2) -> tuple[float, float]:
    values = [p[0] * along[0] + p[1] * along[1] for p in points]
    return min(values), max(values)


def _entryway(plan: FloorPlan, name: Word) -> Opening:
    entryways = {o.name: o for o in plan.openings if o.kind == "entryway"}
    if name.text not in entryways:
        window = any(o.name == name.text for o in plan.openings)
        hint = "it is a window" if window else did_you_mean(name.text, entryways)
        if any(s.name == name.text for s in plan.spaces):
            hint = f"it is a space: write at {name}, or in {name}, x 1 m, y 50 cm"
        message = f'there is no entryway "{name}" in the floor plan'
        raise InputError.at(name.where, message, hint)
    return entryways[name.text]


def place_instance(plan: FloorPlan, instance: Instance, model: ObjectModel) -> ObjectPlacement:
    """Return the placement of ``instance``; raises :class:`InputError` if there is none."""
    if isinstance(instance.place, At):
        at = instance.place
        if at.inside:
            _check_space(plan, at.frame)
        return ObjectPlacement(frame_named(plan, at.frame) @ Pose2(at.x, at.y, at.yaw))
    return place_in_entryway(plan, instance, model, instance.place)


def _check_space(plan: FloorPlan, name: FrameName) -> None:
    """Raise :class:`InputError` unless ``name`` is a space, where ``x`` and ``y`` make sense."""
    spaces = [s.name for s in plan.spaces]
    if name.name in spaces:
        return
    if any(o.name == name.name for o in plan.openings):
        message = f"x and y need a space, but {name} is an opening"
        raise InputError.at(name.where, message, f"write at {name}, x …")
    hint = did_you_mean(name.name, spaces)
    raise InputError.at(name.where, f'there is no space "{name}"', hint)


def frames_of(plan: FloorPlan) -> dict[str, Pose2]:
    """Return the world poses of all named frames except ``world``.

    For one name, spaces have priority over openings, and openings over features.
    """
    frames: dict[str, Pose2] = {}
    for space in plan.spaces:
        frames[space.name] = space.frame
        for number, wall in enumerate(space.walls):
            frames[f"{space.name}.walls[{number}]"] = wall.frame
    for opening in plan.openings:
        frames.setdefault(opening.name, opening.frame)
    counts = Counter(feature.name for feature in plan.features)
    for feature in plan.features:
        frames.setdefault(_full_name(feature), feature.frame)
        frames.setdefault(feature.id, feature.frame)
        if counts[feature.name] == 1:
            frames.setdefault(feature.name, feature.frame)
    return frames


def _full_name(feature: Feature) -> str:
    return f"{feature.space}.{feature.name}" if feature.space else feature.name


def frame_named(plan: FloorPlan, name: FrameName) -> Pose2:
    """Return the world pose of a frame; raises :class:`InputError` with the closest name."""
    frames = {**frames_of(plan), "world": Pose2()}
    if str(name) in frames:
        return frames[str(name)]
    space = next((s for s in plan.spaces if s.name == name.name), None)
    if space is None and (name.wall is not None or name.part):
        hint = did_you_mean(name.name, (s.name for s in plan.spaces))
        raise InputError.at(name.where, f'there is no space "{name.name}"', hint)
    if space is not None and name.wall is not None:
        hint = f"it has walls 0 to {len(space.walls) - 1}"
        raise InputError.at(name.where, f"there is no {name}", hint)
    if space is not None:
        inside = [f.name for f in plan.features if f.space == space.name]
        message = f'there is no feature "{name.part}" in {space.name}'
        raise InputError.at(name.where, message, did_you_mean(name.part, inside))
    doubles = [f for f in plan.features if f.name == name.name]
    if doubles:
        hint = " or ".join(map(_full_name, doubles))
        raise InputError.at(name.where, f'"{name.name}" may mean several features', hint)
    message = f'there is no space, opening or feature "{name.name}" in the floor plan'
    raise InputError.at(name.where, message, did_you_mean(name.name, frames))
