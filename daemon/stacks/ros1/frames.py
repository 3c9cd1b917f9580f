"""Where things are in the frame of a costmap: ``map``, or ``odom``, which AMCL moves in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from daemon.stacks.ros1.move_base import TransformBuffer
from grammars.model.geometry import Pose2

_SAME: Final = Pose2()


@dataclass(frozen=True, slots=True, eq=False)
class CostmapFrame:
    """The frame a costmap is in (its ``global_frame``), whatever it is called."""

    name: Literal["map", "odom"]
    transforms: TransformBuffer

    @property
    def base(self) -> Pose2:
        """Where the base is: the stack's latest belief, in map by the delayed correction."""
        return self.transforms.base_in_map() if self.name == "map" else self.transforms.odom_to_base

    @property
    def in_map(self) -> Pose2:
        """Where the frame is in map, by the latest correction."""
        return _SAME if self.name == "map" else self.transforms.map_to_odom

    def pose_in(self, other: CostmapFrame) -> Pose2:
        """Return where this frame is in ``other``, by the latest correction."""
        if self.name == other.name:
            return _SAME
        return self.in_map if other.name == "map" else other.in_map.inverse()

    def take(self, pose: Pose2) -> Pose2:
        """Return a ``pose`` in map as one in this frame, as things are now."""
        return pose if self.name == "map" else self.in_map.inverse() @ pose
