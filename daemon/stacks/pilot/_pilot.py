"""The pilot and the idle stack as systems under test, and the warm-up of the pilot's kernels."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from daemon.model.sut import Briefing, Decision, LaserScan, Observation, Odometry, Progress
from daemon.stacks.pilot._parameters import PilotParameters
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import FREE, OCCUPIED, OccupancyGrid
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot import Drive, Laser, OdometryNoise, Robot

if TYPE_CHECKING:
    from daemon.stacks.pilot._driver import Driver

PERIOD: Final = 0.05
"""Seconds between two decisions."""


class Pilot:
    """The small navigation stack of the project, as a system under test."""

    def __init__(self, parameters: PilotParameters) -> None:
        self.parameters = parameters
        self._driver: Driver | None = None

    @property
    def period(self) -> float:
        """Seconds of simulated time between two updates."""
        return PERIOD

    @property
    def needs_ground_truth(self) -> bool:
        """It localises itself."""
        return False

    def start(self, briefing: Briefing) -> None:
        """Prepare the map for one run; raises ``ValueError`` for a map without free cells."""
        # Compiled kernels are only needed to drive, not to check a campaign's parameters.
        from daemon.stacks.pilot._driver import Driver

        self._driver = Driver(briefing, self.parameters, PERIOD)

    def update(self, observation: Observation) -> Decision:
        """Decide; raises ``RuntimeError`` before ``start``."""
        if self._driver is None:
            raise RuntimeError("the pilot was not started")
        return self._driver.update(observation)


class Idle:
    """Stands still and reaches nothing: for benchmarks, and for watching a scene."""

    @property
    def period(self) -> float:
        """Seconds of simulated time between two updates."""
        return PERIOD

    @property
    def needs_ground_truth(self) -> bool:
        """It needs nothing."""
        return False

    def start(self, briefing: Briefing) -> None:
        """Nothing to prepare."""

    def update(self, observation: Observation) -> Decision:
        """Command zero velocity."""
        return Decision(Twist2(), Progress(0, 0, "active"))


def warm_up() -> None:
    """Drive a small robot for a few updates in a small room with an obstacle the map misses."""
    cells = np.full((60, 60), FREE, dtype=np.int8)
    cells[0], cells[-1], cells[:, 0], cells[:, -1] = (OCCUPIED,) * 4
    grid = OccupancyGrid(0.05, 0.0, 0.0, cells)
    drive = Drive("omnidirectional", 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 100.0, 100.0, 0.0)
    laser = Laser(Pose2(), 0.3, -math.pi / 2, math.pi / 2, 19, 0.05, 5.0, 10.0, 0.01, 0.0)
    ring = ((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2))
    robot = Robot("warm-up", ring, 0.3, 50.0, drive, laser, OdometryNoise(20.0, 0.0, 0.0, 0.0))
    start = Pose2(0.8, 1.5, 0.0)
    mission = Mission("warm-up", start, (Waypoint("there", 2.2, 1.5, 0.0),))
    pilot = Pilot(PilotParameters(wait_before_replanning=0.0))
    pilot.start(Briefing(robot, grid, mission, start, np.random.SeedSequence(0)))
    angles = np.linspace(laser.angle_min, laser.angle_max, laser.rays)
    walls = np.minimum(2.15 / np.cos(angles).clip(1e-6), 1.45 / np.abs(np.sin(angles)).clip(1e-6))
    ranges = walls.astype(np.float32)
    ranges[laser.rays // 2] = 0.7
    for k in range(4):
        now = k * PERIOD
        sample = Odometry(now, Pose2(), Twist2())
        pilot.update(Observation(now, (sample,), (LaserScan(now, ranges),)))
