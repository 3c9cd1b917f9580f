"""What may be chosen about reading drawings, and the names of layers and blocks that are usual."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

WALL_LAYERS: Final = ("*wall*", "*wand*", "*waende*", "*wände*", "*mur*", "*pared*")
"""Names of layers that hold walls, unless others are named."""
DOOR_BLOCKS: Final = ("*door*", "*tür*", "*tuer*", "*porte*", "*puerta*")
"""Names of blocks that are doors, and of layers whose arcs are, unless others are named."""
WINDOW_BLOCKS: Final = ("*window*", "*fenster*", "*fenêtre*", "*fenetre*", "*ventana*")
"""Names of blocks that close a gap as a wall does."""

UNITS: Final = {"mm": 1e-3, "cm": 1e-2, "dm": 1e-1, "m": 1.0, "in": 0.0254, "ft": 0.3048}
"""Units of drawings in metres."""


@dataclass(frozen=True, slots=True)
class DrawingSettings:
    """How a drawing is read; patterns hold ``*`` and ``?``, lengths are in metres.

    ``unit`` is that of the drawing, a key of ``UNITS``; without one the file has to say it.
    ``thickness`` is that of walls drawn as one line, ``tolerance`` how far straight pieces may
    lie off an arc, ``height`` that of the walls and ``door_height`` that of doorways.
    """

    name: str = ""
    layers: tuple[str, ...] = WALL_LAYERS
    doors: tuple[str, ...] = DOOR_BLOCKS
    unit: str = ""
    thickness: float = 0.1
    tolerance: float = 0.01
    height: float = 2.5
    door_height: float = 2.0
