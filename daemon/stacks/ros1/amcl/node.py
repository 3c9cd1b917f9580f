"""Updates of the filter and its publications (amcl ``AmclNode::laserReceived``)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.amcl._parameters import AmclParameters
from daemon.stacks.ros1.amcl.laser_model import make_sensor
from daemon.stacks.ros1.amcl.particle_filter import ParticleFilter, motion_between
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats, Pose2, wrap_angle
from grammars.model.grid import OccupancyGrid
from grammars.model.robot import Laser


@dataclass(frozen=True, slots=True, eq=False)
class AmclPose:
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
    """The node ``amcl`` of ROS Noetic.

    ``start`` is the initial pose. The same ``seed`` gives the same particles to the last bit.

    Each of several ``lasers`` has its own sensor model, as each frame of scans has in the original.
    Whenever the robot has moved far enough, the next scan of each laser weighs the particles once.
    Before that, the particles move by the way since the previous scan.
    """

    def __init__(
        self,
        parameters: AmclParameters,
        quirks: Quirks,
        grid: OccupancyGrid,
        lasers: Sequence[Laser],
        start: Pose2,
        seed: np.random.SeedSequence,
    ) -> None:
        self._parameters = parameters
        self._rays = {laser.name: laser.rays for laser in lasers}
        self._sensors = {
            laser.name: make_sensor(parameters, quirks, grid, laser) for laser in lasers
        }
        # The first scan of each laser counts without any motion (``lasers_update_``).
        self._due = dict.fromkeys(self._sensors, True)
        random = np.random.Generator(np.random.PCG64(seed))
        self._filter = ParticleFilter(parameters, quirks, grid, start, random)
        self._odom: Pose2 | None = None
        self._updates = 0
        self.map_to_odom = Pose2()
        """Pose of odom in map of the latest publication; identity before the first scan.

        The original broadcasts it at every scan, ``transform_tolerance`` ahead of its stamp.
        """

    @property
    def particles(self) -> Floats:
        """Particles, shape (n, 3): x, y, yaw; a view that the next scan changes."""
        return self._filter.poses

    def scan(self, time: float, ranges: Singles, odom: Pose2, laser: str = "") -> AmclPose | None:
        """Take a scan of ``laser``; ``odom`` is the pose of base_link in odom at its stamp.

        Returns the publication, if any: at the first scan the start distribution, later only when
        the particles are resampled. Raises ``ValueError`` for a wrong number of rays.
        """
        rays = self._rays[laser]
        if ranges.shape != (rays,):
            raise ValueError(
                f"the scan at {time} s has shape {ranges.shape}: the laser has {rays} rays"
            )
        first = self._odom is None
        if self._odom is not None:
            # Motion seen with a scan of one laser makes an update due for all lasers.
            if self._has_moved(self._odom, odom):
                self._due = dict.fromkeys(self._due, True)
            if not self._due[laser]:
                return None
            self._filter.move(motion_between(self._odom, odom))
        # Every update weighs the particles. Only every resample_interval-th one resamples and
        # publishes (``laserReceived``).
        self._odom = odom
        self._due[laser] = False
        self._filter.weigh(self._sensors[laser], ranges)
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

    def _publish(self, time: float, odom: Pose2) -> AmclPose:
        filtered = self._filter
        self.map_to_odom = filtered.pose @ odom.inverse()
        return AmclPose(time, filtered.pose, filtered.covariance, filtered.mean, filtered.count)
