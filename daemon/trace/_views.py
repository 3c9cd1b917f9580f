"""What a run shows but is not judged by: plans, particles and costmaps, thinned as they come.

Paths are written as CDR of any length without a Python object per pose. Coordinates are rounded
to 2^-10 m (about a millimetre): nobody sees less, and it makes paths a third as large on disk.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from daemon.model.sut import CostmapPicture
from daemon.trace import _layouts, _statics
from daemon.trace import messages as ros
from daemon.trace._layouts import HEADER, ByteArray, MessageLayout, stamps
from daemon.trace._mcap_writer import MessageBlock, MessageRecords
from grammars.model.geometry import Floats
from grammars.model.grid import OccupancyGrid


@dataclass(frozen=True, slots=True)
class _PathShape:
    """Payloads of paths with no and with one pose, and the bytes each further pose adds."""

    empty: ByteArray
    one: ByteArray
    more: ByteArray
    count: int
    first: dict[str, int]
    next: dict[str, int]


@functools.cache
def _path_shape() -> _PathShape:
    empty, one, two = (_layouts.path(count) for count in range(3))
    start = len(one.template)
    head, longer = one.template[HEADER.size :], two.template[HEADER.size : start]
    changed = np.flatnonzero(head != longer)
    assert len(changed) == 1, "paths of one and two poses must differ in their count only"
    names = ("stamp", "x", "y")
    return _PathShape(
        empty.template[HEADER.size :],
        head,
        two.template[start:],
        int(changed[0]),
        {name: _field_offset(one, f"{name}0") - HEADER.size for name in names},
        {name: _field_offset(two, f"{name}1") - start for name in names},
    )


def encode_path(now: int, points: Floats) -> bytes:
    """Return a path through ``points`` (n, 2) in map at ``now`` [ns]; all headings are 0.

    Raises ``ValueError`` for any other shape. The poses after the first all have the size and
    the alignment of the second.
    """
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"a plan must have shape (n, 2), not {points.shape}")
    shape = _path_shape()
    points = np.ascontiguousarray(points, np.float64)
    stamp = stamps(np.array([now])).view(np.uint8)
    head = (shape.one if len(points) else shape.empty).copy()
    tail = np.tile(shape.more, (max(len(points) - 1, 0), 1))
    header = _field_offset(_layouts.path(0), "stamp") - HEADER.size
    head[header : header + 8] = stamp
    if len(points):
        head[shape.count : shape.count + 4] = np.array([len(points)], "<u4").view(np.uint8)
        for rows, at, values in (
            (head[None], shape.first, points[:1]),
            (tail, shape.next, points[1:]),
        ):
            xy = np.ascontiguousarray(values).view(np.uint8)
            rows[:, at["stamp"] : at["stamp"] + 8] = stamp
            rows[:, at["x"] : at["x"] + 8] = xy[:, :8]
            rows[:, at["y"] : at["y"] + 8] = xy[:, 8:]
    return head.tobytes() + tail.tobytes()


def decode_path(payload: bytes) -> Floats:
    """Return the points (n, 2) of a path written by :func:`encode_path`.

    Raises ``ValueError`` for a payload of another size than its number of poses takes.
    """
    shape = _path_shape()
    data = np.frombuffer(payload, np.uint8)
    if len(data) == len(shape.empty):
        return np.empty((0, 2))
    more = len(data) - len(shape.one)
    if more < 0 or more % len(shape.more):
        raise ValueError("a path of another size")
    first, rest = data[None, : len(shape.one)], data[len(shape.one) :]
    return np.vstack(
        [_points(first, shape.first), _points(rest.reshape(-1, len(shape.more)), shape.next)]
    )


def _points(rows: ByteArray, at: dict[str, int]) -> Floats:
    """Return x and y (n, 2) of the poses in ``rows`` of bytes (n, size)."""
    columns = [np.ascontiguousarray(rows[:, at[axis] : at[axis] + 8]) for axis in "xy"]
    return np.column_stack([column.view("<f8").reshape(-1) for column in columns])


def _field_offset(layout: MessageLayout, name: str) -> int:
    fields = layout.record.fields
    assert fields is not None
    return int(fields[name][1])


PARTICLES: Final = "/particlecloud"
COSTMAP: Final = "/move_base/local_costmap/costmap"

PLAN_POINTS: Final = 500
"""A plan of more points is thinned to about as many; navfn puts one every 2.5 cm."""

_SECOND: Final = 1_000_000_000
_LOCAL_PLAN_PERIOD: Final = _SECOND // 5
_STEPS_PER_METRE: Final = 1024.0
_POSES_HEAD: Final = struct.Struct("<4siIi4sI")


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
    seconds, rest = divmod(now, _SECOND)
    head = _POSES_HEAD.pack(b"\0\1\0\0", seconds, rest, 4, b"map\0", len(poses))
    rows = np.zeros((len(poses), 7))
    rows[:, :2] = poses[:, :2]
    half = 0.5 * poses[:, 2]
    rows[:, 5], rows[:, 6] = np.sin(half), np.cos(half)
    # Doubles stand at multiples of eight bytes after the four of the encapsulation.
    return head + bytes(4 if len(poses) else 0) + _round_coordinates(rows).astype("<f8").tobytes()


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
    table = (1 + 97 * (costs - 1) // 251).astype(np.int16)
    table[[0, 253, 254, 255]] = 0, 99, 100, -1
    return table.astype(np.int8)
