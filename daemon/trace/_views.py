"""What a run shows but is not judged by: plans, particles and costmaps, thinned as they come.

Coordinates are rounded to 2^-10 m (about a millimetre): nobody sees less, and it makes paths a
third as large on disk.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from daemon.model.sut import CostmapPicture
from daemon.trace import _statics
from daemon.trace import messages as ros
from daemon.trace._layouts import stamps
from daemon.trace._mcap_writer import MessageBlock, MessageRecords
from grammars.model.geometry import Floats
from grammars.model.grid import OccupancyGrid

_SECOND: Final = 1_000_000_000

# A plan has hundreds of poses, of each of which rosbags wants a Python object. So the CDR of paths
# and particles is written out here, a header and a table of rows; tests hold it to rosbags.
_HEAD: Final = struct.Struct("<4siIi4sI")
"""Encapsulation, stamp, length and text of the frame, number of rows."""
_ENCAPSULATION: Final = b"\0\1\0\0"
_FRAME: Final = (4, b"map\0")
_STAMPED_POSE: Final = np.dtype([("stamp", "<u8"), ("frame", "V8"), ("pose", "<f8", 7)])
_ALIGNED: Final = _HEAD.size + 16
"""Where the first pose of a path stands: doubles lie at multiples of eight bytes after the four of
the encapsulation, so four of padding precede it. All further rows are aligned by then."""


def encode_path(now: int, points: Floats) -> bytes:
    """Return a path through ``points`` (n, 2) in map at ``now`` [ns]; all headings are 0.

    Raises ``ValueError`` for any other shape.
    """
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"a plan must have shape (n, 2), not {points.shape}")
    rows = np.zeros(len(points), _STAMPED_POSE)
    rows["stamp"] = stamps(np.array([now]))
    rows["frame"] = struct.pack("<i4s", *_FRAME)
    rows["pose"][:, :2] = points
    rows["pose"][:, 6] = 1.0
    message = _pack_head(now, len(points)) + rows.tobytes()
    return message[:_ALIGNED] + bytes(4 if len(points) else 0) + message[_ALIGNED:]


def decode_path(payload: bytes) -> Floats:
    """Return the points (n, 2) of a path written by :func:`encode_path`.

    Raises ``ValueError`` for a payload of another size than its number of poses takes.
    """
    rows = payload[_HEAD.size : _ALIGNED] + payload[_ALIGNED + 4 :]
    if len(payload) < _HEAD.size or len(rows) % _STAMPED_POSE.itemsize:
        raise ValueError("a path of another size")
    points: Floats = np.frombuffer(rows, _STAMPED_POSE)["pose"][:, :2].copy()
    return points


def _pack_head(now: int, count: int) -> bytes:
    return _HEAD.pack(_ENCAPSULATION, *divmod(now, _SECOND), *_FRAME, count)


PARTICLES: Final = "/particlecloud"
COSTMAP: Final = "/move_base/local_costmap/costmap"

PLAN_POINTS: Final = 500
"""A plan of more points is thinned to about as many; navfn puts one every 2.5 cm."""

_LOCAL_PLAN_PERIOD: Final = _SECOND // 5
_STEPS_PER_METRE: Final = 1024.0


class ViewerMessages:
    """Collects messages for viewers; times are simulated ones [ns]."""

    def __init__(self, ids: Mapping[str, int]) -> None:
        self._plan, self._local_plan, self._particles, self._costmap = (
            MessageRecords(ids[topic]) for topic in ("/plan", "/local_plan", PARTICLES, COSTMAP)
        )
        self._due = dict.fromkeys(("plan", "local plan", "particles", "costmap"), 0)
        self._last = b""
        self._waiting: tuple[int, Floats] | None = None

    def plan(self, now: int, points: Floats) -> None:
        """Take a global plan (n, 2); an unchanged one is left out.

        Of plans that change more than once a second the latest is kept until it is time. Raises
        ``ValueError`` for another shape.
        """
        thin = _thin_plan(points)
        raw = thin.tobytes()
        if raw == self._last:
            return
        self._last, self._waiting = raw, (now, thin)
        self.flush(now)

    def flush(self, now: int, *, end: bool = False) -> None:
        """Write the plan that waits for its time, if that has come or the recording ends."""
        if self._waiting is not None and (end or now >= self._due["plan"]):
            self._plan.add(self._waiting[0], encode_path(*self._waiting))
            self._waiting, self._due["plan"] = None, now + _SECOND

    def local_plan(self, now: int, points: Floats) -> None:
        """Take a local plan (n, 2); more than five a second are left out."""
        if self._take("local plan", now, _LOCAL_PLAN_PERIOD):
            self._local_plan.add(now, encode_path(now, points))

    def particles(self, now: int, poses: Floats) -> None:
        """Take particles (n, 3); more than one cloud a second is left out."""
        if self._take("particles", now, _SECOND):
            self._particles.add(now, encode_poses(now, poses))

    def costmap(self, now: int, picture: CostmapPicture) -> None:
        """Take a costmap; more than one a second is left out."""
        if self._take("costmap", now, _SECOND):
            grid = _statics.occupancy_grid(_published_costmap(picture), now, picture.frame)
            self._costmap.add(now, ros.serialize(grid, ros.KINDS[COSTMAP]))

    def _take(self, what: str, now: int, period: int) -> bool:
        due = now >= self._due[what]
        if due:
            self._due[what] = now + period
        return due

    def drain(self) -> list[MessageBlock]:
        """Return what was collected and start anew."""
        kept = (self._plan, self._local_plan, self._particles, self._costmap)
        return [records.drain() for records in kept]


def _thin_plan(points: Floats) -> Floats:
    """Round a plan and leave points out evenly, but never the last one."""
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"a plan must have shape (n, 2), not {points.shape}")
    step = -(-len(points) // PLAN_POINTS)
    if step <= 1:
        return _round_coordinates(points)
    return _round_coordinates(np.concatenate([points[:-1:step], points[-1:]]))


def _round_coordinates(values: Floats) -> Floats:
    rounded: Floats = np.rint(np.asarray(values, np.float64) * _STEPS_PER_METRE) / _STEPS_PER_METRE
    return rounded


def encode_poses(now: int, poses: Floats) -> bytes:
    """Return a ``geometry_msgs/PoseArray`` in map at ``now`` [ns], of ``poses`` (n, 3), as CDR.

    Raises ``ValueError`` for another shape and for what is not finite.
    """
    if poses.ndim != 2 or poses.shape[1] != 3 or not np.isfinite(poses).all():
        raise ValueError(f"particles must be finite and of shape (n, 3), not {poses.shape}")
    rows = np.zeros((len(poses), 7))
    rows[:, :2] = poses[:, :2]
    half = 0.5 * poses[:, 2]
    rows[:, 5], rows[:, 6] = np.sin(half), np.cos(half)
    padding = bytes(4 if len(poses) else 0)
    return _pack_head(now, len(poses)) + padding + _round_coordinates(rows).tobytes()


def _published_costmap(picture: CostmapPicture) -> OccupancyGrid:
    """Return a costmap as costmap_2d publishes it: 0 free, 1 to 98, 99 inscribed, 100 lethal, -1.

    Source: the cost translation table of ``costmap_2d::Costmap2DPublisher``.
    """
    cells = picture.cells
    if cells.ndim != 2 or cells.dtype != np.uint8:
        raise ValueError(f"a costmap must be uint8 of two dimensions, not {cells.dtype}")
    return OccupancyGrid(picture.resolution, picture.x, picture.y, _cost_translation()[cells])


def _cost_translation() -> npt.NDArray[np.int8]:
    costs = np.arange(256)
    # Its loop in integer arithmetic: 1 + (97 * (cost - 1)) / 251 for costs of 1 to 252.
    table = (1 + 97 * (costs - 1) // 251).astype(np.int16)
    table[[0, 253, 254, 255]] = 0, 99, 100, -1
    return table.astype(np.int8)
