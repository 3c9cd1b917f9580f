"""From observations to a pose, a list of things around the base and the obstacles remembered."""

from __future__ import annotations

import math

import numpy as np

from daemon.model.sut import Briefing, Estimate, LaserScan, Observation
from daemon.stacks.pilot._parameters import PilotParameters
from daemon.stacks.pilot.guard import Surroundings
from daemon.stacks.pilot.localisation import Localiser
from daemon.stacks.pilot.map_field import MapField
from daemon.stacks.pilot.obstacles import UnmappedObstacles
from daemon.stacks.pilot.scan_matching import project
from grammars.model.geometry import Floats, Pose2
from grammars.model.robot import Laser

_REMEMBERED = 600
"""Most remembered obstacle cells the guard looks at."""
_NEAR = 1.5
"""Remembered obstacles within this distance concern the guard [m]."""


class _LaserReturns:
    """What one laser saw last: ``points[:count]`` in the base frame of ``pose``, its scan's.

    ``known`` says of each point whether the map shows it.
    """

    def __init__(self, laser: Laser) -> None:
        angles = laser.angle_min + np.arange(laser.rays) * laser.angle_increment
        self.laser = laser
        self._cosines, self._sines = np.cos(angles), np.sin(angles)
        self._mount = np.array([laser.mount.x, laser.mount.y, laser.mount.yaw])
        self.points = np.zeros((laser.rays, 2))
        self.known = np.zeros(laser.rays, dtype=np.uint8)
        self.count = 0
        self.pose = Pose2()

    def project(self, scan: LaserScan) -> int:
        """Take a scan; return how many returns it has. Raises ``ValueError`` for other rays."""
        laser = self.laser
        if scan.ranges.shape != (laser.rays,):
            raise ValueError(f"a scan of {scan.ranges.size} rays from a laser of {laser.rays}")
        self.count = project(
            scan.ranges, self._cosines, self._sines, self._mount,
            laser.range_min, laser.range_max, self.points,
        )  # fmt: skip
        return self.count

    def seen_from(self, pose: Pose2) -> Floats:
        """Return the points (count, 2) in the base frame of another ``pose``."""
        points = self.points[: self.count]
        if pose == self.pose:
            return points
        step = pose.inverse() @ self.pose
        c, s = math.cos(step.yaw), math.sin(step.yaw)
        x, y = points[:, 0], points[:, 1]
        return np.column_stack((step.x + c * x - s * y, step.y + s * x + c * y))


class Sensing:
    """Keeps the pose, the latest scan of each laser and the obstacle layer up to date.

    All lasers see obstacles. Those at the height of the first, at which the map is drawn, also
    tell where the robot is: at another height there are other walls.
    """

    def __init__(self, briefing: Briefing, field: MapField, parameters: PilotParameters) -> None:
        robot = briefing.robot
        self._returns = {laser.name: _LaserReturns(laser) for laser in robot.lasers}
        self._map_height = robot.laser.z
        rays = [laser.rays for laser in robot.lasers]
        self._points = np.zeros((sum(rays) + _REMEMBERED, 2))
        self._known = np.zeros(sum(rays) + _REMEMBERED, dtype=np.uint8)
        self._sifted = np.zeros((max(rays), 2))
        self._localiser = Localiser(field, robot.lasers, robot.odometry, briefing.start, parameters)
        self.obstacles = UnmappedObstacles(
            field,
            explained=parameters.explained_distance,
            reach=parameters.obstacle_range,
            memory=max(1, round(parameters.obstacle_memory * sum(x.rate for x in robot.lasers))),
        )
        self.pose = briefing.start
        self.around = Surroundings(self._points, self._known, 0, 0)

    def take(self, observation: Observation) -> Estimate | None:
        """Take what is new; return a new estimate when there was a scan."""
        self._follow(observation)
        self.pose = self._localiser.pose
        return self._localiser.estimate(observation.time) if observation.scans else None

    def _follow(self, observation: Observation) -> None:
        localiser = self._localiser
        samples = list(observation.odometry)
        for scan in observation.scans:
            while samples and samples[0].time <= scan.time:
                localiser.move(samples.pop(0))
            localiser.move_until(scan.time, samples[0] if samples else None)
            returns = self._returns[scan.laser]
            count = returns.project(scan)
            if returns.laser.z == self._map_height:
                used = self.obstacles.sift(returns.points, count, localiser.pose, self._sifted)
                localiser.correct(self._sifted, used, scan.laser)
            self._look(scan, localiser.pose)
        for sample in samples:
            localiser.move(sample)
        localiser.move_until(observation.time)

    def _look(self, scan: LaserScan, pose: Pose2) -> None:
        """Take the obstacles of a scan that was projected, and what is around the base."""
        new = self._returns[scan.laser]
        new.pose = pose
        self.obstacles.update(new.laser, scan.ranges, new.points, new.known, new.count, pose)
        count = 0
        for returns in self._returns.values():
            end = count + returns.count
            self._points[count:end] = returns.seen_from(pose)
            self._known[count:end] = returns.known[: returns.count]
            count = end
        used = self.obstacles.append_nearby(pose, _NEAR, self._points, count)
        self._known[count:used] = 0
        self.around = Surroundings(self._points, self._known, count, used)
