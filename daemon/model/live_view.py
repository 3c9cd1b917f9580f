"""View of a watched run beyond its progress: laser returns, plan, contacts.

Made only while somebody watches, and small: a snapshot must fit into a pipe's buffer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from daemon.model.ids import FARTHEST_POINT, LARGEST_VALUE
from daemon.model.spec import Snapshot
from daemon.model.sut import Cloud, CostmapPicture, Estimate
from grammars.model.geometry import Floats, Point2, Pose2
from grammars.model.robot import Laser

# A pipe takes 4096 bytes at once, and a run must never wait for the reader. With coordinates of
# four or five digits these points take about 2800 bytes; the rest is for the joints.
MOST_RETURNS: Final = 90
"""Most laser returns of a snapshot."""
MOST_PLAN_POINTS: Final = 40
"""Most points of the plan."""
MOST_CONTACTS: Final = 8
MOST_BLOCKED: Final = 90
"""Most blocked cells of a costmap."""


_INSCRIBED, _LETHAL = 253, 254


@dataclass(slots=True)
class LiveView:
    """Latest scans with their places, and the contacts since the previous snapshot."""

    lasers: Sequence[Laser]
    scans: dict[str, tuple[Pose2, npt.NDArray[np.floating]]] = field(default_factory=dict)
    contacts: list[Point2] = field(default_factory=list)

    def add_scan(self, pose: Pose2, ranges: npt.NDArray[np.floating], laser: str = "") -> None:
        """Add a scan of ``laser`` at ``pose`` of the base: ``ranges`` (rays,) [m]."""
        self.scans[laser] = pose, ranges

    def extend(
        self,
        snapshot: Snapshot,
        belief: Cloud | Estimate | None,
        plan: Floats | None,
        costmap: CostmapPicture | None,
    ) -> Snapshot:
        """Return ``snapshot`` with everything visible; each contact appears once."""
        contacts, self.contacts = self.contacts[-MOST_CONTACTS:], []
        return replace(
            snapshot,
            spread=_covariance_xy(belief),
            returns=to_centimetres(self._returns()),
            plan=() if plan is None else to_centimetres(_thin_points(plan, MOST_PLAN_POINTS)),
            contacts=to_centimetres(np.array(contacts).reshape(-1, 2)),
            costmap=to_centimetres(_thin_points(_blocked(costmap), MOST_BLOCKED)),
        )

    def _returns(self) -> Floats:
        most = MOST_RETURNS // len(self.lasers)
        returns = [
            scan_returns(laser, *self.scans[laser.name], most)
            for laser in self.lasers
            if laser.name in self.scans
        ]
        return np.concatenate([np.empty((0, 2)), *returns])


def blocked_points(costmap: CostmapPicture, frame_pose: Pose2) -> Floats:
    """Return the centres (n, 2) of inscribed and lethal cells in the map [m].

    ``frame_pose`` is the pose of the costmap's frame in the map.
    """
    rows, columns = np.nonzero((costmap.cells == _INSCRIBED) | (costmap.cells == _LETHAL))
    x = costmap.x + (columns + 0.5) * costmap.resolution
    y = costmap.y + (rows + 0.5) * costmap.resolution
    cos, sin = math.cos(frame_pose.yaw), math.sin(frame_pose.yaw)
    return np.column_stack((frame_pose.x + cos * x - sin * y, frame_pose.y + sin * x + cos * y))


def _blocked(costmap: CostmapPicture | None) -> Floats:
    if costmap is None or costmap.frame_pose is None:
        return np.empty((0, 2))
    return blocked_points(costmap, costmap.frame_pose)


def scan_returns(laser: Laser, base: Pose2, ranges: npt.NDArray[np.floating], most: int) -> Floats:
    """Return the points (n, 2) of laser returns: at most ``most``, evenly thinned.

    ``base`` is the pose of the robot at the scan; the points are in its frame.
    """
    eye, step = base @ laser.mount, max(1, -(-laser.rays // most))
    thinned = np.asarray(ranges[::step], dtype=np.float64)
    valid = np.isfinite(thinned) & (thinned > 0.0)
    bearing = eye.yaw + np.linspace(laser.angle_min, laser.angle_max, laser.rays)[::step][valid]
    reach = thinned[valid]
    return np.column_stack([eye.x + reach * np.cos(bearing), eye.y + reach * np.sin(bearing)])


def _covariance_xy(belief: Cloud | Estimate | None) -> tuple[float, float, float] | None:
    if belief is None:
        return None
    covariance = belief.covariance
    values = float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])
    # Readers would refuse the whole snapshot for a value beyond the limit.
    return values if all(abs(value) <= LARGEST_VALUE for value in values) else None


def _thin_points(points: Floats, most: int) -> Floats:
    """Return at most ``most`` of points (n, k), including the first and the last."""
    if len(points) <= most:
        return points
    return points[np.linspace(0, len(points) - 1, most).round().astype(np.int64)]


def to_centimetres(points: Floats) -> tuple[int, ...]:
    """Return points (n, 2 or more) [m] as x, y, x, y, ... [cm]."""
    finite = points[np.isfinite(points).all(axis=1), :2]
    # Points of a plan beyond any map move to the limit of the message.
    clipped = np.clip(finite, -FARTHEST_POINT / 100.0, FARTHEST_POINT / 100.0)
    return tuple(np.rint(clipped * 100.0).astype(np.int64).ravel().tolist())


def from_centimetres(numbers: Sequence[int]) -> tuple[Point2, ...]:
    """Return x, y, x, y, ... [cm] as points [m]; an odd last number is ignored."""
    pairs = zip(numbers[::2], numbers[1::2], strict=False)
    return tuple((x / 100.0, y / 100.0) for x, y in pairs)
