"""Objects as bodies: links, joints and shapes, and the states of all bodies as one array."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pymunk

from daemon.model.kernels import kernel
from daemon.model.sut import TICK_RATE
from daemon.simulator import _chipmunk as chipmunk
from daemon.simulator._physics import FRICTION, link_filter, mass_properties, walker_filter
from grammars.model.geometry import Floats, Point2, Pose2, Ring
from grammars.model.kinematics import joint_motion, link_poses
from grammars.model.movers import PLANAR_JOINTS, is_fixed
from grammars.model.scene import Joint, Link, Scene, SceneObject

WORLD = 0
"""Slot of everything that never moves."""


@dataclass(frozen=True, slots=True)
class PlacedLink:
    """A link on its host body: ``frame`` is the link frame in the frame of body ``slot``.

    ``angle`` is the link's unwrapped angle in the world at the start [rad].
    """

    owner: str
    link: Link
    slot: int
    frame: Pose2
    angle: float

    @property
    def rings(self) -> tuple[Ring, ...]:
        """Polygons in the frame of the host body."""
        return tuple(self.frame.apply_ring(ring) for ring in self.link.polygons)


@dataclass(frozen=True, slots=True)
class MovingJoint:
    """A movable joint between the bodies ``parent`` and ``child`` (slots).

    The position of a revolute joint is (child angle - parent angle - ``offset``). That of a
    prismatic one is the way of the child frame along ``axis`` from the origin, both in the frame
    of the parent body. ``frame`` takes the object frame (all joints zero) to the parent body's.
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
    """All objects as bodies; slot ``i`` is ``bodies[i]``, slot 0 the world.

    ``walks`` are the joints of walking movers: three each, all from the world to the body.
    """

    bodies: list[pymunk.Body]
    placements: list[PlacedLink] = field(default_factory=list)
    motions: list[MovingJoint] = field(default_factory=list)
    walks: list[MovingJoint] = field(default_factory=list)
    owners: dict[pymunk.Shape, str] = field(default_factory=dict)
    holds: dict[str, float] = field(default_factory=dict)

    def placements_on(self, slot: int) -> list[PlacedLink]:
        """Return the links of one body."""
        return [p for p in self.placements if p.slot == slot]

    def behind(self, slot: int) -> list[int]:
        """Return ``slot`` and all its descendants, parents first."""
        slots = [slot]
        for parent in slots:
            slots += [m.child for m in self.motions if m.parent == parent]
        return slots


def assemble(
    space: pymunk.Space,
    scene: Scene,
    start: Mapping[str, float],
    holds: Mapping[str, float],
    height: float,
    walking: Collection[str] = (),
) -> BodyAssembly:
    """Add the links of all objects to ``space``.

    ``start`` overrides the initial position of joints by name. ``holds`` are joints with a fixed
    position for the whole run, ``walking`` the names of walking movers. Links within [0, height]
    above the floor collide.

    Raises:
        ValueError: an object's joints form no tree, or a moving link has no mass.
    """
    assembly = BodyAssembly([space.static_body])
    for group, item in enumerate(scene.objects, start=1):
        link_poses(item, item.initial)  # raises for joints that form no tree
        # Three steps: the mass of a body needs the frames of all its links, and shapes need a body
        # with its final centre of mass.
        first_slot = len(assembly.bodies)
        placer = _LinkPlacer(assembly, item, start, holds, item.name in walking)
        placements = [placer.place(link) for link in item.links]
        assembly.placements += placements
        for slot in range(first_slot, len(assembly.bodies)):
            _give_mass(space, assembly, slot, item)
        for placement in placements:
            _add_shapes(space, assembly, placement, group, height)
    return assembly


