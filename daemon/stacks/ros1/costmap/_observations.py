"""Scans that the obstacle layers of a costmap have heard, as long as they count.

The rules are those of costmap_2d's ``ObservationBuffer``. A source with an
``observation_persistence`` of 0 knows the scan received last, whichever of its lasers it is from;
others know the scans whose stamps lie no more than that before the instant at which the last one
was received. What counts is that instant and not the present: the scans of a laser that has fallen
silent stay.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

import numpy as np

from daemon.stacks.ros1.costmap.layers import ObservationSource, ObstacleLayer
from grammars.model.geometry import Floats, Pose2

if TYPE_CHECKING:  # kernels load the compiler
    from daemon.stacks.kernels import Singles

Hears: TypeAlias = Callable[[str], Collection[str]]
"""From a topic to the names of the lasers that are published on it."""
_NANOSECONDS: Final = 1_000_000_000


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


class ObservedScan(NamedTuple):
    """A scan, by its number, as one source of an obstacle layer knows it."""

    scan: int
    source: ObservationSource
    has_points: bool
    """Whether its returns reach the source."""
    marks: bool


class ObservationTable:
    """Observations of each source of one obstacle layer, in their order."""

    def __init__(self, layer: ObstacleLayer, hears: Hears | None) -> None:
        self._sources = tuple(
            (source, None if hears is None else frozenset(hears(source.topic)))
            for source in layer.sources
        )
        self._max_height = layer.max_obstacle_height
        self._known: list[tuple[int, int, float]] = []
        self._observations: list[ObservedScan] = []

    def observations(self, scans: Sequence[SensedScan]) -> list[ObservedScan]:
        """Return the observations among ``scans``, in the order of the original's buffers."""
        known = [
            (index, number, scans[number].height)
            for index, (source, lasers) in enumerate(self._sources)
            for number in kept_scans(source, lasers, scans)
        ]
        # Mostly the same scans by number as in the cycle before: then nothing changes here.
        if known != self._known:
            self._known = known
            self._observations = [self._observation(*item) for item in known]
        return self._observations

    def _observation(self, index: int, number: int, height: float) -> ObservedScan:
        source = self._sources[index][0]
        marks = source.marking and point_height(height) <= self._max_height
        return ObservedScan(number, source, hears_height(source, height), marks)


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
