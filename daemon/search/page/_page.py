"""The page of a search: what it says, in what order, in which words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from markupsafe import Markup

from daemon.analysis.report import GLYPHS, NOTHING, duration_text, format_quantity
from daemon.model.proposals import ProposalRow
from daemon.model.search import Point, PointValue, SearchParameter, SearchTask
from daemon.model.search_answer import SearchAnswer, SearchRow
from daemon.model.spec import own_version
from daemon.search.answers.sentences import ending_words
from daemon.search.answers.wording import point_words
from daemon.search.page._figures import NO_TRACES, PairFigure, point_figures, told_point
from daemon.search.page._points import DrawnPoint, drawn_points
from daemon.search.page._spaces import MOST_LINES
from daemon.search.points import is_as_written, range_text
from grammars.text.words import count_noun
from templates.report import render_search_report

MOST_LISTED: Final = 60
"""Points in the table at most: those with the smallest margins."""
_FIGURES: Final = ("margins", "boundary", "parallel", "influence", "moment", "way")


@dataclass(frozen=True, slots=True)
class SearchHeadline:
    """Whether it can fail: one word for its colour, a short word, the sentence."""

    tone: Literal["good", "bad", "open"]
    word: str
    sentence: str


@dataclass(frozen=True, slots=True)
class _ParameterLine:
    """A parameter in words: what it may be, what is written, what some runs have."""

    name: str
    range: str
    written: str
    values: tuple[tuple[str, bool], ...]
    """Value of each run beside, and whether it is as written."""


@dataclass(frozen=True, slots=True)
class _PointLine:
    """A point in words."""

    number: int
    outcome: str
    glyph: str
    margin: str
    about: str
    method: str
    changed: str
    run: str


def search_page(
    row: SearchRow,
    proposals: Sequence[ProposalRow],
    *,
    baseline: Sequence[ProposalRow] = (),
    traces: Mapping[str, Path] = NO_TRACES,
    commands: Sequence[tuple[str, str]] = (),
) -> str:
    """Return the page of a search as HTML that needs nothing else.

    ``proposals`` are all of its runs. ``baseline`` and ``traces`` are as of
    :func:`daemon.search.page.search_figures`; ``commands`` is what to type next, each with what it
    does.
    """
    task, answer = row.task, row.answer
    explored, steps = drawn_points(task, proposals), drawn_points(task, proposals, "nearest")
    figures = point_figures(row, explored, steps, baseline=baseline, traces=traces)
    compared = _compared_points(answer)
    ordered = sorted(explored, key=lambda p: (math.isnan(p.value), p.value, p.number))
    shown = told_point(answer)
    passing = sum(not point.result.fails for point in explored)
    return render_search_report(
        {"quantity": format_quantity},
        row=row,
        task=task,
        answer=answer,
        headline=search_headline(row),
        facts=_facts(row, proposals),
        # Drawn here, from numbers and escaped names, never taken from a file.
        figures={name: Markup(figures.get(name, "")) for name in _FIGURES},
        pairs={n.axes: Markup(s) for n, s in figures.items() if isinstance(n, PairFigure)},
        compared=compared,
        parameters=_parameter_lines(task, [values for _, values in compared]),
        points=[_point_line(task, point) for point in ordered[:MOST_LISTED]],
        left_out=len(ordered) - MOST_LISTED,
        thinned=passing > MOST_LINES,
        steps=[_point_line(task, point) for point in steps],
        other_baseline=bool(baseline),
        shown=shown,
        commands=commands,
        nothing=NOTHING,
    )


def search_headline(row: SearchRow) -> SearchHeadline:
    """Return the one line that says whether it can fail, and what it takes."""
    answer = row.answer
    if row.state == "failed":
        said = (row.note.strip().splitlines() or ["It could not go on."])[-1]
        return SearchHeadline("open", "Not known", said)
    if answer is not None and answer.nearest is not None:
        sentence = f"Nearest failure: {answer.nearest.sentence}."
        return SearchHeadline("bad", "It can fail", sentence)
    if answer is not None and answer.first is not None:
        runs = count_noun(answer.explored, "run")
        return SearchHeadline("bad", "It can fail", f"{answer.failed} of {runs} do.")
    if answer is None or answer.best is None or answer.best.value is None:
        return SearchHeadline("open", "Not known", "No run has a margin.")
    margin = format_quantity(answer.best.value.margin, answer.best.value.unit)
    sentence = f"{count_noun(answer.explored, 'run')}, nothing below {margin}."
    word = "Nothing fails so far" if row.state == "running" else "Nothing fails"
    return SearchHeadline("good", word, sentence)


def _facts(row: SearchRow, proposals: Sequence[ProposalRow]) -> tuple[tuple[str, str], ...]:
    task, answer = row.task, row.answer
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
    reused = sum(bool(one.run.cached) for one in proposals)
    if reused:
        runs += f", {reused} of them there already"
    simulated = sum(one.run.simulated for one in proposals)
    results = (one.run.result for one in proposals if not one.run.cached)
    cpu = sum(result.timing.cpu for result in results if result is not None)
    state = row.state if answer is None or not answer.ended else ending_words(task, answer.ended)
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
        ("state", state),
        ("search", row.campaign),
        ("page written by", own_version()),
    )
    return tuple((name, value) for name, value in facts if value)


def _compared_points(answer: SearchAnswer | None) -> tuple[tuple[str, Point], ...]:
    """Return the points whose values stand beside those written, by what they are."""
    if answer is None:
        return ()
    nearest = answer.nearest.result if answer.nearest is not None else None
    named = (
        ("nearest failure", nearest),
        ("smallest margin", answer.best),
        ("first failure", answer.first),
    )
    return tuple((name, point.values) for name, point in named if point is not None)


def _parameter_lines(task: SearchTask, compared: Sequence[Point]) -> list[_ParameterLine]:
    return [
        _ParameterLine(
            parameter.name,
            range_text(parameter, parameter.shown),
            _value_text(parameter, parameter.written),
            tuple(
                (_value_text(parameter, values[i]), is_as_written(parameter, values[i]))
                for values in compared
            ),
        )
        for i, parameter in enumerate(task.parameters)
    ]


def _value_text(parameter: SearchParameter, value: PointValue | None) -> str:
    return NOTHING if value is None else parameter.shown(value)


def _point_line(task: SearchTask, point: DrawnPoint) -> _PointLine:
    result = point.result
    value, outcome = result.value, str(result.outcome or "error")
    return _PointLine(
        number=point.number,
        outcome=outcome,
        glyph=GLYPHS.get(outcome, "?"),
        margin=NOTHING if value is None else format_quantity(value.margin, value.unit, signed=True),
        about=" ".join(filter(None, (value.oracle, value.object))) if value else "",
        method=point.method,
        changed=point_words(task, result, len(task.parameters)),
        run=result.run,
    )
