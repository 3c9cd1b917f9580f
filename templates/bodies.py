"""Scene objects as rigid bodies of a 3D simulator: shapes, inertia, joints.

The frame of a link is in its centre of mass and has the axes of its object. Joints and inertia
therefore need no rotation. A joint's pose in the child's frame means the same in every version of
SDF.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from grammars.model.geometry import Pose2, Ring
from grammars.model.kinematics import WORLD, driven_joints, link_poses
from grammars.model.scene import Joint, Link, SceneObject


@dataclass(frozen=True, slots=True)
class Box:
    """Box: ``pose`` x, y, z [m], roll, pitch, yaw [rad] in the link's frame, ``size`` [m]."""

    pose: tuple[float, ...]
    size: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Prism:
    """Convex polygon ``points`` [m] extruded upwards by ``height`` [m] from ``pose``."""

    pose: tuple[float, ...]
    points: Ring
    height: float


@dataclass(frozen=True, slots=True)
class BodyLink:
    """Rigid body; ``inertia`` ixx, iyy, izz, ixy [kg m^2] about its own frame."""

    name: str
    pose: tuple[float, ...]
    mass: float
    inertia: tuple[float, float, float, float]
    boxes: tuple[Box, ...]
    prisms: tuple[Prism, ...]


@dataclass(frozen=True, slots=True)
class BodyJoint:
    """Joint; ``pose`` is in the child's frame, ``moment`` [kg m^2 or kg] is that of its load."""

    name: str
    of: str
    kind: str
    parent: str
    child: str
    pose: tuple[float, ...]
    axis: tuple[float, float, float]
    lower: float
    upper: float
    friction: float
    damping: float
    stiffness: float
    rest: float
    moment: float


@dataclass(frozen=True, slots=True)
class Body:
    """Model of a simulator; an immovable one has no joints and is ``static``."""

    links: tuple[BodyLink, ...]
    joints: tuple[BodyJoint, ...]
    static: bool


def body_of(thing: SceneObject) -> Body:
    """Return ``thing`` as a body with joints at zero; a frozen one in its pose, without joints.

    Links without a joint get one that fixes them to the world, as in the scene. Links without a
    shape are omitted; links on them are fixed to the world at their start.
    """
    solid = tuple(link for link in thing.links if link.polygons)
    moving = () if thing.frozen else driven_joints(thing)
    positions = [
        # Simulators start every joint at zero; immovable joints stay at their start.
        0.0 if joint in moving else initial
        for joint, initial in zip(thing.joints, thing.initial, strict=True)
    ]
    # At the origin, so that equal objects are equal to the last digit at any place.
    placed = link_poses(replace(thing, pose=Pose2()), positions)
    names = _link_names(solid)
    links = tuple(_link(link, placed[link.name], names[link.name]) for link in solid)
    if not moving:
        return Body(links, (), True)
    by_name = {link.name: body for link, body in zip(solid, links, strict=True)}
    used = set(names.values())
    joints = [_joint(joint, by_name, names, used, placed[joint.child]) for joint in moving]
    above = {joint.child: joint for joint in thing.joints}
    children = {joint.child for joint in moving}
    # In Gazebo, a link without a joint falls.
    resting = [link.name for link in solid if link.name not in children]
    fixed = [
        _fixed(name, names.get(above[name].parent, WORLD) if name in above else WORLD, names, used)
        for name in resting
    ]
    return Body(links, (*fixed, *joints), False)


def _link_names(links: Sequence[Link]) -> dict[str, str]:
    """Return names that SDF accepts: it reserves ``world`` and ``__names__``."""
    names: dict[str, str] = {}
    for link in links:
        reserved = link.name == WORLD or (link.name[:2] == link.name[-2:] == "__")
        names[link.name] = _free(
            f"{link.name}-link" if reserved else link.name, set(names.values())
        )
    return names


def _free(name: str, used: set[str]) -> str:
    while name in used:
        name += "-"
    used.add(name)
    return name


