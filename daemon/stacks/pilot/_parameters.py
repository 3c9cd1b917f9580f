"""The pilot's parameters: every one with a default, a unit and a range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Annotated, Any, TypeAlias

from pydantic import ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass

from grammars.text.diagnostics import did_you_mean
from grammars.text.documents import plain_message

_Positive: TypeAlias = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
_NotNegative: TypeAlias = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
_Count: TypeAlias = Annotated[int, Field(ge=0, le=1000)]


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid", strict=True))
class PilotParameters:
    """What can be set on the pilot: plain numbers in SI units, radians."""

    start_sigma: _Positive = 0.05
    """[m] How far the start position it is told may be off, standard deviation."""
    start_yaw_sigma: _Positive = 0.03
    """[rad] How far the start heading it is told may be off, standard deviation."""
    range_sigma: _NotNegative = 0.015
    """[m] Error of one matched return beyond the laser's own noise, mostly the raster of the
    map."""
    independent_rays: _Positive = 2.0
    """Every how-many-th ray tells something new: neighbours share the error of a map cell."""
    map_sigma: _NotNegative = 0.02
    """[m] Systematic error of the map, which no number of scans averages away; part of every
    reported covariance."""
    map_yaw_sigma: _NotNegative = 0.005
    """[rad] The same for headings."""
    max_speed: _Positive = 0.5
    """[m/s] Also bounded by the drive."""
    max_turn: _Positive = 1.0
    """[rad/s] Also bounded by the drive."""
    acceleration: _Positive = 0.5
    """[m/s^2] Also bounded by the drive."""
    turn_acceleration: _Positive = 1.5
    """[rad/s^2] Also bounded by the drive."""
    lookahead: _Positive = 0.45
    """[m] Of the pure pursuit at low speed."""
    lookahead_time: _NotNegative = 0.6
    """[s] What speed adds to the lookahead."""
    goal_tolerance: _Positive = 0.15
    """[m] A waypoint is reached within this distance, as far as the pilot knows."""
    yaw_tolerance: _Positive = 0.1
    """[rad] And with its heading this near, when it asks for one."""
    preferred_clearance: _Positive = 1.0
    """[m] Of the base's centre to walls, where there is room."""
    clearance_weight: _NotNegative = 6.0
    """How much more a metre costs at the tightest passable place."""
    clearance_margin: _NotNegative = 0.02
    """[m] Kept free beyond the inscribed circle of the footprint."""
    explained_distance: _Positive = 0.15
    """[m] Returns nearer to a wall of the map than this are the wall."""
    obstacle_range: _Positive = 4.0
    """[m] Returns beyond are not remembered."""
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
    slow_clearance: _Positive = 0.35
    """[m] With less room beside it the robot slows down."""
    creep_speed: _Positive = 0.12
    """[m/s] What it slows down to."""
    wait_before_replanning: _NotNegative = 3.0
    """[s] A blocked robot waits this long before it looks for another way."""
    patience: _Positive = 60.0
    """[s] After waiting this long without any way the mission is given up."""
    recoveries: _Count = 6
    """How often it tries to free itself without getting further."""


def read_parameters(given: Mapping[str, object]) -> PilotParameters:
    """Return validated parameters; raises ``ValueError`` naming everything wrong with ``given``."""
    known = tuple(field.name for field in fields(PilotParameters))
    problems = [
        f'no parameter "{name}" in the pilot: {did_you_mean(str(name), known)}'
        for name in given
        if name not in known
    ]
    usable: dict[str, Any] = {name: given[name] for name in known if name in given}
    parameters = PilotParameters()
    try:
        parameters = PilotParameters(**usable)
    except ValidationError as error:
        problems += [
            f'parameter "{_place(issue["loc"])}" {plain_message(issue)} (given: {issue["input"]!r})'
            + _hint(issue["type"])
            for issue in error.errors()
        ]
    if problems:
        raise ValueError("; ".join(problems))
    return parameters


def _hint(kind: str) -> str:
    return "; write a plain number in SI units" if kind == "float_type" else ""


def _place(location: tuple[int | str, ...]) -> str:
    return ".".join(str(part) for part in location)
