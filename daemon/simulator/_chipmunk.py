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
from typing import Any, Final, NamedTuple, Protocol

import pymunk

from daemon.simulator._physics import DT

Handle = Any
"""A body as the functions take it; valid for as long as the body is."""


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


def _set_velocity(body: pymunk.Body, velocity: tuple[float, float]) -> None:
    body.velocity = velocity


def _set_angular_velocity(body: pymunk.Body, angular_velocity: float) -> None:
    body.angular_velocity = angular_velocity


def _public_step(space: pymunk.Space) -> Callable[[], None]:
    return lambda: space.step(DT)


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
)
"""The same by what pymunk promises."""


def find_direct() -> BodyFunctions | None:
    """Return Chipmunk's own functions; ``None`` when this pymunk keeps them elsewhere."""
    try:
        from pymunk._chipmunk_cffi import lib

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
        )
        # Tried once: names alone do not say that they still mean what they did.
        found.set_velocity(handle(body), (1.0, 2.0))
        found.step(space)()
        moved = (found.velocity(handle(body)).x, found.velocity(handle(body)).y)
    except (ImportError, AttributeError, TypeError):
        return None
    return found if moved == (1.0, 2.0) else None


def _direct_step(
    chipmunk_step: Callable[[Any, float], None], handle: Callable[[pymunk.Space], Any]
) -> Callable[[pymunk.Space], Callable[[], None]]:
    def of(space: pymunk.Space) -> Callable[[], None]:
        """Return what steps ``space`` by a tick.

        pymunk's own step also adds and removes what callbacks asked for during it. Nothing in this
        room does that: callbacks take notes, and behaviours act between steps.
        """
        raw = handle(space)
        return lambda: chipmunk_step(raw, DT)

    return of


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
) = find_direct() or PUBLIC
