"""The small stack that ships with the project: ``pilot``, and ``idle`` that does nothing.

The pilot is a small honest stack: scan matching on the map's signed distance field fused with
odometry, A* and a smoothed path, a layer of obstacles the map does not show, pure pursuit
behind a guard that sweeps the footprint. It knows what :mod:`daemon.model.sut` gives it and no
more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Final

from daemon.stacks.kind import StackKind, speed_over_ground
from daemon.stacks.pilot._parameters import PilotParameters, read_parameters
from daemon.stacks.pilot._pilot import Idle, Pilot

if TYPE_CHECKING:
    from daemon.model.sut import SystemUnderTest
    from grammars.model.robot import Robot

__all__ = ["IDLE", "PILOT", "PilotParameters"]


class _PilotKind(StackKind[PilotParameters]):
    name = "pilot"
    plain_numbers = True

    def read(self, parameters: Mapping[str, Any]) -> PilotParameters:
        return read_parameters(parameters)

    def make(self, settings: PilotParameters) -> SystemUnderTest:
        return Pilot(settings)

    def top_speed(self, settings: PilotParameters, robot: Robot) -> float:
        return speed_over_ground(robot.drive, settings.max_speed)

    def defaults(self) -> Mapping[str, Any]:
        return {each.name: each.default for each in fields(PilotParameters)}


class _IdleKind(StackKind[None]):
    name = "idle"

    def read(self, parameters: Mapping[str, Any]) -> None:
        if parameters:
            names = ", ".join(f'"{name}"' for name in parameters)
            raise ValueError(f"the idle system takes no parameters, given: {names}")

    def make(self, settings: None) -> SystemUnderTest:
        return Idle()


PILOT: Final = _PilotKind()
IDLE: Final = _IdleKind()
