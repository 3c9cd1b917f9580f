"""Walls layers: existing buildings, read and written.

:mod:`grammars.maps.map_import` makes a walls layer from an occupancy map,
:mod:`grammars.maps.drawing` makes a map from a DXF drawing.
"""

from grammars.maps._walls_layer import WallsText, load_walls, walls_text

__all__ = ["WallsText", "load_walls", "walls_text"]
