"""The pilot and the idle stack as systems under test."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from daemon.model.sut import Briefing, Decision, Observation, Progress
from daemon.stacks.pilot._parameters import PilotParameters
from grammars.model.geometry import Twist2

if TYPE_CHECKING:
    from daemon.stacks.pilot.driver import Driver

PERIOD: Final = 0.05
"""Seconds between two decisions."""


class Pilot:
    """The small navigation stack of the project, as a system under test. It localises itself."""

    period = PERIOD
    needs_ground_truth = False

    def __init__(self, parameters: PilotParameters) -> None:
        self.parameters = parameters
        self._driver: Driver | None = None

    def start(self, briefing: Briefing) -> None:
        """Prepare the map for one run; raises ``ValueError`` for a map without free cells."""
        # Compiled kernels are only needed to drive, not to check a campaign's parameters.
        from daemon.stacks.pilot.driver import Driver

        self._driver = Driver(briefing, self.parameters, PERIOD)

    def update(self, observation: Observation) -> Decision:
        """Decide; raises ``RuntimeError`` before ``start``."""
        if self._driver is None:
            raise RuntimeError("the pilot was not started")
        return self._driver.update(observation)


class Idle:
    """Stands still and reaches nothing: for benchmarks, and for watching a scene."""

    period = PERIOD
    needs_ground_truth = False

    def start(self, briefing: Briefing) -> None:
        """Nothing to prepare."""

    def update(self, observation: Observation) -> Decision:
        """Command zero velocity."""
        return Decision(Twist2(), Progress(0, 0, "active"))
