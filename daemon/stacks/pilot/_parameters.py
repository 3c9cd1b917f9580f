"""Parameters of the pilot, each with a default, a unit and a range."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Annotated, Any, Final, TypeAlias

from pydantic import ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass

from daemon.stacks.findings import ParameterError, ParameterFinding
from grammars.text.diagnostics import did_you_mean
from grammars.text.documents import plain_message
from grammars.text.quantity import QuantityField

_POSITIVE: Final = Field(gt=0.0, allow_inf_nan=False)
_NOT_NEGATIVE: Final = Field(ge=0.0, allow_inf_nan=False)
_LENGTH: Final = QuantityField("length", plain=True)
_TIME: Final = QuantityField("time", plain=True)
_Length: TypeAlias = Annotated[float, _LENGTH, _POSITIVE]
_Margin: TypeAlias = Annotated[float, _LENGTH, _NOT_NEGATIVE]
_Angle: TypeAlias = Annotated[float, QuantityField("angle", plain=True), _POSITIVE]
_Speed: TypeAlias = Annotated[float, QuantityField("speed", plain=True), _POSITIVE]
_Turn: TypeAlias = Annotated[float, QuantityField("angular speed", plain=True), _POSITIVE]
_Acceleration: TypeAlias = Annotated[float, QuantityField("acceleration", plain=True), _POSITIVE]
_Time: TypeAlias = Annotated[float, _TIME, _POSITIVE]
_Wait: TypeAlias = Annotated[float, _TIME, _NOT_NEGATIVE]
_Count: TypeAlias = Annotated[int, Field(ge=0, le=1000)]


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid", strict=True))
class PilotParameters:
    """Settings of the pilot: quantities with a unit, or plain numbers in SI units."""

    start_sigma: _Length = 0.05
    """[m] Standard deviation of the start position that the pilot receives."""
    start_yaw_sigma: _Angle = 0.03
    """[rad] Standard deviation of the start heading that the pilot receives."""
    max_speed: _Speed = 0.5
    """[m/s] Also bounded by the drive."""
    max_turn: _Turn = 1.0
    """[rad/s] Also bounded by the drive."""
    acceleration: _Acceleration = 0.5
    """[m/s^2] Also bounded by the drive."""
    lookahead: _Length = 0.45
    """[m] Of the pure pursuit at low speed."""
    goal_tolerance: _Length = 0.15
    """[m] A waypoint is reached within this distance of the estimated position."""
    yaw_tolerance: _Angle = 0.1
    """[rad] Tolerance of the heading at a waypoint that has one."""
    preferred_clearance: _Length = 1.0
    """[m] Clearance of the base's centre to walls where there is room."""
    obstacle_memory: _Time = 45.0
    """[s] An obstacle out of sight is forgotten after this time; keep it below patience."""
    safety_margin: _Margin = 0.05
    """[m] Margin around the footprint in motion."""
    stop_distance: _Margin = 0.3
    """[m] Distance at full speed to obstacles ahead that the map lacks, in proportion less at lower
    speed."""
    blocked_distance: _Margin = 0.8
    """[m] Waiting distance before an obstacle in the way, such as a swinging door."""
    wait_before_replanning: _Wait = 3.0
    """[s] A blocked robot waits this long before it looks for another way."""
    patience: _Time = 60.0
    """[s] The pilot gives the mission up after waiting this long without any way."""
    recoveries: _Count = 6
    """Number of attempts to get free without progress in between."""


def read_parameters(values: Mapping[str, object]) -> PilotParameters:
    """Return validated parameters; raises :class:`ParameterError` with all errors."""
    names = tuple(field.name for field in fields(PilotParameters))
    problems = [
        ParameterFinding(
            (name,), f'no parameter "{name}" in the pilot', did_you_mean(str(name), names)
        )
        for name in values
        if name not in names
    ]
    usable: dict[str, Any] = {name: values[name] for name in names if name in values}
    parameters = PilotParameters()
    try:
        parameters = PilotParameters(**usable)
    except ValidationError as error:
        problems += [
            ParameterFinding(
                issue["loc"],
                f"{plain_message(issue)} (given: {issue['input']!r})",
            )
            for issue in error.errors()
        ]
    if problems:
        raise ParameterError(problems)
    return parameters


def doubts(settings: PilotParameters) -> Iterator[ParameterFinding]:
    """Yield warnings about values that were probably meant in another unit."""
    if settings.goal_tolerance > 1.0:
        message = f"{settings.goal_tolerance:g} m: waypoints count as reached from far away"
        yield ParameterFinding(("goal_tolerance",), message, "write cm if centimetres are meant")
    for name, most in (("start_yaw_sigma", 1.0), ("yaw_tolerance", math.pi)):
        value = getattr(settings, name)
        if value >= most:
            message = f"{value:g} rad: any heading is good enough"
            yield ParameterFinding((name,), message, "write deg if degrees are meant")
    if settings.obstacle_memory >= settings.patience:
        message = f"{settings.obstacle_memory:g} s, patience is {settings.patience:g} s"
        hint = "the pilot gives up before it looks again"
        yield ParameterFinding(("obstacle_memory",), message, hint)
