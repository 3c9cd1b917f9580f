"""Signs and styles of the map in a terminal, and the legend that explains them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from rich.style import Style
from rich.text import Text

from grammars.text.words import format_quantity
from scenario_tui.text.styles import (
    BAD,
    BROKEN,
    BUSY,
    COLOURS,
    DOORS,
    FACT,
    GLYPHS,
    GOOD,
    QUIET,
    UNSURE,
)
from templates.plan_shapes import ShapeRole

WALLS: Final = "#7c818c"
"""Grey that is visible on dark and on bright backgrounds, but does not draw the eye."""


class Layer(IntEnum):
    """Content and style of a cell; the last of several layers in a cell counts."""

    style: Style

    def __new__(cls, style: Style) -> Layer:
        """Return the next layer."""
        layer = int.__new__(cls, len(cls.__members__))
        layer._value_, layer.style = len(cls.__members__), style
        return layer

    WALL = Style(color=WALLS)
    # Below LOW, so that walls stay walls in a costmap.
    COSTMAP = Style(color=COLOURS[UNSURE], dim=True)
    LOW = Style(color=WALLS, dim=True)
    # Bold, so that walls seen by the laser are distinct without colours.
    LIT = Style(color=COLOURS[FACT], bold=True)
    RETURN = Style(color=COLOURS[FACT], bold=True)
    PLAN = Style(color=COLOURS[BUSY])
    SPACE_NAME = Style(color=COLOURS[QUIET])
    DOOR_NAME = Style(color=COLOURS[DOORS], dim=True)
    TRAIL = Style(color=COLOURS[GOOD])
    POST = Style(color=WALLS)
    DOOR = Style(color=COLOURS[DOORS])
    MOVER = Style(color=COLOURS[DOORS], bold=True)
    SPREAD = Style(color=COLOURS[BROKEN])
    NEAR_TRAIL = Style(color=COLOURS[UNSURE], bold=True)
    TOUCHING_TRAIL = Style(color=COLOURS[BAD], bold=True)
    REACHED = Style(color=COLOURS[BUSY], dim=True)
    WAYPOINT = Style(color=COLOURS[BUSY], bold=True)
    ESTIMATE = Style(color=COLOURS[BROKEN], bold=True)
    ROBOT = Style(color=COLOURS[GOOD], bold=True)
    DECISION = Style(color=COLOURS[FACT], bold=True)
    FAILURE = Style(color=COLOURS[BAD], bold=True)
    HEADING = Style(color=COLOURS[GOOD], bold=True, reverse=True)
    CONTACT = Style(color=COLOURS[BAD], bold=True, reverse=True)
    SCALE = Style(color=COLOURS[QUIET])


STYLES: Final = tuple(layer.style for layer in Layer)
LAYER_OF: Final = {role: Layer[role.name] for role in ShapeRole if role.name in Layer.__members__}
ARROWS: Final = "→↗↑↖←↙↓↘"
"""Arrows for the eighths of a turn to the left."""
AHEAD, REACHED, ESTIMATE, CONTACT, TOUCHING, DECISION = "◆", "◇", "+", "✱", "×", "●"
FAILURE: Final = GLYPHS["fail"]
SIGNS: Final = (
    (Layer.HEADING, "↑", "robot"),
    (Layer.FAILURE, FAILURE, "decides"),
    (Layer.DECISION, DECISION, "decides"),
    (Layer.ESTIMATE, ESTIMATE, "estimate"),
    (Layer.SPREAD, "⢎⡱", "its spread (2σ)"),
    (Layer.WAYPOINT, AHEAD, "waypoint"),
    (Layer.REACHED, REACHED, "reached"),
    (Layer.TRAIL, "⠤⠤", "driven"),
    (Layer.NEAR_TRAIL, "⠶⠶", "nearer than"),
    (Layer.TOUCHING_TRAIL, TOUCHING, "touching"),
    (Layer.CONTACT, CONTACT, "contact"),
    (Layer.PLAN, "⠄⠄", "plan"),
    (Layer.RETURN, "⠒⠒", "laser"),
    (Layer.COSTMAP, "⠿⠿", "blocked in the costmap"),
    (Layer.DOOR, "⠒⠒", "door"),
    (Layer.MOVER, "⠶", "mover"),
)
"""Signs of the map with their meanings, the least obvious first."""
_GAP: Final = 3
_MAP_LINES: Final = 8
"""Lines of a screen per line of the legend."""


@dataclass(frozen=True, slots=True)
class MapSigns:
    """The signs on a map, for its legend.

    ``limit`` [m] is the clearance that an oracle requires, ``decisive`` the name of the object that
    decides.
    """

    layers: frozenset[Layer] = frozenset()
    limit: float | None = None
    decisive: str = ""


def legend_lines(signs: Collection[MapSigns], width: int, height: int) -> list[Text]:
    """Return the legend of the signs on some maps, for a screen of ``width`` x ``height``.

    The lines break between two signs. Without enough room, the most obvious signs are left out.
    """
    most = max(1, height // _MAP_LINES)
    lines = [Text(no_wrap=True)]
    for entry in _entries(signs):
        if lines[-1].cell_len and lines[-1].cell_len + _GAP + entry.cell_len > width:
            if len(lines) == most:
                break
            lines.append(Text(no_wrap=True))
        elif lines[-1].cell_len:
            lines[-1].append(" " * _GAP)
        lines[-1].append_text(entry)
    return lines


def _entries(signs: Collection[MapSigns]) -> Iterator[Text]:
    layers = {layer for one in signs for layer in one.layers}
    limits = sorted({one.limit for one in signs if one.limit is not None})
    clearance = " / ".join(format_quantity(limit, "m") for limit in limits)
    decisive = " / ".join(sorted({one.decisive for one in signs if one.decisive}))
    for layer, sign, words in SIGNS:
        if layer in layers:
            before = f"{decisive} " if layer in (Layer.FAILURE, Layer.DECISION) else ""
            after = f" {clearance}" if layer is Layer.NEAR_TRAIL else ""
            yield Text.assemble((sign, STYLES[layer]), " ", (f"{before}{words}{after}", QUIET))
