"""The safety buffer: which box a campaign's oracles mean, and what of the world gets inside."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.judging.oracles import SignalSampler
from grammars.model.geometry import Floats, Point2, Ring
from grammars.oracle import Signal, parse_oracle
from grammars.text.diagnostics import InputError, Where
from grammars.text.expressions import Comparison, Number

if TYPE_CHECKING:
    from daemon.judging.oracles import ObstaclePolygons
    from daemon.model.spec import RunSpec
    from daemon.trace import Trace

DEFAULT_MARGIN: Final = 0.2
"""Distance [m] kept to obstacles where no oracle names one: the paper's (section 4.3.1)."""
_STEP: Final = 0.03
"""Points on the outline of an obstacle are at most this far apart [m]."""
_MOMENTS: Final = 160
"""Most moments of one run at which the buffer is looked into."""
_POINTS: Final = 4000
"""Most points kept of one run: about as many as the histogram has cells, 64 by 64."""

Indices: TypeAlias = npt.NDArray[np.int64]
ThinnedSamples: TypeAlias = npt.NDArray[np.float32]
"""Samples kept for drawing; numbers that count are taken from all samples before."""


@dataclass(frozen=True, slots=True)
class SafetyBuffer:
    """The safety buffer the report looks at: a box in the base frame, half extents [m].

    Without ``half`` it is the box around the footprint and ``margin`` [m] more on every side.
    ``source`` says in words where it is from.
    """

    half: Point2 | None
    margin: float
    source: str

    @property
    def size(self) -> str:
        """How large it is, in words: ``1.1 m × 0.866 m`` or ``0.2 m``."""
        if self.half is None:
            return f"{self.margin:g} m"
        return f"{2 * self.half[0]:g} m × {2 * self.half[1]:g} m"


def safety_buffer(texts: Iterable[str], footprints: Iterable[Ring] = ()) -> SafetyBuffer:
    """Return the largest box that oracles call clear, ``clearance(hx, hy)``.

    Without one, the largest limit of a plain ``clearance``; without that, the paper's 0.2 m. A
    buffer is room around the robot: a box that does not reach beyond one of the ``footprints`` on
    every side is where a collision begins (that of section 4.2.3 is narrower than the robot).
    """
    boxes: dict[Point2, str] = {}
    limits: dict[float, str] = {}
    for text in sorted(set(texts)):
        for part in _oracle_nodes(_parse_judgement(text)):
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


def buffer_of_run(spec: RunSpec) -> SafetyBuffer:
    """Return the buffer that the oracles of a run are about, around its robot."""
    return safety_buffer((oracle.text for oracle in spec.oracles), (spec.robot.footprint,))


def _is_around(half: Point2, footprints: Iterable[Ring]) -> bool:
    """Whether a box leaves room on every side of one of the footprints."""
    return any(
        all(abs(x) < half[0] and abs(y) < half[1] for x, y in footprint) for footprint in footprints
    )


# Of hundreds of runs of a campaign the same dozen oracles.
@functools.lru_cache(maxsize=256)
def _parse_judgement(text: str) -> object:
    try:
        return parse_oracle("report", text, Where("report")).judgement
    except InputError:
        return None


def _oracle_nodes(node: Any) -> Iterator[Any]:
    """Return every value in an oracle, however deep."""
    yield node
    if isinstance(node, tuple):
        for item in node:
            yield from _oracle_nodes(item)
    elif is_dataclass(node):
        for field in fields(node):
            yield from _oracle_nodes(getattr(node, field.name))


def points_inside(
    sampler: SignalSampler, near: Floats, centre: Point2, half: Point2
) -> ThinnedSamples:
    """Return points (k, 2) [m, base frame] of obstacle outlines inside the box.

    ``near`` (n,) is negative at the samples at which something is in the box; of those, some
    evenly over the run are looked at.
    """
    moments = np.flatnonzero(near < 0.0)
    if not len(moments):
        return np.empty((0, 2), np.float32)
    if len(moments) > _MOMENTS:
        moments = moments[np.linspace(0, len(moments) - 1, _MOMENTS).astype(np.int64)]
    outlines = _ObstacleOutlines(sampler.obstacles)
    reach = float(np.hypot(*half)) + float(np.hypot(*centre))
    # Points of outlines, not laser returns: what the laser does not see is inside of the buffer
    # all the same, and clearance is judged by outlines.
    points = outlines.seen_from(moments, sampler.poses[moments], reach) - centre
    inside = points[(np.abs(points[:, 0]) < half[0]) & (np.abs(points[:, 1]) < half[1])] + centre
    if len(inside) > _POINTS:
        inside = inside[np.linspace(0, len(inside) - 1, _POINTS).astype(np.int64)]
    return inside.astype(np.float32)


def returns_inside(trace: Trace, centre: Point2, half: Point2) -> ThinnedSamples:
    """Return laser returns (k, 2) [m, base frame] inside the box, of every laser of the robot.

    None where the trace was read without its scans.
    """
    found = [np.empty((0, 2))]
    for laser, scans in zip(trace.spec.robot.lasers, trace.scans or (), strict=False):
        angles = laser.angle_min + laser.angle_increment * np.arange(laser.rays)
        # Lost rays and those without a return are no numbers, or infinite.
        far = np.hypot(*half) + np.hypot(*centre) + np.hypot(laser.mount.x, laser.mount.y)
        ranges = scans.ranges.ravel()
        # The largest float32 up to there: all ranges would become float64 otherwise.
        limit = np.float32(far)
        limit = limit if limit <= far else np.nextafter(limit, np.float32(0.0))
        near = np.flatnonzero((ranges > 0.0) & (ranges <= limit))
        rays, ranges = near % laser.rays, ranges[near].astype(np.float64)
        cosines, sines = np.cos(angles), np.sin(angles)
        beams = np.column_stack((ranges * cosines[rays], ranges * sines[rays]))
        mount = np.array([(laser.mount.x, laser.mount.y, laser.mount.yaw)])
        points = transform_points(beams, mount) - centre
        within = (np.abs(points[:, 0]) < half[0]) & (np.abs(points[:, 1]) < half[1])
        found.append(points[within] + centre)
    inside = np.concatenate(found)
    if len(inside) > _POINTS:
        inside = inside[np.linspace(0, len(inside) - 1, _POINTS).astype(np.int64)]
    return inside.astype(np.float32)


