"""The occupancy grid that navigation stacks use as a map (ROS ``nav_msgs/OccupancyGrid``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

if TYPE_CHECKING:
    # Daemons and workers need only MapRule and start a third faster without numpy.
    import numpy as np
    import numpy.typing as npt

FREE: Final = 0
OCCUPIED: Final = 100
UNKNOWN: Final = -1

MapRule: TypeAlias = Literal["outline", "touch", "centre"]
"""Rule for the cells that a polygon occupies in a drawn map (:mod:`templates.occupancy`)."""


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """Cells of ``resolution`` metres in the map frame.

    ``cells`` has shape (rows, columns), int8: 0 free, 100 occupied, -1 unknown; foreign maps also
    have values between free and occupied. Row 0 is the lowest y; the lower-left corner of cell
    (0, 0) lies at (``x``, ``y``) in metres.
    """

    resolution: float
    x: float
    y: float
    cells: npt.NDArray[np.int8]
