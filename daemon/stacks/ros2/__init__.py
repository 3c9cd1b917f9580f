"""ROS 2 stacks of users, started by their own commands, in lock step with the simulation.

A link (:mod:`daemon.stacks.ros2.link`) talks to a stack through a relay in the stack's own ROS 2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal

from daemon.model.attachments import SutMissing
from daemon.model.execution import commands_allowed
from daemon.stacks.findings import ParameterFinding, ParameterFindings
from daemon.stacks.kind import StackKind
from daemon.stacks.ros2.attached import contradictions
from daemon.stacks.ros2.keys import ROS2_KEYS
from daemon.stacks.ros2.settings import (
    Ros2Settings,
    advise_for_robot,
    read_settings,
    warnings_about,
)

if TYPE_CHECKING:
    from daemon.model.sut import SystemUnderTest
    from grammars.model.mission import Mission
    from grammars.model.robot import Robot


class _Ros2Kind(StackKind[Ros2Settings]):
    name = "ros2"
    external = True
    keys = ROS2_KEYS
    files: ClassVar[Literal["attached"]] = "attached"

    def read(self, parameters: Mapping[str, Any]) -> Ros2Settings:
        return read_settings(parameters)

    def make(self, settings: Ros2Settings) -> SystemUnderTest:
        """Return a stack that starts with its run.

        Raises :class:`SutMissing` where commands of SUT files are refused.
        """
        if not commands_allowed():
            raise SutMissing(
                "this worker refuses commands of SUT files: start it with --commands to allow them"
            )
        # Checks of campaigns need not load the code that starts processes.
        from daemon.stacks.ros2.stack import Ros2Stack

        return Ros2Stack(settings)

    def findings(self, settings: Ros2Settings) -> ParameterFindings:
        return ParameterFindings((*warnings_about(settings), *contradictions(settings)))

    def advise(
        self, settings: Ros2Settings, robot: Robot, mission: Mission
    ) -> Iterable[ParameterFinding]:
        return advise_for_robot(settings, robot)


ROS2: Final = _Ros2Kind()
