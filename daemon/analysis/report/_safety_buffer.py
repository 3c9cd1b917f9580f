"""The safety buffer: its box, from the campaign's oracles, and the laser returns inside it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.judging.oracles import footprint_box, written_oracle
from daemon.model.spec import OracleText
from grammars.model.geometry import Point2, Ring
from grammars.oracle import Signal
from grammars.text.expressions import Comparison, Expression, Number, walk

if TYPE_CHECKING:
    from daemon.trace import Trace

DEFAULT_MARGIN: Final = 0.2
"""Default distance [m] to obstacles, if no oracle names one: the paper's (section 4.3.1)."""
_POINTS: Final = 4000
"""Most points of one run: about as many as the histogram has cells, 64 by 64."""

ThinnedSamples: TypeAlias = npt.NDArray[np.float32]
"""Samples for drawing; measures are computed from all samples before."""


@dataclass(frozen=True, slots=True)
class SafetyBuffer:
    """The safety buffer of a report: a box in the base frame, half extents [m].

    Without ``half`` it is the box around the footprint with ``margin`` [m] more on every side.
    ``source`` names its origin in words.
    """

    half: Point2 | None
    margin: float
    source: str

    @property
    def size(self) -> str:
        """The size in words: ``1.1 m × 0.866 m`` or ``0.2 m``."""
        if self.half is None:
            return f"{self.margin:g} m"
        return f"{2 * self.half[0]:g} m × {2 * self.half[1]:g} m"

    @property
    def predicate(self) -> str:
        """The predicate of the oracle language that holds while an obstacle is inside."""
        if self.half is None:
            return f"clearance < {self.margin!r} m"
        return f"clearance({self.half[0]!r} m, {self.half[1]!r} m) < 0 m"

    def box(self, footprint: Ring) -> tuple[Point2, Point2]:
        """Return centre and half extents [m] around a robot with ``footprint``, base frame."""
        if self.half is not None:
            return (0.0, 0.0), self.half
        centre, (hx, hy) = footprint_box(footprint)
        return centre, (hx + self.margin, hy + self.margin)


def safety_buffer(texts: Iterable[str], footprints: Iterable[Ring] = ()) -> SafetyBuffer:
    """Return the largest box ``clearance(hx, hy)`` in oracles.

    Without one, use the largest limit of a plain ``clearance``, otherwise the paper's 0.2 m. A
    buffer is room around the robot, so a box must reach beyond one of the ``footprints`` on every
    side; otherwise it is a collision box (that of section 4.2.3 is narrower than the robot).
    """
    boxes: dict[Point2, str] = {}
    limits: dict[float, str] = {}
    for text in sorted(set(texts)):
        for part, _ in _judged_parts(text):
            match part:
                case Signal(name="clearance", arguments=(Number() as hx, Number() as hy)):
                    boxes.setdefault((hx.value, hy.value), text)
                case Comparison(left=Signal(name="clearance", arguments=()), right=Number() as n):
                    limits.setdefault(n.value, text)
    rings = tuple(footprints)
    boxes = {half: text for half, text in boxes.items() if not rings or _is_around(half, rings)}
    if boxes:
        half = max(boxes, key=lambda box: box[0] * box[1])
        size = f"{2 * half[0]:g} m × {2 * half[1]:g} m"
        return SafetyBuffer(half, 0.0, f"the box of {size} around the robot in “{boxes[half]}”")
    positive = [limit for limit in limits if limit > 0.0]
    if positive:
        return SafetyBuffer(
            None, max(positive), f"{max(positive):g} m as in “{limits[max(positive)]}”"
        )
    source = f"{DEFAULT_MARGIN:g} m around the robot, since no oracle names a clearance"
    return SafetyBuffer(None, DEFAULT_MARGIN, source)


def _is_around(half: Point2, footprints: Iterable[Ring]) -> bool:
    """Return whether a box leaves room on every side of one of the footprints."""
    return any(
        all(abs(x) < half[0] and abs(y) < half[1] for x, y in footprint) for footprint in footprints
    )


def _judged_parts(text: str) -> Iterator[tuple[Expression, bool | None]]:
    """Yield each judged part of an oracle, and whether it must hold at each sample."""
    oracle = written_oracle(OracleText("report", text))
    for judged, holds in () if oracle is None else oracle.judged():
        yield from ((part, holds) for part in walk(judged))


def returns_inside(trace: Trace, centre: Point2, half: Point2) -> ThinnedSamples:
    """Return laser returns (k, 2) [m, base frame] inside the box, of every laser of the robot.

    Empty if the trace was read without its scans.
    """
    parts = [np.empty((0, 2))]
    for laser, scans in zip(trace.spec.robot.lasers, trace.scans or (), strict=False):
        mount = laser.mount
        # Lost rays and those without a return are NaN or infinite.
        far = np.hypot(*half) + np.hypot(*centre) + np.hypot(mount.x, mount.y)
        ranges = scans.ranges.ravel()
        # The float32, rounded up, keeps the ranges from becoming float64.
        near = np.flatnonzero((ranges > 0.0) & (ranges <= np.float32(far * 1.001)))
        rays, ranges = near % laser.rays, ranges[near].astype(np.float64)
        bearing = mount.yaw + laser.angle_min + laser.angle_increment * np.arange(laser.rays)
        x = mount.x + ranges * np.cos(bearing)[rays] - centre[0]
        y = mount.y + ranges * np.sin(bearing)[rays] - centre[1]
        within = (np.abs(x) < half[0]) & (np.abs(y) < half[1])
        parts.append(np.column_stack((x, y))[within] + centre)
    inside = np.concatenate(parts)
    if len(inside) > _POINTS:
        inside = inside[np.linspace(0, len(inside) - 1, _POINTS).astype(np.int64)]
    return inside.astype(np.float32)


def oracle_limit(texts: Iterable[str], signal: str) -> float | None:
    """Return the smallest constant limit of ``signal`` that must hold at each sample, if any."""
    limits = [
        number.value
        for text in texts
        for part, holds in _judged_parts(text)
        if holds
        and isinstance(part, Comparison)
        and isinstance(number := part.right, Number)
        and part.left == Signal(signal)
        and part.operator in ("<=", "<")
    ]
    return min(limits, default=None)