def _link(link: Link, moved: Pose2, name: str) -> BodyLink:
    rings = [moved.apply_ring(ring) for ring in link.polygons]
    moments = [_moments(ring) for ring in rings]
    area = sum(m.area for m in moments)
    x = sum(m.area * m.x for m in moments) / area
    y = sum(m.area * m.y for m in moments) / area
    height = link.z_max - link.z_min
    z = (link.z_min + link.z_max) / 2.0
    density = link.mass / area
    upright = link.mass * height * height / 12.0
    along_x = density * sum(m.xx + m.area * (m.x - x) ** 2 for m in moments)
    along_y = density * sum(m.yy + m.area * (m.y - y) ** 2 for m in moments)
    product = density * sum(m.xy + m.area * (m.x - x) * (m.y - y) for m in moments)
    boxes, prisms = [], []
    for ring in rings:
        local = tuple((px - x, py - y) for px, py in ring)
        box = _box(local, height)
        if box is not None:
            boxes.append(box)
        else:
            prisms.append(Prism((0.0, 0.0, -height / 2.0, 0.0, 0.0, 0.0), local, height))
    return BodyLink(
        name,
        (x, y, z, 0.0, 0.0, 0.0),
        link.mass,
        (along_y + upright, along_x + upright, along_x + along_y, -product),
        tuple(boxes),
        tuple(prisms),
    )


@dataclass(frozen=True, slots=True)
class _Moments:
    """Area [m^2], centroid [m] and central second moments [m^4] of a polygon."""

    area: float
    x: float
    y: float
    xx: float
    yy: float
    xy: float


def _moments(ring: Ring) -> _Moments:
    """Return the moments by Green's theorem, about the first corner to keep digits."""
    x0, y0 = ring[0]
    points = [(x - x0, y - y0) for x, y in ring]
    area = x = y = xx = yy = xy = 0.0
    for (ax, ay), (bx, by) in zip(points, points[1:] + points[:1], strict=True):
        cross = ax * by - bx * ay
        area += cross / 2.0
        x += (ax + bx) * cross / 6.0
        y += (ay + by) * cross / 6.0
        xx += (ax * ax + ax * bx + bx * bx) * cross / 12.0
        yy += (ay * ay + ay * by + by * by) * cross / 12.0
        xy += (ax * by + 2.0 * ax * ay + 2.0 * bx * by + bx * ay) * cross / 24.0
    x, y = x / area, y / area
    sign = math.copysign(1.0, area)
    return _Moments(
        abs(area),
        x + x0,
        y + y0,
        sign * (xx - area * x * x),
        sign * (yy - area * y * y),
        sign * (xy - area * x * y),
    )


def _box(ring: Ring, height: float) -> Box | None:
    """Return a rectangle as a box, otherwise ``None``."""
    if len(ring) != 4:
        return None
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = ring
    skew = math.hypot(ax + cx - bx - dx, ay + cy - by - dy)
    dot = (bx - ax) * (cx - bx) + (by - ay) * (cy - by)
    if skew > 1e-8 or abs(dot) > 1e-8:
        return None
    yaw = math.atan2(by - ay, bx - ax)
    size = (math.hypot(bx - ax, by - ay), math.hypot(cx - bx, cy - by), height)
    # A quarter turn swaps length and width, so axis-parallel boxes have no turn.
    turns = round(yaw / (math.pi / 2.0))
    yaw -= turns * math.pi / 2.0
    size = (size[1], size[0], height) if turns % 2 else size
    yaw = 0.0 if abs(yaw) < 1e-12 else yaw
    return Box(((ax + cx) / 2.0, (ay + cy) / 2.0, 0.0, 0.0, 0.0, yaw), size)


def _joint(
    joint: Joint,
    links: dict[str, BodyLink],
    names: dict[str, str],
    used: set[str],
    placed: Pose2,
) -> BodyJoint:
    """Return a moving joint; ``placed`` is the pose of its child by the resting joints."""
    child = links[joint.child]
    turns = joint.kind == "revolute"
    anchor = placed.apply(joint.anchor) if turns else (child.pose[0], child.pose[1])
    x, y = anchor[0] - child.pose[0], anchor[1] - child.pose[1]
    axis = Pose2(0.0, 0.0, placed.yaw).apply(joint.axis)
    return BodyJoint(
        _free(joint.name, used),
        joint.name,
        joint.kind,
        WORLD if joint.parent == WORLD else names[joint.parent],
        child.name,
        (x, y, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 1.0) if turns else (*axis, 0.0),
        joint.lower,
        joint.upper,
        joint.friction,
        joint.damping,
        joint.stiffness,
        joint.rest,
        child.inertia[2] + child.mass * (x**2 + y**2) if turns else child.mass,
    )


def _fixed(name: str, bearer: str, names: dict[str, str], used: set[str]) -> BodyJoint:
    return BodyJoint(
        _free(f"{names[name]}-to-{bearer}", used),
        "",
        "fixed",
        bearer,
        names[name],
        (0.0,) * 6,
        (0.0, 0.0, 1.0),
        *(0.0,) * 7,
    )
