"""The small stack that ships with the project.

The pilot is an honest stack: scan matching on the map's signed distance field fused with
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

if TYPE_CHECKING:
    from daemon.model.sut import SystemUnderTest
    from grammars.model.robot import Robot

__all__ = ["PILOT", "PilotParameters"]


class _PilotKind(StackKind[PilotParameters]):
    name = "pilot"
    plain_numbers = True

    def read(self, parameters: Mapping[str, Any]) -> PilotParameters:
        return read_parameters(parameters)

    def make(self, settings: PilotParameters) -> SystemUnderTest:
        # Compiled kernels are only needed to drive, not to check a campaign's parameters.
        from daemon.stacks.pilot.driver import Pilot

        return Pilot(settings)

    def top_speed(self, settings: PilotParameters, robot: Robot) -> float:
        return speed_over_ground(robot.drive, settings.max_speed)

    def defaults(self) -> Mapping[str, Any]:
        return {each.name: each.default for each in fields(PilotParameters)}

    def schemas(self) -> dict[str, dict[str, Any]]:
        from grammars.editor import editor_schema

        schema = editor_schema(PilotParameters, "Parameters of the pilot")
        del schema["$schema"]
        return {self.name: schema}


PILOT: Final = _PilotKind()
