"""The occupancy grid a navigation stack gets as its map (ROS ``nav_msgs/OccupancyGrid``).

Also its files, as ``map_server`` and nav2 read them.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

FREE: Final = 0
OCCUPIED: Final = 100
UNKNOWN: Final = -1

MapRule: TypeAlias = Literal["outline", "touch", "centre"]
"""Which cells a polygon takes in a map that is drawn (:mod:`templates.occupancy`)."""


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """Cells of ``resolution`` metres in the map frame.

    ``cells`` has shape (rows, columns), int8: 0 free, 100 occupied, -1 unknown. Row 0 is the
    lowest y; the lower-left corner of cell (0, 0) lies at (``x``, ``y``) in metres.
    """

    resolution: float
    x: float
    y: float
    cells: npt.NDArray[np.int8]


def write_map(grid: OccupancyGrid, stem: Path, *, laser_height: float) -> tuple[Path, Path]:
    """Write ``<stem>.pgm`` and ``<stem>.yaml`` for ROS ``map_server`` and nav2; return both paths.

    Free is 254, occupied 0 and unknown 205, which the thresholds written (0.65 and 0.196) read
    back as such. ``laser_height`` [m] is noted in the files.
    """
    image, meta = (stem.with_name(stem.name + suffix) for suffix in (".pgm", ".yaml"))
    # As map_saver of ROS writes them: 205 is an occupancy of 50 / 255, just above free_thresh.
    grey = np.full_like(grid.cells, 205, dtype=np.uint8)
    grey[grid.cells == FREE] = 254
    grey[grid.cells == OCCUPIED] = 0
    note = f"laser at {laser_height:g} m, {grid.resolution:g} m per cell"
    header = f"P5\n# {note}\n{len(grey[0])} {len(grey)}\n255\n".encode()
    image.write_bytes(header + np.flipud(grey).tobytes())
    meta.write_text(
        f"# {note}\n"
        f"image: {json.dumps(image.name)}\n"
        "mode: trinary\n"
        f"resolution: {grid.resolution!r}\n"
        f"origin: [{grid.x!r}, {grid.y!r}, 0.0]\n"
        "negate: 0\n"
        "occupied_thresh: 0.65\n"
        "free_thresh: 0.196\n",
        encoding="utf-8",
    )
    return image, meta
