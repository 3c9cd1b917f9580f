"""The page of a search: what it says, in what order."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from markupsafe import Markup

from daemon.analysis.report import GLYPHS
from daemon.model.search import PointValue, SearchParameter
from daemon.model.search_answer import SearchAnswer, SearchRow
from daemon.model.spec import own_version
from daemon.model.status import RunRow
from daemon.model.trials import Trial, point_trials
from daemon.search.answers.sentences import headline, phase_words, point_words, search_word
from daemon.search.page._figures import NO_TRACES, search_figures
from daemon.search.page._spaces import MOST_LINES
from daemon.search.points import is_as_written, range_text
from grammars.text.words import NOTHING, count_noun, duration_text, format_quantity
from templates.report import render_search_report

MOST_LISTED: Final = 60
"""Points in the table at most: those with the smallest margins."""
_FIGURES: Final = ("margins", "boundary", "parallel", "influence", "moment", "way")
"""Names of figures; others are of two parameters, by whose names they are called."""


def search_page(
    row: SearchRow,
    proposals: Sequence[RunRow],
    *,
    baseline: Sequence[RunRow] = (),
    traces: Mapping[str, Path] = NO_TRACES,
    commands: Sequence[tuple[str, str]] = (),
) -> str:
    """Return the page of a search as HTML that needs nothing else.

    ``proposals`` are all of its runs. ``baseline`` and ``traces`` are as of
    :func:`daemon.search.page.search_figures`; ``commands`` is what to type next, each with what it
    does.
    """
    task, answer = row.task, row.answer
    trials = point_trials(task, proposals)
    # Drawn here, from numbers and escaped names, never taken from a file.
    figures = {
        name: Markup(svg)
        for name, svg in search_figures(row, proposals, baseline=baseline, traces=traces).items()
    }
    ordered = sorted(trials, key=lambda p: (math.isnan(p.compared), p.compared, p.number))
    return render_search_report(
        {
            "quantity": format_quantity,
            "range": range_text,
            "value": _value_text,
            "not_written": lambda trial: point_words(task, trial.point, len(task.parameters)),
        },
        row=row,
        task=task,
        answer=answer,
        tone={"pass": "good", "fail": "bad"}.get(search_word(row), "open"),
        headline=headline(row),
        facts=_facts(row, proposals),
        figures={name: figures.get(name, "") for name in _FIGURES},
        pairs={name: svg for name, svg in figures.items() if name not in _FIGURES},
        compared=_compared_trials(answer),
        is_as_written=is_as_written,
        points=ordered[:MOST_LISTED],
        left_out=len(ordered) - MOST_LISTED,
        thinned=sum(not trial.fails for trial in trials) > MOST_LINES,
        steps=point_trials(task, proposals, "nearest"),
        other_baseline=bool(baseline),
        shown=answer.shown if answer is not None else None,
        commands=commands,
        glyphs=GLYPHS,
        nothing=NOTHING,
    )


def _facts(row: SearchRow, proposals: Sequence[RunRow]) -> tuple[tuple[str, str], ...]:
    task = row.task
    about = task.minimise
    if len(task.scales) > 1:
        about = f"{task.minimise} of {', '.join(scale.oracle for scale in task.scales)}"
    budget = count_noun(task.runs, "run")
    if task.seconds:
        budget += f" or {duration_text(task.seconds)}"
    stop = {"failures": f"after {count_noun(task.failures, 'failure')}", "settled": "when settled"}
    if task.stop in stop:
        budget += f", or {stop[task.stop]}"
    runs = count_noun(len(proposals), "run")
    reused = sum(bool(one.cached) for one in proposals)
    if reused:
        runs += f", {reused} of them there already"
    simulated = sum(one.simulated for one in proposals)
    results = (one.result for one in proposals if not one.cached)
    cpu = sum(result.timing.cpu for result in results if result is not None)
    facts = (
        ("scenario", f"{task.scenario} with {task.sut}"),
        ("minimises", about),
        ("varies", count_noun(len(task.parameters), "parameter")),
        ("budget", budget),
        ("method", task.method),
        ("seed", str(task.seed)),
        ("confirms", count_noun(task.confirm, "repeat")),
        ("constraints", "; ".join(task.constraints)),
        ("runs", runs),
        ("simulated", f"{duration_text(simulated)} in {duration_text(cpu)} of CPU"),
        ("state", phase_words(row)),
        ("search", row.campaign),
        ("page written by", own_version()),
    )
    return tuple((name, value) for name, value in facts if value)


def _compared_trials(answer: SearchAnswer | None) -> dict[str, Trial]:
    """Return the points whose values stand beside those written, by what they are."""
    if answer is None:
        return {}
    named = {
        "nearest failure": answer.nearest.result if answer.nearest is not None else None,
        "smallest margin": answer.best,
        "first failure": answer.first,
    }
    return {name: trial for name, trial in named.items() if trial is not None}


def _value_text(parameter: SearchParameter, value: PointValue | None) -> str:
    return NOTHING if value is None else parameter.shown(value)
