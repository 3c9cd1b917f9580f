"""Buildings from occupancy maps and drawings, and the walls layers that hold them."""

from grammars.maps.model import Area, DrawnBuilding, DrawnEntryway, DrawnSpace, DrawnWall

__all__ = ["Area", "DrawnBuilding", "DrawnEntryway", "DrawnSpace", "DrawnWall"]
