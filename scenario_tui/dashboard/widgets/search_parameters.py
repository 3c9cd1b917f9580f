"""The parameters of a run of a search: as written, as they are in it, and where in their range."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from rich.text import Text

from daemon.model.search import Point, PointValue, SearchParameter, SearchTask
from daemon.search.points import position_in_range
from scenario_tui.text.formatting import NOTHING, QUIET, UNSURE, keep_end, keep_start

_BAR, _LEAST_NAME = 11, 12
"""Cells of the range, and of a name at least."""
_INFLUENCE: Final = 7
LEGEND: Final = "│ as written  ● in this run  ≠ not as written"


def range_bar(parameter: SearchParameter, value: PointValue, cells: int = _BAR) -> str:
    """Return the range as a line, with ``│`` where the written value lies and ``●`` at ``value``.

    A value outside of the range is ``<`` or ``>`` at that end; one that has no place is left out.
    """
    line = ["─"] * cells
    for seen, sign in ((parameter.written, "│"), (value, "●")):
        share = position_in_range(parameter, seen)
        if not math.isnan(share):
            place = round(min(1.0, max(0.0, share)) * (cells - 1))
            line[place] = "<" if share < 0.0 else ">" if share > 1.0 else sign
    return "".join(line)


def parameters_text(
    task: SearchTask, values: Point, width: int, influence: Mapping[str, float] | None = None
) -> Text:
    """Return a line for each parameter, at most ``width`` cells; those not as written stand out.

    ``influence`` are correlations with the margin, shown where there is room for them.
    """
    pairs = list(zip(task.parameters, values, strict=False))
    said = [
        ("" if value == one.written else _written(one, value), one.shown(value))
        for one, value in pairs
    ]
    sizes = [max((len(texts[i]) for texts in said), default=0) for i in (0, 1)]
    names = [task.short_name(one.name) for one, _ in pairs]
    longest = max(map(len, names), default=0)
    most = max((width - _BAR - 7 - _LEAST_NAME) // 2, 4)
    sizes[0] = min(sizes[0], most)
    sizes[1] = min(sizes[1], 2 * most - sizes[0])
    rest = width - sum(sizes) - _BAR - 7
    correlations = influence if influence and rest - longest >= _INFLUENCE else {}
    name_cells = max(min(longest, rest), _LEAST_NAME)
    text = Text(no_wrap=True, overflow="ellipsis")
    for name, (one, value), (written, now) in zip(names, pairs, said, strict=True):
        changed = value != one.written
        text.append("≠ " if changed else "  ", style=UNSURE)
        text.append(keep_end(name, name_cells), style="bold" if changed else QUIET)
        text.append(f" {keep_start(written, sizes[0]):>{sizes[0]}} ", style=QUIET)
        text.append("→ " if changed else "  ", style=QUIET)
        text.append(
            f"{keep_start(now, sizes[1]):<{sizes[1]}} ", style=f"bold {UNSURE}" if changed else ""
        )
        text.append(range_bar(one, value), style="" if changed else QUIET)
        if one.name in correlations:
            text.append(f"  {correlations[one.name]:+.2f}".replace("-", "−"), style=QUIET)
        text.append("\n")
    text.append(LEGEND if width >= len(LEGEND) else "│ written  ● here", style=QUIET)
    return text


def _written(parameter: SearchParameter, value: PointValue) -> str:
    """Return the written value, without its unit where that of the other one follows."""
    if parameter.written is None:
        return NOTHING
    words = parameter.shown(parameter.written)
    numbers = isinstance(value, float | int) and isinstance(parameter.written, float | int)
    return words.removesuffix(f" {parameter.unit}") if numbers and parameter.unit else words
