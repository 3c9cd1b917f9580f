"""Objects of a scene as rigid bodies: which link belongs to which body, and where.

Every joint that can move gets a body of its own; a link without a joint, a frozen object's link
and a link behind a held joint are rigidly part of the body they hang on (the world in the end).
A body's frame is its link's frame with all joints at zero, so anchors and polygons of the object
frame serve all links of a chain as they are.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import pymunk

from daemon.simulator._physics import FRICTION, link_filter, mass_properties, walker_filter
from grammars.model.geometry import Point2, Pose2, Ring
from grammars.model.kinematics import joint_motion, link_poses
from grammars.model.movers import PLANAR_JOINTS, is_fixed
from grammars.model.scene import Joint, Link, Scene, SceneObject

WORLD = 0
"""Slot of everything that never moves."""


@dataclass(frozen=True, slots=True)
class PlacedLink:
    """A link on its host: ``frame`` is the link frame in the frame of body ``slot``.

    ``angle`` is the link's unwrapped angle in the world at the start [rad].
    """

    owner: str
    link: Link
    slot: int
    frame: Pose2
    angle: float

    @property
    def rings(self) -> tuple[Ring, ...]:
        """The polygons in the frame of the host body."""
        return tuple(self.frame.apply_ring(ring) for ring in self.link.polygons)


@dataclass(frozen=True, slots=True)
class MovingJoint:
    """A joint that can move: ``parent`` and ``child`` slots, in whose frames it acts.

    The joint position is (child angle - parent angle - ``offset``) for revolute joints; for
    prismatic ones the way of the child frame along ``axis`` from ``origin``, both in the frame of
    the parent body. ``frame`` takes the object frame (all joints zero) to the parent body's.
    """

    name: str
    joint: Joint
    owner: str
    doorway: str
    parent: int
    child: int
    frame: Pose2
    offset: float

    @property
    def axis(self) -> Point2:
        """Unit direction of the joint in the parent body's frame."""
        c, s = math.cos(self.frame.yaw), math.sin(self.frame.yaw)
        x, y = self.joint.axis
        return (c * x - s * y, s * x + c * y)


@dataclass(slots=True)
class BodyAssembly:
    """All objects taken apart into bodies; slot ``i`` is ``bodies[i]``, slot 0 the world.

    ``walks`` are the joints of movers that walk: three each, all from the world to the body.
    """

    bodies: list[pymunk.Body]
    placements: list[PlacedLink] = field(default_factory=list)
    motions: list[MovingJoint] = field(default_factory=list)
    walks: list[MovingJoint] = field(default_factory=list)
    owners: dict[pymunk.Shape, str] = field(default_factory=dict)
    held: dict[str, float] = field(default_factory=dict)

    def placements_on(self, slot: int) -> list[PlacedLink]:
        """Return the links that are part of one body."""
        return [p for p in self.placements if p.slot == slot]

    def behind(self, slot: int) -> list[int]:
        """Return ``slot`` and all slots that hang on it, parents first."""
        found = [slot]
        for parent in found:
            found += [m.child for m in self.motions if m.parent == parent]
        return found


def assemble(
    space: pymunk.Space,
    scene: Scene,
    start: Mapping[str, float],
    held: Mapping[str, float],
    height: float,
    walking: Collection[str] = (),
) -> BodyAssembly:
    """Add the links of all objects to ``space``.

    ``start`` overrides the initial position of joints by name, ``held`` names joints that stay
    where they are for the whole run, ``walking`` movers that walk. Links within [0, height]
    above the floor collide.

    Raises:
        ValueError: an object's joints form no tree, or a moving link has no mass.
    """
    assembly = BodyAssembly([space.static_body])
    for group, item in enumerate(scene.objects, start=1):
        link_poses(item, item.initial)  # raises for joints that form no tree
        first_slot = len(assembly.bodies)
        placer = _LinkPlacer(assembly, item, start, held, item.name in walking)
        placements = [placer.place(link) for link in item.links]
        assembly.placements += placements
        for slot in range(first_slot, len(assembly.bodies)):
            _give_mass(space, assembly, slot, item)
        for placement in placements:
            _add_shapes(space, assembly, placement, group, height)
    return assembly


