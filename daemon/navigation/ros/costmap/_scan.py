"""What the obstacle layer is told."""

from __future__ import annotations

from dataclasses import dataclass

from daemon.navigation.kernels import Singles
from grammars.values import Floats, Pose2


@dataclass(frozen=True, slots=True, eq=False)
class SensedScan:
    """A scan as a costmap sees it.

    ``laser`` is the laser's pose in the costmap's global frame at the stamp of the scan,
    ``ranges`` (rays,) and ``angles`` (rays,) [m, rad] count from its x axis. Rays outside
    [``range_min``, ``range_max``), infinite or nan, tell nothing. ``height`` is the laser's [m].
    """

    laser: Pose2
    ranges: Singles
    angles: Floats
    range_min: float
    range_max: float
    height: float = 0.0
