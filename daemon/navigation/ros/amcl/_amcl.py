"""When the filter updates, and what it publishes (amcl ``AmclNode::laserReceived``)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from daemon.navigation.kernels import Singles
from daemon.navigation.ros.amcl._filter import ParticleFilter
from daemon.navigation.ros.amcl._motion import motion_between
from daemon.navigation.ros.amcl._parameters import AmclParameters
from daemon.navigation.ros.amcl._sensor import Sensor
from daemon.navigation.ros.quirks import Quirks
from grammars.grid import OccupancyGrid
from grammars.robot import Laser
from grammars.values import Floats, Pose2, wrap_angle


@dataclass(frozen=True, slots=True, eq=False)
class Localisation:
    """A published estimate: ``pose`` of base_link in map, the mean of the heaviest cluster.

    ``covariance`` (3, 3) over x, y, yaw [m, m, rad] and ``mean`` are those of all ``count``
    particles.
    """

    time: float
    pose: Pose2
    covariance: Floats
    mean: Pose2
    count: int


class Amcl:
    """Adaptive Monte Carlo localisation as the ROS package ``amcl`` of Noetic does it.

    ``start`` is the initial pose. The same ``seed`` gives the same particles to the last bit.
    """

    def __init__(
        self,
        parameters: AmclParameters,
        quirks: Quirks,
        grid: OccupancyGrid,
        laser: Laser,
        start: Pose2,
        seed: np.random.SeedSequence,
    ) -> None:
        self._parameters, self._rays = parameters, laser.rays
        self._sensor = Sensor(parameters, quirks, grid, laser)
        random = np.random.Generator(np.random.PCG64(seed))
        self._filter = ParticleFilter(parameters, quirks, grid, start, random)
        self._odom: Pose2 | None = None
        self._updates = 0
        self._map_to_odom = Pose2()

    @property
    def map_to_odom(self) -> Pose2:
        """The pose of odom in map, as of the latest publication; identity before the first scan.

        The original broadcasts it at every scan, ``transform_tolerance`` ahead of its stamp, from
        the first scan on.
        """
        return self._map_to_odom

    @property
    def particles(self) -> Floats:
        """The particles, shape (n, 3): x, y, yaw; a view that the next scan changes."""
        return self._filter.poses

    @property
    def weights(self) -> Floats:
        """Their weights, shape (n,); a view that the next scan changes."""
        return self._filter.weights

    def scan(self, time: float, ranges: Singles, odom: Pose2) -> Localisation | None:
        """Take a scan taken at ``odom``, the pose of base_link in odom at its stamp.

        Returns what is published: at the first scan the start distribution, later only when
        the particles are resampled. Raises ``ValueError`` when ``ranges`` has not as many rays
        as the laser.
        """
        if ranges.shape != (self._rays,):
            raise ValueError(
                f"the scan at {time} s has shape {ranges.shape}: the laser has {self._rays} rays"
            )
        first = self._odom is None
        if self._odom is not None:
            if not self._has_moved(self._odom, odom):
                return None
            self._filter.move(motion_between(self._odom, odom))
        self._odom = odom
        self._filter.weigh(self._sensor, ranges)
        self._updates += 1
        resampled = self._updates % self._parameters.resample_interval == 0
        if resampled:
            self._filter.resample()
        return self._publish(time, odom) if first or resampled else None

    def _has_moved(self, before: Pose2, after: Pose2) -> bool:
        """Tell whether odometry moved enough: along x or y of the odom frame, or in heading."""
        p = self._parameters
        return (
            abs(after.x - before.x) > p.update_min_d
            or abs(after.y - before.y) > p.update_min_d
            or abs(wrap_angle(after.yaw - before.yaw)) > p.update_min_a
        )

    def _publish(self, time: float, odom: Pose2) -> Localisation | None:
        summary = self._filter.summary
        if summary is None:
            return None
        self._map_to_odom = summary.pose @ odom.inverse()
        return Localisation(
            time, summary.pose, summary.covariance, summary.mean, self._filter.count
        )
