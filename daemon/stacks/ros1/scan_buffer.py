"""The scans that the costmaps have got, laser by laser, and the costmaps that observe them.

A costmap puts a scan where its laser was at the stamp, in the frame of that costmap, when the scan
reaches it (costmap_2d ``ObservationBuffer``): what AMCL finds afterwards moves no scan that is kept
for longer.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

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
"""Scans of one laser that wait for transforms, as in costmap_2d; the oldest are dropped."""


@dataclass(slots=True)
class _ReceivedScan:
    """A scan the costmaps have got: ``base`` in odom at its stamp, ``received`` when [s].

    ``correction`` is where odom was in map for it, unknown as long as it is its laser's newest.
    """

    scan: LaserScan
    base: Pose2
    received: float
    correction: Pose2 | None = None


class _LaserBuffer:
    """What the costmaps have got of one laser."""

    def __init__(self, laser: Laser) -> None:
        steps = np.arange(laser.rays, dtype=np.float64)
        self.laser = laser
        # A scan says where its rays point in single precision (sensor_msgs/LaserScan), and they
        # are worked out from that in double (laser_geometry).
        begin, by = (float(np.float32(a)) for a in (laser.angle_min, laser.angle_increment))
        self.angles: Floats = begin + steps * by
        self.waiting: deque[LaserScan] = deque(maxlen=_MOST_WAITING)
        self.received: deque[_ReceivedScan] = deque()


class ScanBuffer:
    """Keeps the newest scan of each laser, and those before it of the last ``keep`` seconds.

    ``keep`` is the longest ``observation_persistence`` of any source: each takes of them what its
    own allows.
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
        """Let the costmaps have, at ``now`` [s], the scans whose transforms are known by then."""
        known = self._transforms.time - _SCAN_TOLERANCE + TIME_TOLERANCE
        for buffer in self._buffers.values():
            while buffer.waiting and buffer.waiting[0].time <= known:
                self._receive(buffer, buffer.waiting.popleft(), now)

    def _receive(self, buffer: _LaserBuffer, scan: LaserScan, now: float) -> None:
        received = buffer.received
        if received and self._keep > 0.0:
            # From here on its place in the map is settled; see the module.
            newest = received[-1]
            newest.correction = self._transforms.correction_at(newest.scan.time)
        received.append(_ReceivedScan(scan, self._transforms.base_at(scan.time), now))
        while len(received) > 1 and self._is_stale(received[0], now):
            received.popleft()

    def _is_stale(self, old: _ReceivedScan, now: float) -> bool:
        return self._keep <= 0.0 or now - old.scan.time > self._keep + TIME_TOLERANCE

    def in_odom(self) -> list[SensedScan]:
        """Return the scans, oldest first, from where the lasers were in odom."""
        return [
            _sensed(buffer, received, received.base) for buffer, received in self._oldest_first()
        ]

    def in_map(self) -> list[SensedScan]:
        """Return the scans, oldest first, from where the lasers were in map.

        The newest of a laser lies there by the delayed correction.
        """
        return [
            _sensed(buffer, received, self._correction(received) @ received.base)
            for buffer, received in self._oldest_first()
        ]

    def _correction(self, received: _ReceivedScan) -> Pose2:
        if received.correction is not None:
            return received.correction
        return self._transforms.correction_at(received.scan.time)

    def _oldest_first(self) -> Iterator[tuple[_LaserBuffer, _ReceivedScan]]:
        pairs = [
            (buffer, received) for buffer in self._buffers.values() for received in buffer.received
        ]
        # Stable: scans of one instant are in the order of the lasers.
        yield from sorted(pairs, key=lambda pair: pair[1].scan.time)


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
    """A costmap in its frame, which observes the scans of the lasers it has ``heard``."""

    def __init__(
        self, costmap: Costmap, frame: CostmapFrame, scans: ScanBuffer, heard: Collection[str]
    ) -> None:
        self.costmap, self.frame = costmap, frame
        self._scans, self._heard = scans, heard

    def update(self) -> None:
        """Run one update cycle with the robot and the scans where they are now."""
        frame, buffer = self.frame, self._scans
        scans = buffer.in_map() if frame.name == "map" else buffer.in_odom()
        heard = [scan for scan in scans if scan.laser in self._heard]
        self.costmap.update(frame.base, heard, frame.in_map)
