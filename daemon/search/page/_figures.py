"""The figures of a search: margins over its runs, its space, what decides, and the failure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate, combinations
from pathlib import Path
from typing import Final

import numpy as np

from daemon.analysis.report import Axes, PagePicture, Sheet
from daemon.analysis.report.run_maps import draw_moment, draw_recorded_way
from daemon.model.search import SearchTask
from daemon.model.search_answer import SearchAnswer, SearchRow
from daemon.model.status import RunRow
from daemon.model.trials import Trial, point_trials, smallest_so_far
from daemon.search.answers.sentences import is_by_chance, minus
from daemon.search.page._spaces import FULL, margin_title, plot_pair, plot_parallel, plot_range

MOST_PAIRED: Final = 4
"""Parameters of which every two have a picture; of more, all are drawn side by side."""
NO_TRACES: Final[Mapping[str, Path]] = {}
_LETTER: Final = 3.8
"""Width of a letter beside a bar [points]."""
_Figure = tuple[str, str, PagePicture | str | None]
"""Name, the words that are read out where pictures are not seen, and picture."""


def search_figures(
    row: SearchRow,
    proposals: Sequence[RunRow],
    *,
    baseline: Sequence[RunRow] = (),
    traces: Mapping[str, Path] = NO_TRACES,
) -> dict[str, str]:
    """Return the figures of a search as SVG to stand inside of a page, by what they show.

    ``margins`` has the margin over runs; ``boundary`` the margin over one or two parameters, or
    ``parallel`` the points over many; of a few parameters there is a figure for every two, by their
    names; ``influence`` has bars; ``moment`` and ``way`` the failure that is told, where ``traces``
    has the file of its run by the run's id. ``baseline`` are the runs of another search of the same
    parameters that was not guided. Figures that have nothing to show are left out.
    """
    trials = point_trials(row.task, proposals)
    steps = point_trials(row.task, proposals, "nearest")
    drawn = _figures(row, trials, steps, point_trials(row.task, baseline), traces)
    return {
        name: sheet if isinstance(sheet, str) else sheet.svg(f"f{number}", label)
        for number, (name, label, sheet) in enumerate(drawn)
        if sheet is not None
    }


def _figures(
    row: SearchRow,
    trials: Sequence[Trial],
    steps: Sequence[Trial],
    baseline: Sequence[Trial],
    traces: Mapping[str, Path],
) -> Iterator[_Figure]:
    task, answer = row.task, row.answer
    if trials:
        label = "Margin of every run, the smallest so far, and failures over runs"
        yield "margins", label, _plot_margins(task, trials, baseline)
        yield from _of_space(row, trials, steps)
    if answer is not None:
        yield "influence", "Influence of parameters as bars", _plot_influence(task, answer)
    shown = answer.shown if answer is not None else None
    if shown is None or shown.run not in traces:
        return
    trace = traces[shown.run]
    if shown.verdict is not None and (time := shown.verdict.evidence.time) is not None:
        label = f"The robot at {time:.1f} s of {shown.label}"
        yield "moment", label, draw_moment(trace, shown.verdict, label)
    label = f"The way driven in {shown.label}"
    yield "way", label, draw_recorded_way(trace, label, shown.verdict)


def _of_space(row: SearchRow, trials: Sequence[Trial], steps: Sequence[Trial]) -> Iterator[_Figure]:
    task, answer = row.task, row.answer
    nearest = answer.nearest.result.point if answer is not None and answer.nearest else None
    count = len(task.parameters)
    if count > MOST_PAIRED:
        label = "Every run as a line over the parameters that are varied"
        yield "parallel", label, plot_parallel(task, trials, nearest)
        return
    # Of one or two nothing differs but what is drawn: the way to the nearest failure says more.
    among = (*trials, *steps) if count <= 2 else trials
    known = [one for one in among if math.isfinite(one.compared)]
    if not known:
        return
    label = "Margin over the parameters that are varied"
    if count == 1:
        yield "boundary", label, plot_range(task, known, nearest)
    elif count == 2:
        yield "boundary", label, plot_pair(task, known, nearest, (0, 1))
    else:
        names = [task.short_name(parameter.name) for parameter in task.parameters]
        for x, y in combinations(range(count), 2):
            name = f"{names[y]} over {names[x]}"
            yield name, f"Margins of runs, {name}", plot_pair(task, known, nearest, (x, y))


def _plot_margins(task: SearchTask, trials: Sequence[Trial], other: Sequence[Trial]) -> Sheet:
    """Return the margin of every run and the smallest so far, and below how many have failed.

    A guided search is held against the runs of an ``other`` one that was not, else its own.
    """
    if other:
        filling, filled = f"{other[-1].proposal.method} alone, another search", other
    else:
        filling = f"{task.drawn_word} runs alone"
        filled = [one for one in trials if not one.proposal.guided]
    sheet = Sheet(FULL, 4.2, 2)
    above, below = sheet.axes
    last = max(one.number + 1 for one in (*trials, *filled))
    known = [one for one in trials if not math.isnan(one.compared)]
    passing = [one for one in known if not one.fails]
    for chosen, draw, colour, size, label in (
        ([p for p in passing if not p.proposal.guided], above.dots, "soft", 3.4, task.drawn_word),
        ([p for p in passing if p.proposal.guided], above.dots, "line", 3.4, "guided"),
        ([p for p in known if p.fails], above.crosses, "bad", 4.4, "fails"),
    ):
        if chosen:
            draw([p.number for p in chosen], [p.compared for p in chosen], colour, size,
                 label=label)  # fmt: skip
    above.across(0.0, "bad", 0.9)
    top = 0
    for runs, colour, label, beside in (
        (filled, "second", filling, filling), (trials, "ink", "smallest so far", "this search"),
    ):  # fmt: skip
        failed = list(accumulate(int(one.fails) for one in runs))
        top = max([top, *failed[-1:]])
        _step(above, runs, smallest_so_far(one.compared for one in runs), last, colour, label)
        _step(below, runs, failed, last, colour, beside)
    above.x_limits = below.x_limits = (-0.5, last - 0.5 if last > 1 else 1.0)
    below.y_limits = (0.0, max(1.0, 1.08 * top))
    above.title, below.title, below.x_label = margin_title(task), "failures", "run"
    return sheet


def _step(
    axes: Axes,
    trials: Sequence[Trial],
    values: Sequence[float],
    last: int,
    colour: str,
    label: str,
) -> None:
    """Draw values that hold from their run to the next one's, and to the end."""
    if not trials:
        return
    xs = np.repeat(np.array([*(one.number for one in trials), last], float), 2)[1:-1]
    ys = np.repeat(np.array(values, float), 2)
    axes.line(xs, ys, colour, 1.3, dashes="" if colour == "ink" else "5 3", label=label, flat=True)


