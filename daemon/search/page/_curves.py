"""Margin and failures over the runs of a search, beside those of space-filling runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Final

import numpy as np

from daemon.analysis.report import Axes, Sheet
from daemon.model.search import SearchTask
from daemon.search.page._points import DrawnPoint, margin_title, smallest_so_far

FULL: Final = 7.0
"""Width of a figure over the whole page [inches]."""
_DASHED: Final = "5 3"


@dataclass(frozen=True, slots=True)
class SpaceFillingRuns:
    """What a guided search is held against; ``label`` says in a legend which runs they are."""

    label: str
    points: tuple[DrawnPoint, ...]


def space_filling_runs(
    task: SearchTask, points: Sequence[DrawnPoint], other: Sequence[DrawnPoint]
) -> SpaceFillingRuns:
    """Return the runs of another search that was not guided, else those of this one."""
    if other:
        return SpaceFillingRuns(f"{other[-1].method} alone, another search", tuple(other))
    label = f"{task.drawn_word} runs alone"
    return SpaceFillingRuns(label, tuple(p for p in points if not p.guided))


def plot_margins(
    task: SearchTask, points: Sequence[DrawnPoint], filling: SpaceFillingRuns
) -> Sheet:
    """Return the margin of every run and the smallest so far, and below how many have failed."""
    sheet = Sheet(FULL, 4.2, 2)
    above, below = sheet.axes
    last = max(len(points), *(p.number + 1 for p in (*points, *filling.points)), 1)
    known = [p for p in points if not math.isnan(p.value)]
    for chosen, colour, label in (
        ([p for p in known if not p.guided and not p.result.fails], "soft", task.drawn_word),
        ([p for p in known if p.guided and not p.result.fails], "line", "guided"),
    ):
        if chosen:
            xs, ys = [p.number for p in chosen], [p.value for p in chosen]
            above.dots(xs, ys, colour, 3.4, alpha=0.85, label=label)
    failing = [p for p in known if p.result.fails]
    if failing:
        xs, ys = [p.number for p in failing], [p.value for p in failing]
        above.crosses(xs, ys, "bad", 4.4, label="fails")
    above.across(0.0, "bad", 0.9)
    _step(above, filling.points, smallest_so_far(filling.points), last, "second", filling.label)
    _step(above, points, smallest_so_far(points), last, "ink", "smallest so far")
    counts = [
        list(accumulate(int(p.result.fails) for p in runs)) for runs in (filling.points, points)
    ]
    _step(below, filling.points, counts[0], last, "second", filling.label)
    _step(below, points, counts[1], last, "ink", "this search")
    above.x_limits = below.x_limits = (-0.5, last - 0.5 if last > 1 else 1.0)
    top = max((c[-1] for c in counts if c), default=0)
    below.y_limits = (0.0, max(1.0, 1.08 * top))
    above.title, below.title, below.x_label = margin_title(task), "failures", "run"
    return sheet


def _step(
    axes: Axes,
    points: Sequence[DrawnPoint],
    values: Sequence[float],
    last: int,
    colour: str,
    label: str,
) -> None:
    """Draw values that hold from their run to the next one's, and to the end."""
    if not points:
        return
    xs = np.repeat(np.array([*(p.number for p in points), last], float), 2)[1:-1]
    ys = np.repeat(np.array(values, float), 2)
    dashes = "" if colour == "ink" else _DASHED
    axes.line(xs, ys, colour, 1.3, dashes=dashes, label=label, flat=True)
