"""Scans that count for the obstacle layers of a costmap.

The rules are those of costmap_2d's ``ObservationBuffer``. A source with an
``observation_persistence`` of 0 knows the scan received last, from any of its lasers. Other
sources know the scans whose stamps are at most that much older than the reception of the last one.
The present time does not matter: the scans of a silent laser stay.
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
"""Function from a topic to the names of the lasers that are published on it."""
_NANOSECONDS: Final = 1_000_000_000


@dataclass(frozen=True, slots=True, eq=False)
class SensedScan:
    """A scan for a costmap.

    ``pose`` is the laser's in the costmap's global frame at the stamp of the scan. ``ranges``
    (rays,) [m] and ``angles`` (rays,) [rad] count from its x axis. Rays outside [``range_min``,
    ``range_max``), infinite or nan, do not count. ``height`` is the laser's [m], ``laser`` its
    name, empty for a nameless one. ``time`` is the stamp [s], ``received`` the time at which the
    scan reached the costmap [s], by default its stamp.
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
    """A scan for one source of an obstacle layer."""

    scan: SensedScan
    source: ObservationSource
    has_points: bool
    """Its returns reach the source."""
    marks: bool


def observations(
    layer: ObstacleLayer, lasers: Sequence[Collection[str]], scans: Sequence[SensedScan]
) -> list[ObservedScan]:
    """Return the observations of a layer among ``scans``, in the order of the original's buffers.

    ``lasers`` are those that each of its sources hears.
    """
    return [
        ObservedScan(
            scan,
            source,
            hears_height(source, scan.height),
            source.marking and point_height(scan.height) <= layer.max_obstacle_height,
        )
        for source, heard in zip(layer.sources, lasers, strict=True)
        for scan in kept_scans(source, heard, scans)
    ]


def kept_scans(
    source: ObservationSource, lasers: Collection[str], scans: Sequence[SensedScan]
) -> list[SensedScan]:
    """Return those of the ``scans`` (oldest first) that ``source`` knows, newest first.

    It hears ``lasers``.
    """
    kept: list[SensedScan] = []
    latest = 0.0
    for scan in reversed(scans):
        if scan.laser not in lasers:
            continue
        if source.observation_persistence == 0.0:
            return [scan]
        if not kept:
            latest = scan.time if scan.received is None else scan.received
        # Durations are whole nanoseconds in ROS; stamps here are sums of binary fractions.
        age = round((latest - scan.time) * _NANOSECONDS)
        if age > round(source.observation_persistence * _NANOSECONDS):
            break
        kept.append(scan)
    return kept


def hears_height(source: ObservationSource, height: float) -> bool:
    """Tell whether the returns of a level laser at ``height`` [m] reach ``source``.

    Points have single precision, in which 0.3 m exceeds a limit of 0.3.
    """
    return source.min_obstacle_height <= point_height(height) <= source.max_obstacle_height


def point_height(height: float) -> float:
    """Return the height [m] of the points of a level laser at ``height``, in single precision."""
    return float(np.float32(height))