def _plot_influence(task: SearchTask, answer: SearchAnswer) -> Sheet | None:
    """Return a bar for each parameter, those that decide most first; ``None`` without any.

    Grey: what chance gives as well with so few runs.
    """
    shown = sorted(
        (one for one in answer.influence if math.isfinite(one.correlation)),
        key=lambda one: (-abs(one.correlation), one.parameter),
    )
    if not shown:
        return None
    sheet = Sheet(5.2, 0.35 + 0.19 * len(shown), bare=True)
    (axes,) = sheet.axes
    names = [task.short_name(one.parameter) for one in shown]
    # So wide that the longest name fits left of -1: the box has 72 x 5.2 points.
    share = min(0.6, (max(map(len, names)) * _LETTER + 12.0) / (72.0 * 5.2))
    left = -1.0 - 2.35 * share / (1.0 - share)
    axes.x_limits, axes.y_limits = (left, 1.35), (-len(shown) - 0.3, 0.9)
    for value in (-1.0, -0.5, 0.0, 0.5, 1.0):
        axes.line([value, value], [-len(shown), 0.0], "rule" if value else "soft", 0.6)
        words = minus(f"{value:g}")
        axes.words(value, 0.15, words, shift=(-0.5 * len(words) * _LETTER, 0.0))
    for row, (one, name) in enumerate(zip(shown, names, strict=True)):
        y = -row - 0.5
        colour = "second" if one.correlation < 0.0 else "line"
        if is_by_chance(task, one):
            colour = "wall"
        axes.line([0.0, one.correlation], [y, y], colour, 8.0, flat=True)
        axes.words(-1.0, y, name, 7.0, colour="ink", anchor="end", shift=(-5.0, -2.5))
        axes.words(1.0, y, minus(f"{one.correlation:+.2f}"), 6.5, shift=(5.0, -2.2))
    return sheet
