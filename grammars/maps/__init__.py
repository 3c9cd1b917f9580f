"""Buildings from occupancy maps and drawings, and the walls layers that hold them.

- :func:`vectorise`: a building made from an occupancy map.
- :func:`walls_text`, :func:`load_walls`: a walls layer, written and read.
"""

from grammars.maps._vectorise import (
    EmptyMapError,
    ImportedMap,
    ImportReport,
    ImportSettings,
    vectorise,
)
from grammars.maps._walls_file import WALLS_ENDING, WallsText, load_walls
from grammars.maps._walls_text import walls_text
from grammars.maps.model import Area, DrawnBuilding, DrawnEntryway, DrawnSpace, DrawnWall

__all__ = [
    "WALLS_ENDING",
    "Area",
    "DrawnBuilding",
    "DrawnEntryway",
    "DrawnSpace",
    "DrawnWall",
    "EmptyMapError",
    "ImportReport",
    "ImportSettings",
    "ImportedMap",
    "WallsText",
    "load_walls",
    "vectorise",
    "walls_text",
]
