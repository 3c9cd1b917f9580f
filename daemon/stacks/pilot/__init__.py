"""The pilot, a small navigation stack that ships with the project.

Scan matching on the map's signed distance field, fused with odometry. A* with a smoothed path. A
layer of obstacles that the map lacks. Pure pursuit behind a guard that sweeps the footprint. The
pilot knows only :mod:`daemon.model.sut`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Final

from daemon.stacks.kind import StackKind, speed_over_ground
from daemon.stacks.pilot._parameters import PilotParameters, doubts, read_parameters

if TYPE_CHECKING:
    from daemon.model.sut import SystemUnderTest
    from daemon.stacks.findings import ParameterFinding
    from grammars.model.mission import Mission
    from grammars.model.robot import Robot


class _PilotKind(StackKind[PilotParameters]):
    name = "pilot"

    def read(self, parameters: Mapping[str, Any]) -> PilotParameters:
        return read_parameters(parameters)

    def make(self, settings: PilotParameters) -> SystemUnderTest:
        # Only driving needs compiled kernels; a check of parameters does not.
        from daemon.stacks.pilot.driver import Pilot

        return Pilot(settings)

    def top_speed(self, settings: PilotParameters, robot: Robot) -> float:
        return speed_over_ground(robot.drive, settings.max_speed)

    def tolerance(self, settings: PilotParameters) -> float:
        return settings.goal_tolerance

    def advise(
        self, settings: PilotParameters, robot: Robot, mission: Mission
    ) -> Iterable[ParameterFinding]:
        return doubts(settings)

    def defaults(self) -> Mapping[str, Any]:
        return {each.name: each.default for each in fields(PilotParameters)}

    def schemas(self) -> dict[str, dict[str, Any]]:
        from grammars.editor import editor_schema

        schema = editor_schema(PilotParameters, "Parameters of the pilot")
        del schema["$schema"]
        return {self.name: schema}


PILOT: Final = _PilotKind()
