"""``nav_msgs/Path`` in CDR: of any length, without a Python object per pose."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from daemon.trace import layouts
from daemon.trace.layout import HEADER, Bytes, Layout, stamps
from grammars.values import Floats


@dataclass(frozen=True, slots=True)
class _Shape:
    """Payloads of paths with no and with one pose, and the bytes each further pose adds."""

    empty: Bytes
    one: Bytes
    more: Bytes
    count: int
    first: dict[str, int]
    next: dict[str, int]


@functools.cache
def _shape() -> _Shape:
    empty, one, two = (layouts.path(count) for count in range(3))
    start = len(one.template)
    head, longer = one.template[HEADER.size :], two.template[HEADER.size : start]
    changed = np.flatnonzero(head != longer)
    assert len(changed) == 1, "paths of one and two poses must differ in their count only"
    names = ("stamp", "x", "y")
    return _Shape(
        empty.template[HEADER.size :],
        head,
        two.template[start:],
        int(changed[0]),
        {name: _place(one, f"{name}0") - HEADER.size for name in names},
        {name: _place(two, f"{name}1") - start for name in names},
    )


def encode_path(now: int, points: Floats) -> bytes:
    """Return a path through ``points`` (n, 2) in map at ``now`` [ns]; all headings are 0.

    Raises ``ValueError`` for any other shape. The poses after the first all have the size and
    the alignment of the second.
    """
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"a plan must have shape (n, 2), not {points.shape}")
    shape = _shape()
    points = np.ascontiguousarray(points, np.float64)
    stamp = stamps(np.array([now])).view(np.uint8)
    head = (shape.one if len(points) else shape.empty).copy()
    tail = np.tile(shape.more, (max(len(points) - 1, 0), 1))
    header = _place(layouts.path(0), "stamp") - HEADER.size
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
    shape = _shape()
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


def _points(rows: Bytes, at: dict[str, int]) -> Floats:
    """Return x and y (n, 2) of the poses in ``rows`` of bytes (n, size)."""
    columns = [np.ascontiguousarray(rows[:, at[axis] : at[axis] + 8]) for axis in "xy"]
    return np.column_stack([column.view("<f8").reshape(-1) for column in columns])


def _place(layout: Layout, name: str) -> int:
    fields = layout.record.fields
    assert fields is not None
    return int(fields[name][1])
