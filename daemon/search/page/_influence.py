"""How much each parameter decides, as bars."""

from __future__ import annotations

import math
from typing import Final

from daemon.analysis.report import Sheet
from daemon.model.search import SearchTask
from daemon.model.search_answer import SearchAnswer
from daemon.search.answers.findings import is_by_chance
from daemon.search.answers.wording import minus, short_name

_LETTER: Final = 3.8


def plot_influence(task: SearchTask, answer: SearchAnswer) -> Sheet | None:
    """Return a bar for each parameter, those that decide most first; ``None`` without any.

    Grey: what chance gives as well with so few runs.
    """
    named = {p.name: p for p in task.parameters}
    found = [
        one for one in answer.influence if one.parameter in named and math.isfinite(one.correlation)
    ]
    if not found:
        return None
    found.sort(key=lambda one: (-abs(one.correlation), one.parameter))
    sheet = Sheet(5.2, 0.35 + 0.19 * len(found), bare=True)
    (axes,) = sheet.axes
    names = [short_name(task, named[one.parameter]) for one in found]
    # So wide that the longest name fits left of -1: the box has 72 x 5.2 points.
    share = min(0.6, (max(map(len, names)) * _LETTER + 12.0) / (72.0 * 5.2))
    left = -1.0 - 2.35 * share / (1.0 - share)
    axes.x_limits, axes.y_limits = (left, 1.35), (-len(found) - 0.3, 0.9)
    for value in (-1.0, -0.5, 0.0, 0.5, 1.0):
        axes.line([value, value], [-len(found), 0.0], "rule" if value else "soft", 0.6)
        words = minus(f"{value:g}")
        axes.words(value, 0.15, words, shift=(-0.5 * len(words) * _LETTER, 0.0))
    for row, (one, name) in enumerate(zip(found, names, strict=True)):
        y = -row - 0.5
        colour = (
            "wall" if is_by_chance(task, one) else "second" if one.correlation < 0.0 else "line"
        )
        axes.line([0.0, one.correlation], [y, y], colour, 8.0, flat=True)
        axes.words(-1.0, y, name, 7.0, colour="ink", anchor="end", shift=(-5.0, -2.5))
        words = minus(f"{one.correlation:+.2f}")
        axes.words(1.0, y, words, 6.5, shift=(5.0, -2.2))
    return sheet