def _polygons_near(
    obstacles: ObstaclePolygons, moments: Indices, poses: Floats, reach: float
) -> tuple[Indices, Indices]:
    """Return which polygons come as near as ``reach`` [m] to a robot at ``poses`` (m, 3).

    By their circles: a number of one of the ``moments`` (m,), which are samples, and the polygon.
    """
    # By circles first: of a building, nearly everything is far away.
    frame, circle = obstacles.frame, obstacles.circle
    moving = np.flatnonzero(frame >= 0)
    x, y = (np.repeat(circle[None, :, axis], len(moments), axis=0) for axis in (0, 1))
    if len(moving):
        tracks = obstacles.tracks[moments][:, frame[moving]]
        c, s = np.cos(tracks[..., 2]), np.sin(tracks[..., 2])
        own_x, own_y = circle[moving, 0], circle[moving, 1]
        x[:, moving] = tracks[..., 0] + c * own_x - s * own_y
        y[:, moving] = tracks[..., 1] + s * own_x + c * own_y
    away = np.hypot(x - poses[:, :1], y - poses[:, 1:2])
    numbers, polygons = np.nonzero(away <= reach + circle[:, 2])
    return numbers, polygons


class _ObstacleOutlines:
    """Obstacles as closely spaced points, where they are at any moment."""

    def __init__(self, obstacles: ObstaclePolygons) -> None:
        self._obstacles = obstacles
        self._points: dict[int, Floats] = {}
        # Doors rest most of the time: where one was before, and what its outline came to there.
        self._placed: dict[int, tuple[bytes, Floats]] = {}

    def seen_from(self, moments: Indices, poses: Floats, reach: float) -> Floats:
        """Return points within ``reach`` [m] of a robot at samples, in its base frame (k, 2).

        Of outlines, sample by sample, and a few that are farther away; ``poses`` (m, 3) are those
        of the robot at the samples ``moments`` (m,).
        """
        numbers, polygons = _polygons_near(self._obstacles, moments, poses, reach)
        placed = [
            self._placed_outline(moment, polygon)
            for moment, polygon in zip(moments[numbers].tolist(), polygons.tolist(), strict=True)
        ]
        if not placed:
            return np.empty((0, 2))
        points = np.concatenate(placed)
        seen = np.repeat(numbers, [len(outline) for outline in placed])
        dx, dy = points[:, 0] - poses[:, 0][seen], points[:, 1] - poses[:, 1][seen]
        # Of a long wall most is far away; as much more than rounding can be.
        near = np.flatnonzero((np.abs(dx) <= 1.01 * reach) & (np.abs(dy) <= 1.01 * reach))
        seen, dx, dy = seen[near], dx[near], dy[near]
        c, s = np.cos(poses[:, 2])[seen], np.sin(poses[:, 2])[seen]
        return np.column_stack((c * dx + s * dy, c * dy - s * dx))

    def _placed_outline(self, moment: int, polygon: int) -> Floats:
        """Return the outline of a polygon (k, 2) where it is at a sample, in the map frame."""
        frame = int(self._obstacles.frame[polygon])
        if frame < 0:
            return self._outline(polygon)
        pose = self._obstacles.tracks[moment, frame]
        at, before = pose.tobytes(), self._placed.get(polygon)
        if before is None or before[0] != at:
            before = at, transform_points(self._outline(polygon), pose[None])
            self._placed[polygon] = before
        return before[1]

    def _outline(self, polygon: int) -> Floats:
        if polygon not in self._points:
            first, last = self._obstacles.offsets[polygon : polygon + 2]
            self._points[polygon] = _dense_outline(self._obstacles.corners[first:last])
        return self._points[polygon]


def transform_points(points: Floats, poses: Floats) -> Floats:
    """Return points (n, 2) moved by poses (n or 1, 3)."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + c * points[:, 0] - s * points[:, 1]
    return np.column_stack((x, poses[:, 1] + s * points[:, 0] + c * points[:, 1]))


def _dense_outline(ring: Floats) -> Floats:
    """Return the outline of a polygon (n, 2) as points close to each other."""
    parts = []
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        count = max(int(np.ceil(np.hypot(*(b - a)) / _STEP)), 1)
        parts.append(a + (b - a) * (np.arange(count) / count)[:, None])
    return np.concatenate(parts)


def oracle_limit(texts: Iterable[str], signal: str) -> float | None:
    """Return the smallest constant that an oracle holds ``signal`` below, if any does."""
    found = [
        part.right.value
        for text in sorted(set(texts))
        for part in _oracle_nodes(_parse_judgement(text))
        if isinstance(part, Comparison)
        and isinstance(part.left, Signal)
        and part.left.name == signal
        and isinstance(part.right, Number)
        and part.operator in ("<=", "<")
    ]
    return min(found, default=None)
