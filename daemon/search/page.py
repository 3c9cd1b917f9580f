"""The page of a search: its headline, its sentences, its figures, its runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from markupsafe import Markup

from daemon.analysis.charts import chart_figure, draw_charts, page_script
from daemon.analysis.report import GLYPHS
from daemon.analysis.report.run_maps import draw_moment, draw_recorded_way
from daemon.model.search_answer import SearchRow
from daemon.model.spec import own_version
from daemon.model.status import RunRow
from daemon.model.trials import Trial, point_trials
from daemon.search.answers.sentences import (
    headline,
    is_by_chance,
    margin_words,
    minus,
    phase_words,
    point_words,
    search_word,
)
from daemon.search.figures import margins_chart, space_charts
from daemon.search.points import is_as_written, range_text
from grammars.text.words import NOTHING, count_noun, duration_text, format_quantity
from templates.report import render_report

MOST_LISTED: Final = 60
"""Most points in the table: those with the smallest margins."""
_OVER_RUNS: Final = "Margin of every run, and the smallest so far"
_OVER_SPACE: Final = "Margins over the varied parameters"


def search_page(
    row: SearchRow,
    proposals: Sequence[RunRow],
    *,
    traces: Mapping[str, Path] | None = None,
    commands: Sequence[tuple[str, str]] = (),
) -> str:
    """Return the page of a search as self-contained HTML.

    ``proposals`` are all of its runs. ``traces`` are the files of runs by their ids. ``commands``
    are the next commands to type, each with its purpose.
    """
    task, answer = row.task, row.answer
    trials = point_trials(task, proposals)
    steps = point_trials(task, proposals, "nearest")
    nearest = answer.nearest.result if answer is not None and answer.nearest else None
    compared = {"nearest failure": nearest}
    if answer is not None:
        compared |= {"smallest margin": answer.best, "first failure": answer.first}
    charts = [(_OVER_RUNS, margins_chart(task, trials))] if trials else []
    charts += space_charts(task, trials, steps, nearest.point if nearest else None)
    drawings = draw_charts([chart for _, chart in charts])
    figures = [
        (caption, chart_figure(chart, svg, caption or _OVER_SPACE))
        for (caption, chart), svg in zip(charts, drawings, strict=True)
    ]
    example = answer.shown if answer is not None else None
    ordered = sorted(trials, key=lambda p: (math.isnan(p.compared), p.compared, p.number))
    return render_report(
        {
            "quantity": format_quantity,
            "count": count_noun,
            "duration": duration_text,
            "range": range_text,
            "margin": margin_words,
            "correlation": lambda one: minus(f"{one.correlation:+.2f}"),
            "by_chance": lambda one: is_by_chance(task, one),
            "not_written": lambda trial: point_words(task, trial.point, len(task.parameters)),
        },
        template="search.html.j2",
        library=page_script(),
        row=row,
        task=task,
        answer=answer,
        tone={"pass": "good", "fail": "bad"}.get(search_word(row), "open"),
        headline=headline(row),
        runs=proposals,
        state=phase_words(row),
        version=own_version(),
        figures={"margins": figures[:1], "space": figures[1:]},
        maps=dict(_maps(example, traces)) if example and traces else {},
        compared={name: trial for name, trial in compared.items() if trial is not None},
        influence={one.parameter: one for one in answer.influence} if answer is not None else {},
        is_as_written=is_as_written,
        points=ordered[:MOST_LISTED],
        left_out=len(ordered) - MOST_LISTED,
        steps=steps,
        shown=example,
        commands=commands,
        glyphs=GLYPHS,
        nothing=NOTHING,
    )


def _maps(example: Trial, traces: Mapping[str, Path]) -> Iterator[tuple[str, Markup]]:
    """Yield the deciding moment of a run, and its way, if there is a trace."""
    trace, verdict = traces.get(example.run), example.verdict
    if trace is None:
        return
    if verdict is not None and verdict.evidence.time is not None:
        label = f"The robot at {verdict.evidence.time:.1f} s of {example.label}"
        if moment := draw_moment(trace, verdict, label):
            yield f"at {format_quantity(verdict.evidence.time, 's')}", moment
    if way := draw_recorded_way(trace, f"The way driven in {example.label}", verdict):
        yield "the whole way", way
