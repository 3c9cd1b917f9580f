"""From observations to a pose, a list of things around the base and the obstacles remembered."""

from __future__ import annotations

import numpy as np

from daemon.model.sut import Briefing, Estimate, LaserScan, Observation
from daemon.stacks.pilot._parameters import PilotParameters
from daemon.stacks.pilot.guard import Surroundings
from daemon.stacks.pilot.localisation import Localiser, NoisyTruth, project
from daemon.stacks.pilot.map_field import MapField
from daemon.stacks.pilot.obstacles import ObstacleLayer
from grammars.model.geometry import Pose2

_REMEMBERED = 600
"""Most remembered obstacle cells the guard looks at."""
_NEAR = 1.5
"""Remembered obstacles within this distance concern the guard [m]."""


class Sensing:
    """Keeps the pose, the latest scan and the obstacle layer up to date."""

    def __init__(self, briefing: Briefing, field: MapField, parameters: PilotParameters) -> None:
        robot = briefing.robot
        laser = robot.laser
        angles = laser.angle_min + np.arange(laser.rays) * laser.angle_increment
        self._laser = laser
        self._cosines, self._sines = np.cos(angles), np.sin(angles)
        self._mount = np.array([laser.mount.x, laser.mount.y, laser.mount.yaw])
        self._points = np.zeros((laser.rays + _REMEMBERED, 2))
        self._known = np.zeros(laser.rays + _REMEMBERED, dtype=np.uint8)
        self._sifted = np.zeros((laser.rays, 2))
        self._localiser: Localiser | None = None
        self._truth: NoisyTruth | None = None
        if parameters.localisation == "noisy-ground-truth":
            self._truth = NoisyTruth(parameters, briefing.seed)
        else:
            self._localiser = Localiser(field, laser, robot.odometry, briefing.start, parameters)
        self.obstacles = ObstacleLayer(
            field,
            laser,
            explained=parameters.explained_distance,
            reach=parameters.obstacle_range,
            memory=max(1, round(parameters.obstacle_memory * laser.rate)),
        )
        self.pose = briefing.start
        self.around = Surroundings(self._points, self._known, 0, 0)

    def take(self, observation: Observation) -> Estimate | None:
        """Take what is new; return a new estimate when there was a scan."""
        if self._localiser is not None:
            self._follow(self._localiser, observation)
            self.pose = self._localiser.pose
        elif self._truth is not None:
            self._copy(self._truth, observation)
        if not observation.scans:
            return None
        source = self._localiser or self._truth
        return source.estimate(observation.time) if source is not None else None

    def _follow(self, localiser: Localiser, observation: Observation) -> None:
        samples = list(observation.odometry)
        for scan in observation.scans:
            while samples and samples[0].time <= scan.time:
                localiser.move(samples.pop(0))
            localiser.move_until(scan.time, samples[0] if samples else None)
            count = self._project(scan)
            used = self.obstacles.sift(self._points, count, localiser.pose, self._sifted)
            localiser.correct(self._sifted, used)
            self._look(scan, count, localiser.pose)
        for sample in samples:
            localiser.move(sample)
        localiser.move_until(observation.time)

    def _copy(self, truth: NoisyTruth, observation: Observation) -> None:
        if observation.ground_truth is None:
            raise ValueError("localisation noisy-ground-truth needs the true pose in observations")
        truth.take(observation.ground_truth)
        self.pose = truth.pose
        for scan in observation.scans:
            self._look(scan, self._project(scan), truth.pose)

    def _project(self, scan: LaserScan) -> int:
        laser = self._laser
        if scan.ranges.shape != (laser.rays,):
            raise ValueError(f"a scan of {scan.ranges.size} rays from a laser of {laser.rays}")
        return project(
            scan.ranges, self._cosines, self._sines, self._mount,
            laser.range_min, laser.range_max, self._points,
        )  # fmt: skip

    def _look(self, scan: LaserScan, count: int, pose: Pose2) -> None:
        self.obstacles.update(scan.ranges, self._points, self._known, count, pose)
        used = self.obstacles.append_nearby(pose, _NEAR, self._points, count)
        self._known[count:used] = 0
        self.around = Surroundings(self._points, self._known, count, used)
