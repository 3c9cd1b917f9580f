"""Interface of a kind of system under test, and the simplest kind, ``idle``."""

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
    from grammars.model.mission import Mission
    from grammars.model.robot import Drive, Robot

S = TypeVar("S")


class StackKind(ABC, Generic[S]):
    """A kind of system under test; ``S`` is the type of its settings.

    Only :meth:`make` may load a compiler or a link to a stack. Checks use all other methods.
    """

    name: str
    """The ``kind`` of SUT files."""
    external: ClassVar[bool] = False
    """The system runs outside of the simulation, so two equal runs may differ."""
    plain_numbers: ClassVar[bool] = False
    """Parameters are in SI units: a SUT file may write a quantity with a unit for a number."""
    keys: ClassVar[tuple[str, ...]] = ()
    """Keys at the top of a SUT file that replace ``parameters``."""
    files: ClassVar[Literal["none", "parameters", "attached"]] = "none"
    """Use of ``files`` in a SUT file: refused, ROS parameter files, or attached to each run."""

    @abstractmethod
    def read(self, parameters: Mapping[str, Any]) -> S:
        """Return the settings in a tree of parameters.

        Raises ``ValueError`` for unusable parameters. Its subclass
        :class:`~daemon.stacks.findings.ParameterError` locates each problem in the tree.
        """

    @abstractmethod
    def make(self, settings: S) -> SystemUnderTest:
        """Return a fresh system; raises :class:`~daemon.model.attachments.SutMissing`."""

    def findings(self, settings: S) -> ParameterFindings:
        """Return warnings about ``settings``; raises ``ValueError`` as :meth:`read` does."""
        return ParameterFindings()

    def advise(self, settings: S, robot: Robot, mission: Mission) -> Iterable[ParameterFinding]:
        """Return warnings about ``settings`` for a robot and its mission."""
        return ()

    def top_speed(self, settings: S, robot: Robot) -> float:
        """Return an upper bound of the robot's speed over ground [m/s]; infinite if unlimited."""
        return speed_over_ground(robot.drive)

    def tolerance(self, settings: S) -> float:
        """Return the distance [m] within which a waypoint counts as reached; 0 if unknown."""
        return 0.0

    def defaults(self) -> Mapping[str, Any]:
        """Return the default of each parameter; empty if parameters have namespaces."""
        return {}

    def schemas(self) -> dict[str, dict[str, Any]]:
        """Return JSON Schemas for editors; the one of all parameters has the kind's name."""
        return {}


def speed_over_ground(drive: Drive, along: float = math.inf) -> float:
    """Return the highest speed of a drive [m/s] with at most ``along`` on either axis."""
    sideways = 0.0 if drive.kind == "differential" else drive.max_vy
    return math.hypot(min(drive.max_vx, along), min(sideways, along))


class Idle:
    """A system that stands still, for benchmarks and for watching a scene."""

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
