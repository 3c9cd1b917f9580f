"""Which figures the page of a search has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeAlias

from daemon.analysis.report import PagePicture, draw_moment, plot_recorded_way
from daemon.model.proposals import ProposalRow
from daemon.model.search import Point
from daemon.model.search_answer import PointResult, SearchAnswer, SearchRow
from daemon.search.answers.answer import told_failure
from daemon.search.page._boundary import plot_boundary
from daemon.search.page._curves import plot_margins, space_filling_runs
from daemon.search.page._influence import plot_influence
from daemon.search.page._points import DrawnPoint, drawn_points
from daemon.search.page._spaces import plot_pairs, plot_parallel

MOST_PAIRED: Final = 4
"""Parameters of which every two have a picture; of more, all are drawn side by side."""
NO_TRACES: Final[Mapping[str, Path]] = {}


@dataclass(frozen=True, slots=True)
class PairFigure:
    """The name of a figure of two parameters: ``axes`` are their names, as one over the other."""

    axes: str


FigureName: TypeAlias = str | PairFigure


def search_figures(
    row: SearchRow,
    proposals: Sequence[ProposalRow],
    *,
    baseline: Sequence[ProposalRow] = (),
    traces: Mapping[str, Path] = NO_TRACES,
) -> dict[FigureName, str]:
    """Return the figures of a search as SVG to stand inside of a page, by what they show.

    ``margins`` has the margin over runs; ``boundary`` the margin over one or two parameters;
    ``parallel`` or every :class:`PairFigure` the points over their parameters; ``influence`` bars;
    ``moment`` and ``way`` the failure that is told, where ``traces`` has the file of its run by the
    run's id. ``baseline`` are the runs of another search of the same parameters that was not
    guided. Figures that have nothing to show are left out.
    """
    explored = drawn_points(row.task, proposals)
    steps = drawn_points(row.task, proposals, "nearest")
    return point_figures(row, explored, steps, baseline=baseline, traces=traces)


def point_figures(
    row: SearchRow,
    explored: Sequence[DrawnPoint],
    steps: Sequence[DrawnPoint],
    *,
    baseline: Sequence[ProposalRow],
    traces: Mapping[str, Path],
) -> dict[FigureName, str]:
    """Return what :func:`search_figures` does, of points; ``steps`` lead to the nearest failure."""
    drawn = _sheets(row, explored, steps, drawn_points(row.task, baseline), traces)
    return {
        name: sheet.svg(f"f{number}", label)
        for number, (name, label, sheet) in enumerate(drawn)
        if sheet is not None
    }


def told_point(answer: SearchAnswer | None) -> PointResult | None:
    """Return the run that a page shows closely: the failure that is told, else the best."""
    return None if answer is None else told_failure(answer) or answer.best


def _sheets(
    row: SearchRow,
    points: Sequence[DrawnPoint],
    steps: Sequence[DrawnPoint],
    baseline: Sequence[DrawnPoint],
    traces: Mapping[str, Path],
) -> Iterator[tuple[FigureName, str, PagePicture | None]]:
    task, answer = row.task, row.answer
    nearest = answer.nearest.result.values if answer is not None and answer.nearest else None
    if points:
        filling = space_filling_runs(task, points, baseline)
        label = "Margin of every run, the smallest so far, and failures over runs"
        yield "margins", label, plot_margins(task, points, filling)
        yield from _of_space(row, points, steps, nearest)
    if answer is not None:
        yield "influence", "Influence of parameters as bars", plot_influence(task, answer)
    yield from _of_failure(told_point(answer), traces)


def _of_space(
    row: SearchRow,
    points: Sequence[DrawnPoint],
    steps: Sequence[DrawnPoint],
    nearest: Point | None,
) -> Iterator[tuple[FigureName, str, PagePicture | None]]:
    task = row.task
    count = len(task.parameters)
    if count <= 2:
        label = "Margin over the parameters that are varied"
        # Nothing differs but what is drawn: those on the way to the nearest failure say more.
        yield "boundary", label, plot_boundary(task, (*points, *steps), nearest)
    elif count <= MOST_PAIRED:
        for name, sheet in plot_pairs(task, points, nearest).items():
            yield PairFigure(name), f"Runs that pass and that fail, {name}", sheet
    else:
        label = "Every run as a line over the parameters that are varied"
        yield "parallel", label, plot_parallel(task, points, nearest)


def _of_failure(
    shown: PointResult | None, traces: Mapping[str, Path]
) -> Iterator[tuple[FigureName, str, PagePicture | None]]:
    if shown is None or shown.run not in traces:
        return
    trace = traces[shown.run]
    evidence = shown.verdict.evidence if shown.verdict is not None else None
    if evidence is not None and evidence.time is not None:
        sheet = draw_moment(trace, evidence.time)
        yield "moment", f"The robot at {evidence.time:.1f} s of {shown.label}", sheet
    yield "way", f"The way driven in {shown.label}", plot_recorded_way(trace)
