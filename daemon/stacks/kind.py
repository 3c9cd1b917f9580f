"""A kind of system under test: how its parameters are read and checked, how a system is made.

And the simplest one, ``idle``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Final, Generic, Literal, TypeVar

from daemon.model.sut import Briefing, Decision, Observation, Progress
from daemon.stacks.findings import ParameterFinding, ParameterFindings
from grammars.model.geometry import Twist2

if TYPE_CHECKING:
    from daemon.model.sut import SystemUnderTest
    from grammars.model.robot import Drive, Robot

S = TypeVar("S")


class StackKind(ABC, Generic[S]):
    """A kind of system under test; ``S`` is the form into which it reads its parameters.

    Only :meth:`make` may load a compiler or a link to a stack: all else is for checks.
    """

    name: str
    """The ``kind`` of SUT files."""
    external: ClassVar[bool] = False
    """The system lives outside of the simulation: no two runs of it need be equal."""
    plain_numbers: ClassVar[bool] = False
    """Parameters are in SI units, so that a quantity with a unit may stand for a number."""
    keys: ClassVar[tuple[str, ...]] = ()
    """Keys at the top of a SUT file that take the place of ``parameters``."""
    files: ClassVar[Literal["none", "parameters", "attached"]] = "none"
    """``files`` of a SUT file are refused, are ROS parameter files, or travel with each run."""

    @abstractmethod
    def read(self, parameters: Mapping[str, Any]) -> S:
        """Return the settings in a tree of parameters.

        Raises ``ValueError`` for parameters that cannot be used; its subclass
        :class:`~daemon.stacks.findings.ParameterError` says where in the tree each problem stands.
        """

    @abstractmethod
    def make(self, settings: S) -> SystemUnderTest:
        """Return a fresh system; raises :class:`~daemon.model.attachments.SutMissing`."""

    def findings(self, settings: S) -> ParameterFindings:
        """Return warnings about ``settings``; raises ``ValueError`` as :meth:`read` does."""
        return ParameterFindings()

    def advise(self, settings: S, robot: Robot) -> Iterable[ParameterFinding]:
        """Return warnings about ``settings`` for the sensors of a robot."""
        return ()

    def top_speed(self, settings: S, robot: Robot) -> float:
        """Return a bound of the robot's speed over ground [m/s]; infinite without any limit."""
        return speed_over_ground(robot.drive)

    def defaults(self) -> Mapping[str, Any]:
        """Return the default of each parameter, of kinds whose parameters have no namespaces."""
        return {}

    def schemas(self) -> dict[str, dict[str, Any]]:
        """Return JSON Schemas for editors by name; that of the kind's name is of all parameters."""
        return {}


def speed_over_ground(drive: Drive, along: float = math.inf) -> float:
    """Return the highest speed of a drive [m/s] with at most ``along`` on either axis."""
    sideways = 0.0 if drive.kind == "differential" else drive.max_vy
    return math.hypot(min(drive.max_vx, along), min(sideways, along))


class Idle:
    """Stands still and reaches nothing: for benchmarks, and for watching a scene."""

    period = 0.05
    needs_ground_truth = False

    def start(self, briefing: Briefing) -> None:
        """Nothing to prepare."""

    def update(self, observation: Observation) -> Decision:
        """Command zero velocity."""
        return Decision(Twist2(), Progress(0, 0, "active"))


class _IdleKind(StackKind[None]):
    name = "idle"

    def read(self, parameters: Mapping[str, Any]) -> None:
        if parameters:
            names = ", ".join(f'"{name}"' for name in parameters)
            raise ValueError(f"the idle system takes no parameters, given: {names}")

    def make(self, settings: None) -> SystemUnderTest:
        return Idle()


IDLE: Final = _IdleKind()
