"""Transforms of the stack, and the frames of costmaps.

The transforms are map <- odom of AMCL and odom <- base_link of the wheels.

AMCL stamps its correction ``transform_tolerance`` ahead of its scan. A look-up at the stamp of an
odometry sample or of a scan therefore finds a correction that is older by this time, interpolated
between two broadcasts. Only a look-up of the latest correction, as DWA does for goal and plan, sees
AMCL's newest result (amcl_node, tf2 ``lookupTransform``).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Final, Literal

from daemon.model.sut import Odometry
from grammars.model.geometry import Pose2, Twist2, wrap_angle

_SAME: Final = Pose2()
_KEPT_SECONDS: Final = 2.0
"""Oldest look-up before the newest entry [s]."""
_KEPT_ENTRIES: Final = 200
"""Number of entries beyond which old ones are removed."""


class TransformBuffer:
    """Poses of odom in map and of the base in odom, over time.

    ``start`` is the initial pose in map: until AMCL's first broadcast, the first odometry sample
    lies there. AMCL stamps ``tolerance`` [s] ahead. Without ``delayed`` corrections hold at once.
    """

    def __init__(self, start: Pose2, tolerance: float, *, delayed: bool) -> None:
        self._start = start
        self._ahead = tolerance if delayed else -math.inf
        self._stamps: list[float] = []
        self._samples: list[Odometry] = []
        self._due: list[float] = []
        self._corrections: list[Pose2] = []
        self.map_to_odom = start
        """The latest pose of odom in map, whatever its stamp."""
        self.odom_to_base = Pose2()
        """The latest pose of base_link in odom."""
        self.twist = Twist2()
        """The latest odometry twist."""
        self._base: Pose2 | None = None
        self._latest_look_up = (math.nan, self.odom_to_base)
        """Time and pose of the latest look-up of the base between two odometry samples."""
        self.time = -1.0
        """Stamp of the latest odometry sample [s]; negative before the first."""

    def move(self, sample: Odometry) -> None:
        """Take an odometry sample; samples come in order."""
        if self.time < 0.0:
            self.map_to_odom = self._start @ sample.pose.inverse()
        self._stamps.append(sample.time)
        self._samples.append(sample)
        self.odom_to_base, self.twist, self.time = sample.pose, sample.twist, sample.time
        self._base = None
        if len(self._stamps) > _KEPT_ENTRIES:
            old = max(bisect_right(self._stamps, sample.time - _KEPT_SECONDS) - 1, 0)
            del self._stamps[:old], self._samples[:old]

    def correct(self, stamp: float, map_to_odom: Pose2) -> None:
        """Take AMCL's broadcast for a scan at ``stamp`` [s]; broadcasts come in order."""
        stamps, corrections = self._due, self._corrections
        if not stamps:
            stamps.append(-math.inf)
            corrections.append(self.map_to_odom)
        self.map_to_odom, self._base = map_to_odom, None
        stamps.append(stamp + self._ahead)
        corrections.append(map_to_odom)
        if len(stamps) > _KEPT_ENTRIES:
            old = bisect_right(stamps, stamp - _KEPT_SECONDS) - 1
            del stamps[: max(old, 0)], corrections[: max(old, 0)]

    def correction_at(self, time: float) -> Pose2:
        """Return the pose of odom in map at ``time`` [s].

        This is the initial pose before the first broadcast takes effect, the last one after the
        last broadcast.
        """
        if not self._corrections:
            return self.map_to_odom
        k = bisect_right(self._due, time)
        first = self._corrections[k - 1]
        second = self._corrections[min(k, len(self._corrections) - 1)]
        if first is second or self._due[k - 1] == -math.inf:
            return first
        before = self._due[k - 1]
        return _interpolate_pose(first, second, (time - before) / (self._due[k] - before))

    def base_at(self, time: float) -> Pose2:
        """Return the pose of base_link in odom at ``time`` [s], clamped to the known samples."""
        stamps, samples = self._stamps, self._samples
        if time >= self.time:
            return self.odom_to_base
        k = bisect_right(stamps, time)
        if k == 0:
            return samples[0].pose
        # AMCL and the costmaps look up the same scans one after the other.
        if time != self._latest_look_up[0]:
            share = (time - stamps[k - 1]) / (stamps[k] - stamps[k - 1])
            first, second = samples[k - 1].pose, samples[k].pose
            pose = first if share == 0.0 else _interpolate_pose(first, second, share)
            self._latest_look_up = (time, pose)
        return self._latest_look_up[1]

    def base_in_map(self) -> Pose2:
        """Return the stack's estimate of the base in map at the stamp of the newest odometry."""
        if self._base is None:
            self._base = self.correction_at(self.time) @ self.odom_to_base
        return self._base


def _interpolate_pose(first: Pose2, second: Pose2, share: float) -> Pose2:
    """Interpolate position and heading linearly, as tf2 does."""
    turn = wrap_angle(second.yaw - first.yaw)
    return Pose2(
        first.x + share * (second.x - first.x),
        first.y + share * (second.y - first.y),
        wrap_angle(first.yaw + share * turn),
    )


@dataclass(frozen=True, slots=True, eq=False)
class CostmapFrame:
    """The frame a costmap is in (its ``global_frame``), whatever it is called."""

    name: Literal["map", "odom"]
    transforms: TransformBuffer

    @property
    def base(self) -> Pose2:
        """Latest estimate of the base's pose; in map by the delayed correction."""
        return self.transforms.base_in_map() if self.name == "map" else self.transforms.odom_to_base

    @property
    def in_map(self) -> Pose2:
        """Pose of the frame in map, by the latest correction."""
        return _SAME if self.name == "map" else self.transforms.map_to_odom

    def pose_in(self, other: CostmapFrame) -> Pose2:
        """Return the pose of this frame in ``other``, by the latest correction."""
        if self.name == other.name:
            return _SAME
        return self.in_map if other.name == "map" else other.in_map.inverse()

    def take(self, pose: Pose2) -> Pose2:
        """Transform a ``pose`` from map into this frame by the latest correction."""
        return pose if self.name == "map" else self.in_map.inverse() @ pose
