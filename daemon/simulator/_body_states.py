"""Reads the states of all bodies and joints of a space in one call, in a fixed order.

Asking 20 doors one by one costs more than the physics does; with one call for all of them a run
went from 926 to 1279 times real time.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pymunk
from pymunk.batch import BodyFields, Buffer, get_space_bodies

from daemon.model.kernels import kernel
from daemon.model.sut import TICK_RATE
from daemon.simulator._assembly import MovingJoint
from grammars.model.geometry import Floats

_FIELDS = (
    BodyFields.BODY_ID
    | BodyFields.POSITION
    | BodyFields.ANGLE
    | BodyFields.VELOCITY
    | BodyFields.ANGULAR_VELOCITY
)

SLEEP_TIME = 0.5
"""How long bodies have to rest before they fall asleep [s]."""

_FALL_ASLEEP_TICKS = round(0.5 * SLEEP_TIME * TICK_RATE)
"""No body can fall asleep within so many ticks; half of what it takes, to be on the safe side."""


class BodyStates:
    """States of bodies as rows (x, y, angle, vx, vy, w), row i for body i; row 0 stays zero.

    The order in which a space lists its bodies changes when they fall asleep, so rows are found
    by body identity; the permutation is only worked out again when the listing changed.
    """

    def __init__(self, space: pymunk.Space, bodies: list[pymunk.Body]) -> None:
        self._space = space
        self._rows = {body.id: row for row, body in enumerate(bodies) if row > 0}
        # One spare row at the end takes bodies that are not asked for.
        self._spare = len(bodies)
        self._table = np.zeros((len(bodies) + 1, 6))
        self._buffer = Buffer()
        self._listing = b""
        self._order: npt.NDArray[np.intp] = np.empty(0, dtype=np.intp)
        self._tick, self._asleep = -1, False
        moving = [b for b in bodies[1:] if b.body_type != pymunk.Body.STATIC]
        self._sleepers = [b for b in moving if b.body_type == pymunk.Body.DYNAMIC]
        # Kinematic bodies (people who walk) never sleep, whether they move or not.
        self._restless = len(self._sleepers) < len(moving)

    def at(self, tick: int) -> Floats:
        """Return the table, read again only when ``tick`` is new and something may have moved."""
        if tick != self._tick:
            if not self._slept_since(tick):
                self._read()
            self._tick = tick
        return self._table

    def _slept_since(self, tick: int) -> bool:
        """Whether every body sleeps, and has since the last reading.

        Within less than the time bodies take to fall asleep none can have woken, moved and
        fallen asleep again.
        """
        asleep = not self._restless and all(body.is_sleeping for body in self._sleepers)
        still = asleep and self._asleep and 0 <= tick - self._tick < _FALL_ASLEEP_TICKS
        self._asleep = asleep
        return still

    def _read(self) -> None:
        self._buffer.clear()
        get_space_bodies(self._space, _FIELDS, self._buffer)
        # Sleeping bodies are listed too, and the space's own static body, but in another order.
        listing = bytes(self._buffer.int_buf())
        if listing != self._listing:
            ids = np.frombuffer(listing, dtype=np.uintp).tolist()
            self._order = np.array([self._rows.get(i, self._spare) for i in ids], dtype=np.intp)
            self._listing = listing
        values = np.frombuffer(self._buffer.float_buf(), dtype=np.float64)
        self._table[self._order] = values.reshape(-1, 6)


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
        # From the parent's centre of mass to the child's: the parent, turning, carries the child
        # along; what is left of the child's velocity is that of the joint.
        rx = dx + qc * geometry[k, 5] - qs * geometry[k, 6]
        ry = dy + qs * geometry[k, 5] + qc * geometry[k, 6]
        rx -= c * geometry[k, 7] - s * geometry[k, 8]
        ry -= s * geometry[k, 7] + c * geometry[k, 8]
        speed = (q[3] - p[3] + p[5] * ry) * wx + (q[4] - p[4] - p[5] * rx) * wy
        states[0, where[k]], states[1, where[k]] = way, speed


class JointReader:
    """Positions and velocities of named joints; held joints stay at their position, speed 0."""

    def __init__(
        self,
        names: tuple[str, ...],
        motions: list[MovingJoint],
        held: dict[str, float],
        bodies: list[pymunk.Body],
    ) -> None:
        index = {name: i for i, name in enumerate(names)}
        self._where = np.array([index[m.name] for m in motions], dtype=np.intp)
        self._rest = np.zeros((2, len(names)))
        for name, position in held.items():
            self._rest[0, index[name]] = position
        self._tick, self._states = -1, self._rest
        self._parents = np.array([m.parent for m in motions], dtype=np.intp)
        self._children = np.array([m.child for m in motions], dtype=np.intp)
        self._geometry = np.array([_joint_geometry(m, bodies) for m in motions]).reshape(-1, 9)

    def at(self, tick: int, bodies: Floats) -> tuple[Floats, Floats]:
        """Return positions and velocities in the order of the names; computed once per tick.

        The arrays are the caller's to read, not to change.
        """
        if tick != self._tick:
            self._tick, self._states = tick, self._rest.copy()
            _read_joints(
                bodies, self._parents, self._children, self._geometry, self._where, self._states
            )
        return self._states[0], self._states[1]


def _joint_geometry(motion: MovingJoint, bodies: list[pymunk.Body]) -> tuple[float, ...]:
    axis = (0.0, 0.0) if motion.joint.kind == "revolute" else motion.axis
    origin = (motion.frame.x, motion.frame.y)
    child, parent = bodies[motion.child], bodies[motion.parent]
    return (*axis, *origin, motion.offset, *child.center_of_gravity, *parent.center_of_gravity)
