"""The ROS navigation stack as people run it: AMCL, costmap_2d, navfn, DWA, move_base.

Written anew from the published behaviour of the ROS 1 Noetic packages, configured by the YAML
files people already have, quirks included (:mod:`daemon.stacks.ros1.quirks`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal

from daemon.stacks.findings import ParameterFinding, ParameterFindings
from daemon.stacks.kind import StackKind

if TYPE_CHECKING:
    from daemon.model.sut import SystemUnderTest
    from daemon.stacks.ros1.configuration import RosParameters
    from grammars.model.mission import Mission
    from grammars.model.robot import Robot


class _RosKind(StackKind["RosParameters"]):
    name = "ros"
    plain_numbers = True
    files: ClassVar[Literal["parameters"]] = "parameters"

    def read(self, parameters: Mapping[str, Any]) -> RosParameters:
        # Here and below: a late import, so that tests of other stacks need not wait for it.
        from daemon.stacks.ros1.configuration import read_ros

        return read_ros(parameters)

    def make(self, settings: RosParameters) -> SystemUnderTest:
        from daemon.stacks.ros1.stack import RosStack

        return RosStack(settings)

    def findings(self, settings: RosParameters) -> ParameterFindings:
        return settings.findings

    def advise(
        self, settings: RosParameters, robot: Robot, mission: Mission
    ) -> Iterable[ParameterFinding]:
        from daemon.stacks.ros1.advice import advise

        return advise(settings, robot, mission)

    def top_speed(self, settings: RosParameters, robot: Robot) -> float:
        from daemon.stacks.ros1.dwa import DwaParameters

        planner, bound = settings.local_planner, super().top_speed(settings, robot)
        if isinstance(planner, DwaParameters) and planner.max_vel_trans > 0.0:
            return min(planner.max_vel_trans, bound)
        return bound

    def tolerance(self, settings: RosParameters) -> float:
        return settings.local_planner.xy_goal_tolerance

    def schemas(self) -> dict[str, dict[str, Any]]:
        from daemon.stacks.ros1.schema import ros_definitions

        return ros_definitions()


ROS: Final = _RosKind()
