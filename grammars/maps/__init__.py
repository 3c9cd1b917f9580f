"""Buildings from occupancy maps and drawings, and the walls layers that hold them.

- :func:`walls_text`, :func:`load_walls`: a walls layer, written and read;
- :func:`vectorise`: a building from an occupancy map;
- :func:`grammars.maps.drawing.draw_map`: the map that a DXF drawing makes.
"""

from grammars.floorplan import WALLS_ENDING
from grammars.maps._from_map import vectorise
from grammars.maps._map_import import EmptyMapError, ImportedMap, ImportReport, ImportSettings
from grammars.maps._walls_file import WallsText, load_walls
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