class _LinkPlacer:
    """Placement of the links of one object on bodies, parents before children."""

    def __init__(
        self,
        assembly: BodyAssembly,
        item: SceneObject,
        start: Mapping[str, float],
        holds: Mapping[str, float],
        walks: bool,
    ) -> None:
        self._assembly, self._item, self._walks = assembly, item, walks
        self._start, self._holds = start, holds
        self._links = {link.name: link for link in item.links}
        self._joints = {
            joint.child: (joint, q) for joint, q in zip(item.joints, item.initial, strict=True)
        }
        self._placed: dict[str, PlacedLink] = {}

    def place(self, link: Link) -> PlacedLink:
        """Place ``link`` after its ancestors."""
        if link.name not in self._placed:
            self._placed[link.name] = self._place(link)
        return self._placed[link.name]

    def _place(self, link: Link) -> PlacedLink:
        item, owner = self._item, f"{self._item.name}.{link.name}"
        base = PlacedLink(owner, link, WORLD, item.pose, item.pose.yaw)
        if link.name not in self._joints:
            return base
        joint, q = self._joints[link.name]
        # The three joints of a plane become one kinematic body instead of a chain of three.
        if self._walks and joint.name in PLANAR_JOINTS:
            return self._walker(base, joint)
        name = f"{item.name}.{joint.name}"
        q = self._holds.get(name, self._start.get(name, q))
        if joint.parent != "world":
            base = self.place(self._links[joint.parent])
        frame = base.frame @ joint_motion(joint, q)
        # The frame's yaw is wrapped, but a joint may exceed half a turn, and its position is the
        # difference of two unwrapped angles.
        angle = base.angle + (q if joint.kind == "revolute" else 0.0)
        if item.frozen or name in self._holds or is_fixed(joint):
            self._assembly.holds[name] = q
            return PlacedLink(owner, link, base.slot, frame, angle)
        slot = self._new_body(base.slot, frame, angle)
        offset = base.angle - self._assembly.bodies[base.slot].angle
        self._assembly.motions.append(
            MovingJoint(name, joint, owner, item.doorway, base.slot, slot, base.frame, offset)
        )
        return PlacedLink(owner, link, slot, Pose2(), angle)

    def _walker(self, base: PlacedLink, joint: Joint) -> PlacedLink:
        """Return the walking body; its carriers have no shape and do not move."""
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
    """Give a body its mass without moving its frame, and add it to the space."""
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
    # A new centre of mass moves the frame of a body; angle and position restore it, in this order.
    body.mass, body.center_of_gravity, body.moment = mass_properties(parts)
    body.angle = angle
    body.position = position
    space.add(body)


def _area(ring: Ring) -> float:
    return abs(pymunk.area_for_poly(list(ring)))


def _add_shapes(
    space: pymunk.Space, assembly: BodyAssembly, placement: PlacedLink, group: int, height: float
) -> None:
    # The robot cannot touch links above it or below the floor.
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


SLEEP_TIME = 0.5
"""Time at rest before bodies fall asleep [s]."""

_FALL_ASLEEP_TICKS = round(0.5 * SLEEP_TIME * TICK_RATE)
"""Ticks in which no body can fall asleep: half of the required time, as a safety margin."""


class BodyStates:
    """States of bodies as rows (x, y, angle, vx, vy, w), row i for body i; row 0 stays zero.

    A space lists its bodies in an order that changes when they fall asleep. Identities of bodies
    give the rows; the permutation is computed again only if the listing changes.

    Attributes:
        version: a number that changes with every reading of the table.
    """

    def __init__(self, space: pymunk.Space, bodies: list[pymunk.Body]) -> None:
        self._read_bodies = chipmunk.body_reader(space)
        self._rows = {body.id: row for row, body in enumerate(bodies) if row > 0}
        # One spare row at the end takes unused bodies.
        self._spare = len(bodies)
        self._table = np.zeros((len(bodies) + 1, 6))
        self._listing = b""
        self._order: npt.NDArray[np.intp] = np.empty(0, dtype=np.intp)
        self.version = 0
        self._tick, self._asleep = -1, False
        moving = [b for b in bodies[1:] if b.body_type != pymunk.Body.STATIC]
        sleepers = [b for b in moving if b.body_type == pymunk.Body.DYNAMIC]
        # Kinematic bodies (walking people) never sleep, even if they stand still.
        self._restless = len(sleepers) < len(moving)
        self._sleepers = [chipmunk.handle(body) for body in sleepers]
        self._awake = 0

    def at(self, tick: int) -> Floats:
        """Return the table, read again only if ``tick`` is new and a body may have moved."""
        if tick != self._tick:
            if not self._slept_since(tick):
                self._read()
            self._tick = tick
        return self._table

    def _slept_since(self, tick: int) -> bool:
        """Tell whether every body sleeps, and has slept since the last reading.

        In less than the time to fall asleep, no body can have woken, moved and fallen asleep again.
        """
        asleep = not self._restless and self._all_sleep()
        still = asleep and self._asleep and 0 <= tick - self._tick < _FALL_ASLEEP_TICKS
        self._asleep = asleep
        return still

    def _all_sleep(self) -> bool:
        sleepers, is_sleeping = self._sleepers, chipmunk.is_sleeping
        # First check the body that was awake last time: a leaf takes seconds to come to rest.
        if sleepers and not is_sleeping(sleepers[self._awake]):
            return False
        if all(map(is_sleeping, sleepers)):
            return True
        self._awake = next(k for k, body in enumerate(sleepers) if not is_sleeping(body))
        return False

    def _read(self) -> None:
        self.version += 1
        listing, values = self._read_bodies()
        if listing != self._listing:
            ids = np.frombuffer(listing, dtype=np.uintp).tolist()
            self._order = np.array([self._rows.get(i, self._spare) for i in ids], dtype=np.intp)
            self._listing = listing
        self._table[self._order] = values


