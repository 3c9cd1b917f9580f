"""Sensing: from observations to the pose, the surroundings and the obstacles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import machine_code
from daemon.model.sut import Briefing, Estimate, LaserScan, Observation
from daemon.stacks.pilot._parameters import PilotParameters
from daemon.stacks.pilot.localisation import Localiser
from daemon.stacks.pilot.maps import MapField, Scan, UnmappedObstacles, project
from grammars.model.geometry import Floats, Pose2
from grammars.model.robot import Laser


class Surroundings(NamedTuple):
    """Points around the base: ``points`` (n, 2) in the map.

    The first m are the returns of the latest scan of each laser; ``is_wall`` (m,) flags those on
    walls of the map. The others are remembered obstacles.
    """

    points: Floats
    is_wall: npt.NDArray[np.uint8]


class Sensing:
    """State of the pose, the latest scan of each laser and the obstacles.

    All lasers see obstacles. The map is drawn at the height of the first laser. Only lasers at
    that height also correct the pose, because other heights may have other walls.

    Attributes:
        obstacles: the obstacles that the map lacks.
        around: the surroundings at the latest scan.
    """

    def __init__(self, briefing: Briefing, field: MapField, parameters: PilotParameters) -> None:
        robot = briefing.robot
        self._lasers = {laser.name: laser for laser in robot.lasers}
        self._map_height = robot.laser.z
        scan = np.empty(0, dtype=np.float32), (0.0,) * 3, (0.0,) * 4
        self._project = machine_code(project, field, scan)
        self._localiser = Localiser(field, robot.odometry, briefing.start, parameters)
        self._field = field
        scans = parameters.obstacle_memory * sum(laser.rate for laser in robot.lasers)
        self.obstacles = UnmappedObstacles(field, max(1, round(scans)))
        nothing = np.empty((0, 2)), np.empty(0, dtype=np.uint8)
        self._returns = dict.fromkeys(self._lasers, nothing)
        self.around = Surroundings(*nothing)

    @property
    def pose(self) -> Pose2:
        """The estimated pose of the base in the map."""
        return self._localiser.pose

    def take(self, observation: Observation) -> Estimate | None:
        """Take a new observation; return a new estimate when it has a scan."""
        localiser = self._localiser
        samples = list(observation.odometry)
        for scan in observation.scans:
            while samples and samples[0].time <= scan.time:
                localiser.move(samples.pop(0))
            localiser.move_until(scan.time)
            self._look(scan)
        for sample in samples:
            localiser.move(sample)
        localiser.move_until(observation.time)
        return localiser.estimate(observation.time) if observation.scans else None

    def _look(self, scan: LaserScan) -> None:
        """Correct the pose by a scan, then update the obstacles and the surroundings."""
        laser = self._lasers[scan.laser]
        if laser.z == self._map_height:
            _, _, sure = self._project(self._field, self._placed(scan, laser))
            self._localiser.correct(sure, laser)
        placed = self._placed(scan, laser)
        points, is_wall, _ = self._project(self._field, placed)
        self.obstacles.update(placed, points, is_wall)
        self._returns[scan.laser] = points, is_wall
        returns, flags = zip(*self._returns.values(), strict=True)
        everything = np.concatenate((*returns, self.obstacles.centres))
        self.around = Surroundings(everything, np.concatenate(flags))

    def _placed(self, scan: LaserScan, laser: Laser) -> Scan:
        """Return a scan at the pose; raises ``ValueError`` for a wrong number of rays."""
        if scan.ranges.shape != (laser.rays,):
            raise ValueError(f"a scan of {scan.ranges.size} rays from a laser of {laser.rays}")
        at = self.pose @ laser.mount
        reach = laser.range_min, laser.range_max
        angles = laser.angle_min, laser.angle_increment
        return scan.ranges, (at.x, at.y, at.yaw), (*angles, *reach)
