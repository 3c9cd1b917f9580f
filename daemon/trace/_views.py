"""Messages for viewers: plans, particles and costmaps as CDR.

A plan has hundreds of poses and a costmap thousands of cells, and rosbags needs a Python object or
a copy of each. So this module makes the CDR itself, from a header and a table of rows; tests
compare it with rosbags.
"""

from __future__ import annotations

import functools
import struct
from typing import Final

import numpy as np

from daemon.model.stack_reports import published_costs
from daemon.model.sut import CostmapPicture
from daemon.trace.layouts import stamps
from grammars.model.geometry import Floats

_SECOND: Final = 1_000_000_000

_HEAD: Final = struct.Struct("<4siIi4sI")
"""Encapsulation, stamp, length and text of the frame, number of rows."""
_ENCAPSULATION: Final = b"\0\1\0\0"
_FRAME: Final = (4, b"map\0")
_STAMPED_POSE: Final = np.dtype([("stamp", "<u8"), ("frame", "V8"), ("pose", "<f8", 7)])
_FIRST: Final = 16
"""Bytes of the first pose of a path before its doubles. Doubles start at multiples of eight bytes
after the four of the encapsulation, so four bytes of padding precede them; the further rows need
none."""
_PADDING: Final = bytes(4)

PLAN_POINTS: Final = 500
"""Approximate limit of the points of a plan; navfn sets one every 2.5 cm."""

_STEPS_PER_METRE: Final = 1024.0


def encode_path(now: int, points: Floats) -> bytes:
    """Return a path through ``points`` (n, 2) in map at ``now`` [ns]; all headings are 0.

    Raises ``ValueError`` for any other shape.
    """
    _check_plan(points)
    head = _pack_head(now, len(points))
    if not len(points):
        return head
    rows = np.zeros(len(points), _STAMPED_POSE)
    rows["stamp"] = stamps(np.array([now]))
    rows["frame"] = struct.pack("<i4s", *_FRAME)
    poses = rows["pose"]
    poses[:, :2] = points
    poses[:, 6] = 1.0
    data = rows.tobytes()
    return b"".join((head, data[:_FIRST], _PADDING, data[_FIRST:]))


def decode_path(payload: bytes) -> Floats:
    """Return the points (n, 2) of a path written by :func:`encode_path`.

    Raises ``ValueError`` if the size of the payload does not fit its number of poses.
    """
    first = _HEAD.size + _FIRST
    rows = payload[_HEAD.size : first] + payload[first + len(_PADDING) :]
    if len(payload) < _HEAD.size or len(rows) % _STAMPED_POSE.itemsize:
        raise ValueError("a path of another size")
    points: Floats = np.frombuffer(rows, _STAMPED_POSE)["pose"][:, :2].copy()
    return points


def _check_plan(points: Floats) -> None:
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"a plan must have shape (n, 2), not {points.shape}")


def _pack_head(now: int, count: int) -> bytes:
    return _HEAD.pack(_ENCAPSULATION, *divmod(now, _SECOND), *_FRAME, count)


def thin_plan(points: Floats) -> Floats:
    """Return a plan with rounded points, evenly thinned but with the last one."""
    _check_plan(points)
    step = -(-len(points) // PLAN_POINTS)
    if step <= 1:
        return _round_coordinates(points)
    return _round_coordinates(np.concatenate([points[:-1:step], points[-1:]]))


def _round_coordinates(values: Floats) -> Floats:
    rounded: Floats = np.rint(np.asarray(values, np.float64) * _STEPS_PER_METRE) / _STEPS_PER_METRE
    return rounded


def encode_poses(now: int, poses: Floats) -> bytes:
    """Return a ``geometry_msgs/PoseArray`` in map at ``now`` [ns], of ``poses`` (n, 3), as CDR.

    Raises ``ValueError`` for a wrong shape and for values that are not finite.
    """
    if poses.ndim != 2 or poses.shape[1] != 3 or not np.isfinite(poses).all():
        raise ValueError(f"particles must be finite and of shape (n, 3), not {poses.shape}")
    rows = np.zeros((len(poses), 7))
    rows[:, :2] = poses[:, :2]
    half = 0.5 * poses[:, 2]
    rows[:, 5], rows[:, 6] = np.sin(half), np.cos(half)
    padding = _PADDING if len(poses) else b""
    return _pack_head(now, len(poses)) + padding + _round_coordinates(rows).tobytes()


def encode_costmap(now: int, picture: CostmapPicture) -> bytes:
    """Return a ``nav_msgs/OccupancyGrid`` of costmap_2d at ``now`` [ns] as CDR.

    Its cells are 0 free, 1 to 98, 99 inscribed, 100 lethal, -1 unknown. Source: the cost
    translation table of ``costmap_2d::Costmap2DPublisher``. Raises ``ValueError`` for cells of
    a wrong shape or type.
    """
    cells = picture.cells
    if cells.ndim != 2 or cells.dtype != np.uint8:
        raise ValueError(f"a costmap must be uint8 of two dimensions, not {cells.dtype}")
    rows, columns = cells.shape
    stamp = divmod(now, _SECOND)
    frame = picture.frame.encode() + b"\0"
    head = _grid_head(len(frame)).pack(
        _ENCAPSULATION, *stamp, len(frame), frame, *stamp, picture.resolution, columns, rows,
        picture.x, picture.y, 0.0, 0.0, 0.0, 0.0, 1.0, cells.size,
    )  # fmt: skip
    return head + published_costs()[cells].tobytes()


@functools.cache
def _grid_head(frame: int) -> struct.Struct:
    """Return the head of an ``OccupancyGrid``; ``frame`` is the length of its text with the 0.

    The fields are encapsulation, stamp, frame, load time, resolution, width, height, origin and
    number of cells.
    """
    text = f"{frame}s{-frame % 4}x"
    # After the encapsulation, two times, three numbers and two lengths of four bytes precede the
    # doubles of the origin, which start at multiples of eight.
    offset = struct.calcsize(f"<iIi{text}iIfII")
    return struct.Struct(f"<4siIi{text}iIfII{-offset % 8}x7dI")