@kernel
def _read_joints(
    bodies: Floats,
    parents: npt.NDArray[np.intp],
    children: npt.NDArray[np.intp],
    geometry: Floats,
    where: npt.NDArray[np.intp],
    states: Floats,
) -> None:
    """Write position and velocity of moving joint k to column ``where[k]`` of ``states``.

    Body velocities are those of the centre of mass.
    ``geometry`` rows: axis (2), origin (2), offset, centre of mass of the child (2) and of the
    parent (2), each in its own frame. A revolute joint has a zero axis.
    """
    for k in range(parents.shape[0]):
        p, q = bodies[parents[k]], bodies[children[k]]
        ax, ay = geometry[k, 0], geometry[k, 1]
        if ax == 0.0 and ay == 0.0:
            states[0, where[k]] = q[2] - p[2] - geometry[k, 4]
            states[1, where[k]] = q[5] - p[5]
            continue
        c, s = np.cos(p[2]), np.sin(p[2])
        wx, wy = c * ax - s * ay, s * ax + c * ay
        dx, dy = q[0] - p[0], q[1] - p[1]
        way = dx * wx + dy * wy - geometry[k, 2] * ax - geometry[k, 3] * ay
        qc, qs = np.cos(q[2]), np.sin(q[2])
        # From the parent's centre of mass to the child's: a turning parent carries the child along.
        # The rest of the child's velocity is that of the joint.
        rx = dx + qc * geometry[k, 5] - qs * geometry[k, 6]
        ry = dy + qs * geometry[k, 5] + qc * geometry[k, 6]
        rx -= c * geometry[k, 7] - s * geometry[k, 8]
        ry -= s * geometry[k, 7] + c * geometry[k, 8]
        speed = (q[3] - p[3] + p[5] * ry) * wx + (q[4] - p[4] - p[5] * rx) * wy
        states[0, where[k]], states[1, where[k]] = way, speed


class JointReader:
    """Reader of positions and velocities of named joints; those in ``holds`` stand still."""

    def __init__(
        self,
        names: tuple[str, ...],
        motions: list[MovingJoint],
        holds: dict[str, float],
        bodies: list[pymunk.Body],
    ) -> None:
        index = {name: i for i, name in enumerate(names)}
        self._where = np.array([index[m.name] for m in motions], dtype=np.intp)
        self._rest = np.zeros((2, len(names)))
        for name, position in holds.items():
            self._rest[0, index[name]] = position
        self._version, self._states = 0, (self._rest[0], self._rest[1])
        self._parents = np.array([m.parent for m in motions], dtype=np.intp)
        self._children = np.array([m.child for m in motions], dtype=np.intp)
        self._geometry = np.array([_joint_geometry(m, bodies) for m in motions]).reshape(-1, 9)

    def at(self, bodies: Floats, version: int) -> tuple[Floats, Floats]:
        """Return positions and velocities in the order of the names.

        They are computed once for each ``version`` of the table of bodies, which is never 0. The
        arrays never change.
        """
        if version != self._version:
            states = self._rest.copy()
            _read_joints(bodies, self._parents, self._children, self._geometry, self._where, states)
            states.flags.writeable = False
            self._version, self._states = version, (states[0], states[1])
        return self._states


def _joint_geometry(motion: MovingJoint, bodies: list[pymunk.Body]) -> tuple[float, ...]:
    axis = (0.0, 0.0) if motion.joint.kind == "revolute" else motion.axis
    origin = (motion.frame.x, motion.frame.y)
    child, parent = bodies[motion.child], bodies[motion.parent]
    return (*axis, *origin, motion.offset, *child.center_of_gravity, *parent.center_of_gravity)
