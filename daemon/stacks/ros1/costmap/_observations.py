"""What the obstacle layers of a costmap have heard: scans, as long as they count, and of whom.

The rules are those of costmap_2d's ``ObservationBuffer``. A source with an
``observation_persistence`` of 0 knows the scan received last, whichever of its lasers it is from;
others know the scans whose stamps lie no more than that before the instant at which the last one
was received. What counts is that instant and not the present: the scans of a laser that has fallen
silent stay.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

from daemon.stacks.ros1.costmap.layers import ObservationSource, ObstacleLayer
from grammars.model.geometry import Floats, Pose2

if TYPE_CHECKING:  # kernels load the compiler
    from daemon.stacks.kernels import Singles

Hears: TypeAlias = Callable[[str], Collection[str]]
"""From a topic to the names of the lasers that are published on it."""
_NANOSECONDS: Final = 1_000_000_000
SCAN_COLUMNS: Final = 9


@dataclass(frozen=True, slots=True, eq=False)
class SensedScan:
    """A scan as a costmap sees it.

    ``pose`` is the laser's in the costmap's global frame at the stamp of the scan, ``ranges``
    (rays,) and ``angles`` (rays,) [m, rad] count from its x axis. Rays outside [``range_min``,
    ``range_max``), infinite or nan, tell nothing. ``height`` is the laser's [m], ``laser`` its
    name, which a robot's only one may not have. ``time`` is the stamp [s]; ``received`` is when
    the scan reached the costmap [s], not given: at its stamp.
    """

    pose: Pose2
    ranges: Singles
    angles: Floats
    range_min: float
    range_max: float
    height: float = 0.0
    laser: str = ""
    time: float = 0.0
    received: float | None = None


class PackedScans:
    """Scans in flat arrays for the kernels: ``ranges``, unit vectors ``directions`` of the rays.

    ``table`` has a row for each scan, columns as in the kernels' module; ``points`` has room for
    the end points of the rays of any of them.
    """

    def __init__(self) -> None:
        self.scans: Sequence[SensedScan] = ()
        self.ranges: Singles = np.empty(0, dtype=np.float32)
        self.directions: Floats = np.empty((0, 2))
        self.points: Singles = np.empty((0, 2), dtype=np.float32)
        self.table: Floats = np.zeros((1, SCAN_COLUMNS))
        self._angles: dict[str, Floats] = {}
        self._begins: dict[str, int] = {}

    def take(self, scans: Sequence[SensedScan]) -> None:
        """Pack ``scans``; raises ``ValueError`` for one with more or fewer ranges than angles."""
        self.scans = scans
        if len(scans) > len(self.table):
            self.table = np.zeros((2 * len(scans), SCAN_COLUMNS))
        first = 0
        for number, scan in enumerate(scans):
            if self._angles.get(scan.laser) is not scan.angles:
                self._take_angles(scans)
            rays, pose = len(scan.ranges), scan.pose
            if rays != len(scan.angles):
                raise ValueError(f"{rays} ranges at {len(scan.angles)} angles are no scan")
            self.table[number] = (
                *(pose.x, pose.y, pose.yaw, scan.range_min, scan.range_max, scan.height),
                *(first, rays, self._begins[scan.laser]),
            )
            first += rays
        if len(scans) == 1:
            self.ranges = scans[0].ranges
        elif scans:
            self.ranges = np.concatenate([scan.ranges for scan in scans])

    def _take_angles(self, scans: Sequence[SensedScan]) -> None:
        """Work out where the rays of every laser point; a laser keeps its angles for a run."""
        self._angles.update({scan.laser: scan.angles for scan in scans})
        begin = 0
        for laser, angles in self._angles.items():
            self._begins[laser] = begin
            begin += len(angles)
        packed = np.concatenate(list(self._angles.values()))
        self.directions = np.column_stack((np.cos(packed), np.sin(packed)))
        most = max(len(angles) for angles in self._angles.values())
        self.points = np.empty((most, 2), dtype=np.float32)


class ObservationTable:
    """The rows of one obstacle layer: what each of its sources knows of, in their order."""

    def __init__(self, layer: ObstacleLayer, hears: Hears | None) -> None:
        self._sources = tuple(
            (source, None if hears is None else frozenset(hears(source.topic)))
            for source in layer.sources
        )
        self._max_height = layer.max_obstacle_height
        self._known: list[tuple[int, int, float]] = []
        self._rows = _no_rows()

    def rows(self, packed: PackedScans) -> Floats:
        """Return the rows (n, 7), columns as in the kernels' module."""
        scans = packed.scans
        known = [
            (index, number, scans[number].height)
            for index, (source, lasers) in enumerate(self._sources)
            for number in kept_scans(source, lasers, scans)
        ]
        # Mostly the same scans by number as in the cycle before: then nothing changes here.
        if known != self._known:
            self._known = known
            self._rows = np.array([self._row(*item) for item in known]) if known else _no_rows()
        return self._rows

    def _row(self, index: int, number: int, height: float) -> tuple[float, ...]:
        source = self._sources[index][0]
        return (
            *(float(number), source.obstacle_range, source.raytrace_range),
            float(source.marking and point_height(height) <= self._max_height),
            *(float(source.clearing), float(source.inf_is_valid)),
            float(hears_height(source, height)),
        )


def _no_rows() -> Floats:
    return np.empty((0, 7))


def kept_scans(
    source: ObservationSource, lasers: Collection[str] | None, scans: Sequence[SensedScan]
) -> list[int]:
    """Return which of ``scans``, oldest first, ``source`` still knows of: numbers, newest first.

    It hears ``lasers``, or all of them with ``None``.
    """
    kept: list[int] = []
    latest = 0.0
    for number in range(len(scans) - 1, -1, -1):
        scan = scans[number]
        if lasers is not None and scan.laser not in lasers:
            continue
        if source.observation_persistence == 0.0:
            return [number]
        if not kept:
            latest = scan.time if scan.received is None else scan.received
        # Durations are whole nanoseconds in ROS; stamps here are sums of binary fractions.
        age = round((latest - scan.time) * _NANOSECONDS)
        if age > round(source.observation_persistence * _NANOSECONDS):
            break
        kept.append(number)
    return kept


def hears_height(source: ObservationSource, height: float) -> bool:
    """Tell whether the returns of a level laser at ``height`` [m] reach ``source``.

    Points have single precision: 0.3 m is a little more, and above a limit of 0.3.
    """
    return source.min_obstacle_height <= point_height(height) <= source.max_obstacle_height


def point_height(height: float) -> float:
    """Return the height [m] of the points of a level laser at ``height``: in single precision."""
    return float(np.float32(height))