class _LinkPlacer:
    """Places the links of one object, parents before children, and makes bodies for them."""

    def __init__(
        self,
        assembly: BodyAssembly,
        item: SceneObject,
        start: Mapping[str, float],
        held: Mapping[str, float],
        walks: bool,
    ) -> None:
        self._assembly, self._item, self._walks = assembly, item, walks
        self._start, self._held = start, held
        self._links = {link.name: link for link in item.links}
        self._joints = {
            joint.child: (joint, q) for joint, q in zip(item.joints, item.initial, strict=True)
        }
        self._placed: dict[str, PlacedLink] = {}

    def place(self, link: Link) -> PlacedLink:
        """Return where ``link`` is, after everything it hangs on."""
        if link.name not in self._placed:
            self._placed[link.name] = self._place(link)
        return self._placed[link.name]

    def _place(self, link: Link) -> PlacedLink:
        item, owner = self._item, f"{self._item.name}.{link.name}"
        base = PlacedLink(owner, link, WORLD, item.pose, item.pose.yaw)
        if link.name not in self._joints:
            return base
        joint, q = self._joints[link.name]
        # Three joints that make a plane become one kinematic body instead of three bodies in a row.
        if self._walks and joint.name in PLANAR_JOINTS:
            return self._walker(base, joint)
        name = f"{item.name}.{joint.name}"
        q = self._held.get(name, self._start.get(name, q))
        if joint.parent != "world":
            base = self.place(self._links[joint.parent])
        frame = base.frame @ joint_motion(joint, q)
        angle = base.angle + (q if joint.kind == "revolute" else 0.0)
        if item.frozen or name in self._held or is_fixed(joint):
            self._assembly.held[name] = q
            return PlacedLink(owner, link, base.slot, frame, angle)
        slot = self._new_body(base.slot, frame, angle)
        offset = base.angle - self._assembly.bodies[base.slot].angle
        self._assembly.motions.append(
            MovingJoint(name, joint, owner, item.doorway, base.slot, slot, base.frame, offset)
        )
        return PlacedLink(owner, link, slot, Pose2(), angle)

    def _walker(self, base: PlacedLink, joint: Joint) -> PlacedLink:
        """Return the body that walks; its carriers have no shape and stay behind."""
        item, assembly = self._item, self._assembly
        if joint.name != PLANAR_JOINTS[-1]:
            return base
        x, y, yaw = (self._start[f"{item.name}.{name}"] for name in PLANAR_JOINTS)
        angle = item.pose.yaw + yaw
        slot = self._new_body(WORLD, item.pose @ Pose2(x, y, yaw), angle)
        body = assembly.bodies[slot]
        body.body_type = pymunk.Body.KINEMATIC
        for part in item.joints[: len(PLANAR_JOINTS)]:
            name = f"{item.name}.{part.name}"
            assembly.walks.append(
                MovingJoint(name, part, base.owner, "", WORLD, slot, item.pose, item.pose.yaw)
            )
        return PlacedLink(base.owner, base.link, slot, Pose2(), angle)

    def _new_body(self, host: int, frame: Pose2, angle: float) -> int:
        body = pymunk.Body()
        body.angle = angle
        body.position = self._assembly.bodies[host].local_to_world((frame.x, frame.y))
        self._assembly.bodies.append(body)
        return len(self._assembly.bodies) - 1


def _give_mass(space: pymunk.Space, assembly: BodyAssembly, slot: int, item: SceneObject) -> None:
    """Give a body its mass and add it to the space, keeping its frame where it is."""
    if assembly.bodies[slot].body_type == pymunk.Body.KINEMATIC:
        space.add(assembly.bodies[slot])
        return
    parts = []
    for placement in assembly.placements_on(slot):
        if placement.link.mass <= 0.0 or not placement.rings:
            raise ValueError(f"object {item.name}: moving link {placement.owner} has no mass")
        areas = [(ring, _area(ring)) for ring in placement.rings]
        total = sum(area for _, area in areas)
        parts += [(ring, placement.link.mass * area / total) for ring, area in areas]
    body = assembly.bodies[slot]
    position, angle = body.position, body.angle
    # A new centre of mass moves the frame of a body; angle and position put it back, in this order.
    body.mass, body.center_of_gravity, body.moment = mass_properties(parts)
    body.angle = angle
    body.position = position
    space.add(body)


def _area(ring: Ring) -> float:
    return abs(pymunk.area_for_poly(list(ring)))


def _add_shapes(
    space: pymunk.Space, assembly: BodyAssembly, placement: PlacedLink, group: int, height: float
) -> None:
    if placement.link.z_min >= height or placement.link.z_max <= 0.0:
        return
    for ring in placement.rings:
        shape = pymunk.Poly(assembly.bodies[placement.slot], list(ring))
        walks = assembly.bodies[placement.slot].body_type == pymunk.Body.KINEMATIC
        moves = placement.slot != WORLD
        shape.filter = walker_filter(group) if walks else link_filter(group, moves=moves)
        shape.friction = FRICTION
        assembly.owners[shape] = placement.owner
        space.add(shape)
