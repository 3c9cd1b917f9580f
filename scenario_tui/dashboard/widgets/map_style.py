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
"""Grey that is seen on dark and on bright backgrounds, and leaves the eye to what happens."""


class Layer(IntEnum):
    """Content and style of a cell: of several layers in a cell the last one counts."""

    style: Style

    def __new__(cls, style: Style) -> Layer:
        """Return the next layer."""
        layer = int.__new__(cls, len(cls.__members__))
        layer._value_, layer.style = len(cls.__members__), style
        return layer

    WALL = Style(color=WALLS)
    # Below what is low: walls are drawn as walls, whatever they cost.
    COSTMAP = Style(color=COLOURS[UNSURE], dim=True)
    LOW = Style(color=WALLS, dim=True)
    # Bold: where there are no colours, what the laser sees of a wall is told from the rest.
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
"""One for each eighth of a turn to the left."""
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
"""Signs of the map with their meanings, those first that nobody guesses."""
_GAP: Final = 3
_MAP_LINES: Final = 8
"""Lines of a screen for each line of a legend."""


@dataclass(frozen=True, slots=True)
class MapSigns:
    """The signs on a map, for its legend.

    ``limit`` [m] is the clearance an oracle asks for, ``decisive`` the name of what decides.
    """

    layers: frozenset[Layer] = frozenset()
    limit: float | None = None
    decisive: str = ""


def legend_lines(signs: Collection[MapSigns], width: int, height: int) -> list[Text]:
    """Return what the signs on some maps mean, as lines for a screen of ``width`` x ``height``.

    Only of what is on one of them, in lines that break between two signs. What there is no room
    for is left out, the signs one guesses first.
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
