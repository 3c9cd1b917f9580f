"""Scans for the costmaps by laser, and the costmaps that observe them.

When a scan reaches a costmap, it is placed where its laser was at the stamp, in the frame of that
costmap (costmap_2d ``ObservationBuffer``). A later correction of AMCL does not move it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from daemon.model.sut import LaserScan
from daemon.stacks.ros1.costmap import SensedScan
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.timers import TIME_TOLERANCE
from daemon.stacks.ros1.transforms import CostmapFrame, TransformBuffer
from grammars.model.geometry import Floats, Pose2
from grammars.model.robot import Laser

_SCAN_TOLERANCE: Final = 0.05
"""Costmaps take a scan only when transforms reach this far beyond its stamp [s]
(costmap_2d ``ObstacleLayer``: the tolerance of its message filter)."""
_MOST_WAITING: Final = 50
"""Most scans of one laser that wait for transforms, as in costmap_2d; the oldest are dropped."""


@dataclass(slots=True)
class _ReceivedScan:
    """A scan the costmaps have: ``base`` in odom at its stamp, time ``received`` [s].

    ``correction`` is the pose of odom in map for it, unknown while it is its laser's newest scan.
    """

    scan: LaserScan
    base: Pose2
    received: float
    correction: Pose2 | None = None


class _LaserBuffer:
    """Scans of one laser: those that wait, and those the costmaps have."""

    def __init__(self, laser: Laser) -> None:
        steps = np.arange(laser.rays, dtype=np.float64)
        self.laser = laser
        # A scan gives its angles in single precision (sensor_msgs/LaserScan); laser_geometry
        # computes each ray from them in double precision.
        begin, by = (float(np.float32(a)) for a in (laser.angle_min, laser.angle_increment))
        self.angles: Floats = begin + steps * by
        self.waiting: deque[LaserScan] = deque(maxlen=_MOST_WAITING)
        self.received: deque[_ReceivedScan] = deque()


class ScanBuffer:
    """Buffer of the newest scan of each laser, and of earlier scans of the last ``keep`` seconds.

    ``keep`` is the longest ``observation_persistence`` of any source. Each source takes as many
    scans as its own persistence allows.
    """

    def __init__(
        self, lasers: Sequence[Laser], transforms: TransformBuffer, *, keep: float = 0.0
    ) -> None:
        self._transforms, self._keep = transforms, keep
        self._buffers = {laser.name: _LaserBuffer(laser) for laser in lasers}

    def queue(self, scan: LaserScan) -> None:
        """Queue a scan until the transforms at its stamp are known."""
        self._buffers[scan.laser].waiting.append(scan)

    def release_known(self, now: float) -> None:
        """Release the scans whose transforms are known at ``now`` [s] to the costmaps."""
        horizon = self._transforms.time - _SCAN_TOLERANCE + TIME_TOLERANCE
        for buffer in self._buffers.values():
            while buffer.waiting and buffer.waiting[0].time <= horizon:
                self._receive(buffer, buffer.waiting.popleft(), now)

    def _receive(self, buffer: _LaserBuffer, scan: LaserScan, now: float) -> None:
        received = buffer.received
        if received and self._keep > 0.0:
            # From here on its place in the map is fixed (see the module's docstring).
            newest = received[-1]
            newest.correction = self._transforms.correction_at(newest.scan.time)
        received.append(_ReceivedScan(scan, self._transforms.base_at(scan.time), now))
        while len(received) > 1 and self._is_stale(received[0], now):
            received.popleft()

    def _is_stale(self, old: _ReceivedScan, now: float) -> bool:
        return self._keep <= 0.0 or now - old.scan.time > self._keep + TIME_TOLERANCE

    def scans(self, frame: Literal["map", "odom"]) -> list[SensedScan]:
        """Return the scans, oldest first, with the poses of the lasers in ``frame``.

        In map, the delayed correction places the newest scan of a laser.
        """
        pairs = [
            (buffer, received) for buffer in self._buffers.values() for received in buffer.received
        ]
        # The sort is stable: scans of one instant keep the order of the lasers.
        pairs.sort(key=lambda pair: pair[1].scan.time)
        return [_sensed(*pair, self._base(pair[1], frame)) for pair in pairs]

    def _base(self, received: _ReceivedScan, frame: Literal["map", "odom"]) -> Pose2:
        if frame == "odom":
            return received.base
        correction = received.correction or self._transforms.correction_at(received.scan.time)
        return correction @ received.base


def _sensed(buffer: _LaserBuffer, received: _ReceivedScan, base: Pose2) -> SensedScan:
    laser, scan = buffer.laser, received.scan
    return SensedScan(
        base @ laser.mount,
        scan.ranges,
        buffer.angles,
        laser.range_min,
        laser.range_max,
        laser.z,
        laser.name,
        scan.time,
        received.received,
    )


class ObservedCostmap:
    """A costmap in its frame, with the names of the ``lasers`` that it observes."""

    def __init__(
        self, costmap: Costmap, frame: CostmapFrame, scans: ScanBuffer, lasers: Collection[str]
    ) -> None:
        self.costmap, self.frame = costmap, frame
        self._scans, self._lasers = scans, lasers

    def update(self) -> None:
        """Run one update cycle with the present pose of the robot and the present scans."""
        frame = self.frame
        scans = [one for one in self._scans.scans(frame.name) if one.laser in self._lasers]
        self.costmap.update(frame.base, scans, frame.in_map)
