"""How each thing on the map looks in a terminal, and the legend that says so."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from rich.style import Style
from rich.text import Text

from grammars.text.words import format_quantity
from scenario_tui.text.formatting import (
    BAD,
    BROKEN,
    BUSY,
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
    """What a cell shows, and its style: of several layers in a cell the last one counts."""

    WALL = 0
    COSTMAP = 1
    LOW = 2
    LIT = 3
    RETURN = 4
    PLAN = 5
    SPACE_NAME = 6
    DOOR_NAME = 7
    TRAIL = 8
    POST = 9
    DOOR = 10
    MOVER = 11
    SPREAD = 12
    NEAR = 13
    TOUCHING = 14
    REACHED = 15
    WAYPOINT = 16
    ESTIMATE = 17
    ROBOT = 18
    DECISION = 19
    FAILURE = 20
    HEADING = 21
    CONTACT = 22
    SCALE = 23


STYLES: Final = tuple(
    {
        Layer.WALL: Style(color=WALLS),
        # Below what is low: walls are drawn as walls, whatever they cost.
        Layer.COSTMAP: Style(color=UNSURE, dim=True),
        Layer.LOW: Style(color=WALLS, dim=True),
        # Bold: where there are no colours, what the laser sees of a wall is told from the rest.
        Layer.LIT: Style(color=FACT, bold=True),
        Layer.RETURN: Style(color=FACT, bold=True),
        Layer.PLAN: Style(color=BUSY),
        Layer.SPACE_NAME: Style(color=QUIET),
        Layer.DOOR_NAME: Style(color=DOORS, dim=True),
        Layer.TRAIL: Style(color=GOOD),
        Layer.POST: Style(color=WALLS),
        Layer.DOOR: Style(color=DOORS),
        Layer.MOVER: Style(color=DOORS, bold=True),
        Layer.SPREAD: Style(color=BROKEN),
        Layer.NEAR: Style(color=UNSURE, bold=True),
        Layer.TOUCHING: Style(color=BAD, bold=True),
        Layer.REACHED: Style(color=BUSY, dim=True),
        Layer.WAYPOINT: Style(color=BUSY, bold=True),
        Layer.ESTIMATE: Style(color=BROKEN, bold=True),
        Layer.ROBOT: Style(color=GOOD, bold=True),
        Layer.DECISION: Style(color=FACT, bold=True),
        Layer.FAILURE: Style(color=BAD, bold=True),
        Layer.HEADING: Style(color=GOOD, bold=True, reverse=True),
        Layer.CONTACT: Style(color=BAD, bold=True, reverse=True),
        Layer.SCALE: Style(color=QUIET),
    }[layer]
    for layer in Layer
)
LAYER_OF: Final = {
    ShapeRole.WALL: Layer.WALL,
    ShapeRole.LOW: Layer.LOW,
    ShapeRole.COSTMAP: Layer.COSTMAP,
    ShapeRole.RETURN: Layer.RETURN,
    ShapeRole.PLAN: Layer.PLAN,
    ShapeRole.TRAIL: Layer.TRAIL,
    ShapeRole.NEAR_TRAIL: Layer.NEAR,
    ShapeRole.TOUCHING_TRAIL: Layer.TOUCHING,
    ShapeRole.DOOR: Layer.DOOR,
    ShapeRole.POST: Layer.POST,
    ShapeRole.MOVER: Layer.MOVER,
    ShapeRole.SPREAD: Layer.SPREAD,
    ShapeRole.REACHED: Layer.REACHED,
    ShapeRole.WAYPOINT: Layer.WAYPOINT,
    ShapeRole.ESTIMATE: Layer.ESTIMATE,
    ShapeRole.ROBOT: Layer.ROBOT,
    ShapeRole.HEADING: Layer.HEADING,
    ShapeRole.CONTACT: Layer.CONTACT,
    ShapeRole.DECISION: Layer.DECISION,
    ShapeRole.FAILURE: Layer.FAILURE,
}
ARROWS: Final = "→↗↑↖←↙↓↘"
"""One for each eighth of a turn to the left."""
AHEAD, REACHED, ESTIMATE, CONTACT, TOUCHING, DECISION = "◆", "◇", "+", "✱", "×", "●"
FAILURE: Final = GLYPHS["fail"]
_SIGNS: Final = (
    (Layer.HEADING, "↑", "robot"),
    (Layer.FAILURE, FAILURE, "decides"),
    (Layer.DECISION, DECISION, "decides"),
    (Layer.ESTIMATE, ESTIMATE, "estimate"),
    (Layer.SPREAD, "⢎⡱", "its spread (2σ)"),
    (Layer.WAYPOINT, AHEAD, "waypoint"),
    (Layer.REACHED, REACHED, "reached"),
    (Layer.TRAIL, "⠤⠤", "driven"),
    (Layer.NEAR, "⠶⠶", "nearer than"),
    (Layer.TOUCHING, TOUCHING, "touching"),
    (Layer.CONTACT, CONTACT, "contact"),
    (Layer.PLAN, "⠄⠄", "plan"),
    (Layer.RETURN, "⠒⠒", "laser"),
    (Layer.COSTMAP, "⠿⠿", "blocked in the costmap"),
    (Layer.DOOR, "⠒⠒", "door"),
    (Layer.MOVER, "⠶", "mover"),
)
_GAP: Final = 3
_MAP_LINES: Final = 8
"""Lines of a screen for each line of a legend."""


@dataclass(frozen=True, slots=True)
class MapSigns:
    """What is on a map, for its legend.

    ``limit`` [m] is the clearance an oracle asks for, ``decisive`` the name of what decides.
    """

    layers: frozenset[Layer] = frozenset()
    limit: float | None = None
    decisive: str = ""


def legend_lines(signs: Collection[MapSigns], width: int, most: int) -> list[Text]:
    """Return what the signs on some maps mean, as at most ``most`` lines of ``width`` cells.

    Only of what is on one of them, in lines that break between two signs. What there is no room
    for is left out, the signs one guesses first.
    """
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


def legend_height(height: int) -> int:
    """Return how many lines a legend may take of a screen of ``height`` lines."""
    return max(1, height // _MAP_LINES)


def _entries(signs: Collection[MapSigns]) -> Iterator[Text]:
    shown = {layer for one in signs for layer in one.layers}
    limits = sorted({one.limit for one in signs if one.limit is not None})
    asked = " / ".join(format_quantity(limit, "m") for limit in limits)
    decisive = " / ".join(sorted({one.decisive for one in signs if one.decisive}))
    for layer, sign, words in _SIGNS:
        if layer in shown:
            before = f"{decisive} " if layer in (Layer.FAILURE, Layer.DECISION) else ""
            after = f" {asked}" if layer is Layer.NEAR else ""
            yield Text.assemble((sign, STYLES[layer]), " ", (f"{before}{words}{after}", QUIET))
