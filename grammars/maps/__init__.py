"""Walls layers: buildings as they are, read and written.

:mod:`grammars.maps.map_import` makes one of an occupancy map, :mod:`grammars.maps.drawing` a map of
a DXF drawing.
"""

from grammars.maps._walls_layer import WallsText, load_walls, walls_text

__all__ = ["WallsText", "load_walls", "walls_text"]
