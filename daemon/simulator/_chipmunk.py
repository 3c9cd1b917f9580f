"""Bodies and steps by Chipmunk's own functions, for what happens in every tick.

A pymunk property takes two to six times as long as the function of Chipmunk it calls, and a step
of the space half a microsecond more: for the room what each does besides (vectors, checks, what
waits for the end of a step) is not needed in every tick. Who reads or writes a body a few times a
run uses pymunk.

They are where pymunk keeps them for itself. A pymunk that has them elsewhere is used by its public
properties instead: the same numbers, slower.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from functools import partial
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
import pymunk
from pymunk.batch import BodyFields, Buffer, get_space_bodies

from daemon.simulator._physics import DT
from grammars.model.geometry import Floats

Handle = Any
"""A body as the functions take it; valid for as long as the body is."""

BodyReader = Callable[[], tuple[bytes, Floats]]
"""Reads all bodies of a space: their ids, and rows (x, y, angle, vx, vy, w) in the same order.

Sleeping bodies are among them and the space's own static body may be; the order changes when a
body falls asleep or wakes. The rows are valid until the next call.
"""

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

    @property
    def x(self) -> float:
        """Along the x axis."""

    @property
    def y(self) -> float:
        """Along the y axis."""


class BodyFunctions(NamedTuple):
    """What a tick needs of a body, which is named by its handle; units as in pymunk.

    Writing wakes the body, as writing its properties does.
    """

    handle: Callable[[pymunk.Body], Handle]
    position: Callable[[Handle], Vector]
    angle: Callable[[Handle], float]
    velocity: Callable[[Handle], Vector]
    angular_velocity: Callable[[Handle], float]
    is_sleeping: Callable[[Handle], bool]
    set_velocity: Callable[[Handle, tuple[float, float]], None]
    set_angular_velocity: Callable[[Handle, float], None]
    step: Callable[[pymunk.Space], Callable[[], None]]
    reader: Callable[[pymunk.Space], BodyReader]


def _set_velocity(body: pymunk.Body, velocity: tuple[float, float]) -> None:
    body.velocity = velocity


def _set_angular_velocity(body: pymunk.Body, angular_velocity: float) -> None:
    body.angular_velocity = angular_velocity


def _public_step(space: pymunk.Space) -> Callable[[], None]:
    return lambda: space.step(DT)


def _public_reader(space: pymunk.Space) -> BodyReader:
    buffer = Buffer()

    def read() -> tuple[bytes, Floats]:
        buffer.clear()
        get_space_bodies(space, _FIELDS, buffer)
        values = np.frombuffer(buffer.float_buf(), dtype=np.float64)
        return bytes(buffer.int_buf()), values.reshape(-1, _COLUMNS)

    return read


PUBLIC: Final = BodyFunctions(
    lambda body: body,
    operator.attrgetter("position"),
    operator.attrgetter("angle"),
    operator.attrgetter("velocity"),
    operator.attrgetter("angular_velocity"),
    operator.attrgetter("is_sleeping"),
    _set_velocity,
    _set_angular_velocity,
    _public_step,
    _public_reader,
)
"""The same by what pymunk promises."""


def find_direct() -> BodyFunctions | None:
    """Return Chipmunk's own functions; ``None`` when this pymunk keeps them elsewhere."""
    try:
        from pymunk._chipmunk_cffi import ffi, lib

        body, space = pymunk.Body(), pymunk.Space()
        handle, handle_of_space = operator.attrgetter("_body"), operator.attrgetter("_space")
        found = BodyFunctions(
            handle,
            lib.cpBodyGetPosition,
            lib.cpBodyGetAngle,
            lib.cpBodyGetVelocity,
            lib.cpBodyGetAngularVelocity,
            lib.cpBodyIsSleeping,
            lib.cpBodySetVelocity,
            lib.cpBodySetAngularVelocity,
            _direct_step(lib.cpSpaceStep, handle_of_space),
            partial(_direct_reader, ffi, lib, handle_of_space),
        )
        # Tried once: names alone do not say that they still mean what they did.
        body.mass = body.moment = 1.0
        space.add(body)
        found.set_velocity(handle(body), (1.0, 2.0))
        found.step(space)()
        (ids, rows), (same_ids, same_rows) = found.reader(space)(), PUBLIC.reader(space)()
        moved = (found.velocity(handle(body)).x, found.velocity(handle(body)).y)
    except (ImportError, AttributeError, TypeError):
        return None
    read = ids == same_ids and np.array_equal(rows, same_rows)
    return found if read and moved == (1.0, 2.0) else None


def _direct_step(
    chipmunk_step: Callable[[Any, float], None], handle: Callable[[pymunk.Space], Any]
) -> Callable[[pymunk.Space], Callable[[], None]]:
    def of(space: pymunk.Space) -> Callable[[], None]:
        """Return what steps ``space`` by a tick.

        pymunk's own step also adds and removes what callbacks asked for during it. Nothing in this
        room does that: callbacks take notes, and behaviours act between steps.
        """
        return partial(chipmunk_step, handle(space), DT)

    return of


def _direct_reader(
    ffi: Any, lib: Any, handle: Callable[[pymunk.Space], Any], space: pymunk.Space
) -> BodyReader:
    """Return what :func:`pymunk.batch.get_space_bodies` does, set up once for all calls."""
    raw, buffer = handle(space), Buffer()
    ints, floats = buffer._int_arr, buffer._float_arr
    data = ffi.new("pmBatchedData *")
    visit = ffi.addressof(lib, "pmSpaceBodyGetIteratorFuncBatched")
    data.fields, data.intArray, data.floatArray = _FIELDS.value, ints, floats
    each, seen = lib.cpSpaceEachBody, (ffi.NULL, ffi.NULL, 0)
    ids = np.empty(0, dtype=np.uintp)
    values: Floats = np.empty((0, _COLUMNS))

    def read() -> tuple[bytes, Floats]:
        nonlocal seen, ids, values
        ints.num = floats.num = 0
        each(raw, visit, data)
        # Chipmunk's arrays move when they grow, at first.
        now = (ints.arr, floats.arr, ints.num)
        if now != seen:
            seen = now
            ids = np.frombuffer(buffer.int_buf(), dtype=np.uintp)
            values = np.frombuffer(buffer.float_buf(), dtype=np.float64).reshape(-1, _COLUMNS)
        return ids.tobytes(), values

    return read


def release(space: pymunk.Space) -> None:
    """Let a space go that is stepped no more, with all that is in it.

    Its collision handlers hold themselves, and the space that holds them: it would stay in memory
    until the next collection of garbage. Their callbacks have to be gone by now, since Chipmunk
    still calls them when what touches is removed.
    """
    for handler in getattr(space, "_handlers", {}).values():
        vars(handler).clear()


(
    handle,
    position,
    angle,
    velocity,
    angular_velocity,
    is_sleeping,
    set_velocity,
    set_angular_velocity,
    stepper,
    body_reader,
) = find_direct() or PUBLIC
