"""FloorPlan language: from `.fpm` text to world geometry."""

from grammars.floorplan._features import opening_at
from grammars.floorplan._files import (
    ParsedFloorPlan,
    load_floorplan,
    parse_floorplan,
    parse_syntax,
    read_floorplan,
    variables_of,
)
from grammars.floorplan._geometry import Flaw, geometric_flaws, overlaps, warn_of
from grammars.floorplan._spaces import outer_corners, space_at, wall_frames
from grammars.floorplan.model import (
    WALLS_ENDING,
    WORLD_FRAME,
    Feature,
    FloorPlan,
    Opening,
    Placement,
    Point3,
    Space,
    Wall,
)

__all__ = [
    "WALLS_ENDING",
    "WORLD_FRAME",
    "Feature",
    "Flaw",
    "FloorPlan",
    "Opening",
    "ParsedFloorPlan",
    "Placement",
    "Point3",
    "Space",
    "Wall",
    "geometric_flaws",
    "load_floorplan",
    "opening_at",
    "outer_corners",
    "overlaps",
    "parse_floorplan",
    "parse_syntax",
    "read_floorplan",
    "space_at",
    "variables_of",
    "wall_frames",
    "warn_of",
]
