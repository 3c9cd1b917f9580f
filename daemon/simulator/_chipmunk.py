"""Bodies and steps by Chipmunk's own functions, for code that runs in every tick.

A pymunk property takes two to six times as long as its Chipmunk function, and a step of the space
half a microsecond more. The extra work of pymunk (vectors, checks, the end of a step) is
unnecessary in every tick: with it, a corridor at rest takes a fifth more CPU. Code that uses a body
only a few times a run uses pymunk.

These functions are private to pymunk; ``pyproject.toml`` admits only versions that have them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final, Protocol

import numpy as np
import pymunk
from pymunk._chipmunk_cffi import ffi, lib
from pymunk.batch import BodyFields, Buffer

from daemon.simulator._physics import DT
from grammars.model.geometry import Floats

Handle = Any
"""Reference to a body for the functions below, valid as long as the body exists."""

_FIELDS: Final = (
    BodyFields.BODY_ID
    | BodyFields.POSITION
    | BodyFields.ANGLE
    | BodyFields.VELOCITY
    | BodyFields.ANGULAR_VELOCITY
)
_COLUMNS: Final = 6


class Vector(Protocol):
    """A position [m] or velocity [m/s] in the world."""

    x: float
    y: float


# Units as in pymunk. Like properties, setters wake the body.
position: Final[Callable[[Handle], Vector]] = lib.cpBodyGetPosition
angle: Final[Callable[[Handle], float]] = lib.cpBodyGetAngle
velocity: Final[Callable[[Handle], Vector]] = lib.cpBodyGetVelocity
angular_velocity: Final[Callable[[Handle], float]] = lib.cpBodyGetAngularVelocity
is_sleeping: Final[Callable[[Handle], bool]] = lib.cpBodyIsSleeping
set_velocity: Final[Callable[[Handle, tuple[float, float]], None]] = lib.cpBodySetVelocity
set_angular_velocity: Final[Callable[[Handle, float], None]] = lib.cpBodySetAngularVelocity


def handle(body: pymunk.Body) -> Handle:
    """Return the handle of a body for the functions above."""
    return body._body


def stepper(space: pymunk.Space) -> Callable[[], None]:
    """Return a function that steps ``space`` by a tick.

    pymunk's own step also adds and removes objects at the request of callbacks. The simulator does
    not need that: callbacks only take notes, and behaviours act between steps.
    """
    return partial(lib.cpSpaceStep, space._space, DT)


def body_reader(space: pymunk.Space) -> Callable[[], tuple[bytes, Floats]]:
    """Return a reader of all bodies of a space, similar to :func:`pymunk.batch.get_space_bodies`.

    It returns ids, and rows (x, y, angle, vx, vy, w) in the same order, including sleeping bodies
    and perhaps the space's own static body. The order changes when a body falls asleep or wakes.
    The rows are valid until the next call.
    """
    raw, buffer = space._space, Buffer()
    ints, floats = buffer._int_arr, buffer._float_arr
    data = ffi.new("pmBatchedData *")
    visit = ffi.addressof(lib, "pmSpaceBodyGetIteratorFuncBatched")
    data.fields, data.intArray, data.floatArray = _FIELDS.value, ints, floats
    each, layout = lib.cpSpaceEachBody, (ffi.NULL, ffi.NULL, 0)
    ids = np.empty(0, dtype=np.uintp)
    values: Floats = np.empty((0, _COLUMNS))

    def read() -> tuple[bytes, Floats]:
        nonlocal layout, ids, values
        ints.num = floats.num = 0
        each(raw, visit, data)
        # Chipmunk's arrays move when they grow, which happens at first.
        now = (ints.arr, floats.arr, ints.num)
        if now != layout:
            layout = now
            ids = np.frombuffer(buffer.int_buf(), dtype=np.uintp)
            values = np.frombuffer(buffer.float_buf(), dtype=np.float64).reshape(-1, _COLUMNS)
        return ids.tobytes(), values

    return read
