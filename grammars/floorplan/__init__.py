"""FloorPlan language: from `.fpm` text to world geometry."""

from grammars.floorplan._frames import WORLD_FRAME, frame_of, frames
from grammars.floorplan._load import load_floorplan, parse_floorplan
from grammars.floorplan.model import (
    Feature,
    FloorPlan,
    Opening,
    Placement,
    Point3,
    Space,
    Wall,
)

__all__ = [
    "WORLD_FRAME",
    "Feature",
    "FloorPlan",
    "Opening",
    "Placement",
    "Point3",
    "Space",
    "Wall",
    "frame_of",
    "frames",
    "load_floorplan",
    "parse_floorplan",
]
