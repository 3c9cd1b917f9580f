"""The pilot's parameters: every one with a default, a unit and a range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Annotated, Any, TypeAlias

from pydantic import ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass

from daemon.stacks.findings import ParameterError, ParameterFinding
from grammars.text.diagnostics import did_you_mean
from grammars.text.documents import plain_message

_Positive: TypeAlias = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
_NotNegative: TypeAlias = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
_Count: TypeAlias = Annotated[int, Field(ge=0, le=1000)]


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid", strict=True))
class PilotParameters:
    """Settings of the pilot: plain numbers in SI units, radians."""

    start_sigma: _Positive = 0.05
    """[m] How far the start position it is told may be off, standard deviation."""
    start_yaw_sigma: _Positive = 0.03
    """[rad] How far the start heading it is told may be off, standard deviation."""
    max_speed: _Positive = 0.5
    """[m/s] Also bounded by the drive."""
    max_turn: _Positive = 1.0
    """[rad/s] Also bounded by the drive."""
    acceleration: _Positive = 0.5
    """[m/s^2] Also bounded by the drive."""
    lookahead: _Positive = 0.45
    """[m] Of the pure pursuit at low speed."""
    goal_tolerance: _Positive = 0.15
    """[m] A waypoint is reached within this distance, as far as the pilot knows."""
    yaw_tolerance: _Positive = 0.1
    """[rad] And with its heading this near, when it asks for one."""
    preferred_clearance: _Positive = 1.0
    """[m] Of the base's centre to walls, where there is room."""
    obstacle_memory: _Positive = 45.0
    """[s] An obstacle out of sight is forgotten after this; less than patience, so that the robot
    looks again before it gives up."""
    safety_margin: _NotNegative = 0.05
    """[m] Around the footprint in motion."""
    stop_distance: _NotNegative = 0.3
    """[m] Kept, at full speed, to whatever the map does not show on the way it drives; in
    proportion less when it is slower. Not kept to what is beside it: a person may come nearer."""
    blocked_distance: _NotNegative = 0.8
    """[m] The robot waits this far before something that blocks its way, which leaves a door room
    to swing."""
    wait_before_replanning: _NotNegative = 3.0
    """[s] A blocked robot waits this long before it looks for another way."""
    patience: _Positive = 60.0
    """[s] After waiting this long without any way the mission is given up."""
    recoveries: _Count = 6
    """How often it tries to free itself without getting further."""


def read_parameters(given: Mapping[str, object]) -> PilotParameters:
    """Return validated parameters; raises :class:`ParameterError` with everything wrong."""
    known = tuple(field.name for field in fields(PilotParameters))
    problems = [
        ParameterFinding(
            (name,), f'no parameter "{name}" in the pilot', did_you_mean(str(name), known)
        )
        for name in given
        if name not in known
    ]
    usable: dict[str, Any] = {name: given[name] for name in known if name in given}
    parameters = PilotParameters()
    try:
        parameters = PilotParameters(**usable)
    except ValidationError as error:
        problems += [
            ParameterFinding(
                issue["loc"],
                f"{plain_message(issue)} (given: {issue['input']!r})",
                "write a plain number in SI units" if issue["type"] == "float_type" else "",
            )
            for issue in error.errors()
        ]
    if problems:
        raise ParameterError(problems)
    return parameters
