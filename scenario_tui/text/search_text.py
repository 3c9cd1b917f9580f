"""A search in words: how far it is, what it found, what decides; for command line and dashboard."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from rich.text import Text

from grammars.text.words import count_noun
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    NOTHING,
    Styles,
    glyph_word,
    margin,
    margin_bar,
    moment_text,
    quiet_style,
)

if TYPE_CHECKING:
    from daemon.model.proposals import ObjectiveValue, Phase, Proposal, ProposalRow
    from daemon.model.search import PointValue, SearchParameter, SearchTask
    from daemon.model.search_answer import Finding, SearchAnswer, SearchRow

BLOCKS: Final = "▁▂▃▄▅▆▇█"
"""Signs of a sparkline, the lowest first."""
_HALF: Final = 8
"""Cells on either side of a bar of influence."""
_PHASES: Final[dict[Phase, str]] = {
    "explore": "looking for failures",
    "confirm": "repeating a failure with other noise",
    "nearest": "looking for the nearest failure",
    "shrink": "taking away what the failure does not need",
}
_ENDINGS: Final = {
    "budget": "the budget is spent",
    "time": "the time is up",
    "failures": "enough failures were found",
    "settled": "nothing got better for a while",
    "exhausted": "every point of its space was run",
    "errors": "five runs in a row could not be judged",
    "cancelled": "it was cancelled",
}
"""Why a search ended."""
_STATES: Final = {"cancelled": "cancelled", "failed": "error"}
"""Words of searches that did not come to their end."""


@dataclass(frozen=True, slots=True)
class SearchTally:
    """What the runs of a search come to so far; ``best`` are the smallest values after each.

    ``failed`` counts the runs of points that were looked for, not those that repeat or refine one.
    ``explored`` are those with a result.
    """

    explored: int
    failed: int
    first: ProposalRow | None
    best: tuple[ObjectiveValue, ...]

    @property
    def smallest(self) -> ObjectiveValue | None:
        """The best value so far."""
        return self.best[-1] if self.best else None


def tally_search(task: SearchTask, rows: Iterable[ProposalRow]) -> SearchTally:
    """Return what the runs of a search, in order, come to so far."""
    from daemon.model.proposals import objective

    explored = failed = 0
    first: ProposalRow | None = None
    best: list[ObjectiveValue] = []
    for row in rows:
        if row.proposal.phase != "explore" or not row.run.settled:
            continue
        explored += 1
        if row_fails(task, row):
            failed += 1
            first = first or row
        found = objective(task, row.run.leads)
        if found is not None and (not best or found.value < best[-1].value):
            best.append(found)
        elif best:
            best.append(best[-1])
    return SearchTally(explored, failed, first, tuple(best))


def row_fails(task: SearchTask, row: ProposalRow) -> bool:
    """Whether an oracle that the search is about fails in a run."""
    about = {scale.oracle for scale in task.scales}
    return any(one.oracle in about and one.outcome == "fail" for one in row.run.verdicts)


def sparkline(values: Sequence[float], width: int = 24) -> str:
    """Return values as a line of blocks, at most ``width`` long; nought is always in its range.

    Where there are more values than cells, a cell shows the smallest of its values. What is no
    finite number is left out.
    """
    shown = [value for value in values if math.isfinite(value)]
    if len(shown) > width:
        edges = [len(shown) * cell // width for cell in range(width + 1)]
        shown = [min(shown[a:b]) for a, b in pairwise(edges)]
    low, high = min([*shown, 0.0]), max([*shown, 0.0])
    if high == low:
        return BLOCKS[0] * len(shown)
    top = len(BLOCKS) - 1
    return "".join(BLOCKS[round(top * (value - low) / (high - low))] for value in shown)


def value_text(parameter: SearchParameter, value: PointValue | None) -> str:
    """Return a value of a parameter for people; ``–`` for none."""
    return NOTHING if value is None else parameter.shown(value)


def parameter_table(
    task: SearchTask, values: Sequence[PointValue]
) -> tuple[tuple[str, str, str, bool], ...]:
    """Return name, written value, value, and whether it differs, of each parameter of a point."""
    return tuple(
        (
            one.name,
            value_text(one, one.written),
            value_text(one, value),
            value_text(one, one.written) != value_text(one, value),
        )
        for one, value in zip(task.parameters, values, strict=False)
    )


def share_in_range(parameter: SearchParameter, value: PointValue | None) -> float | None:
    """Return where in its range [0, 1] a value lies, at an end what lies outside; ``None`` where
    there is no such place.
    """
    from daemon.search.points import position_in_range

    at = position_in_range(parameter, value)
    return None if math.isnan(at) else min(1.0, max(0.0, at))


def proposal_lines(
    task: SearchTask, proposal: Proposal, styles: Styles = DASHBOARD_STYLES
) -> list[Text]:
    """Return what a run of a search was for, and its values, those not as written first."""
    purpose = _PHASES[proposal.phase]
    if proposal.phase == "explore":
        purpose += f" ({proposal.method})"
    if proposal.note:
        purpose += f": {proposal.note}"
    about = f"point {proposal.number} of the search {task.name}, {purpose}"
    lines = [Text(about, style=quiet_style(styles))]
    rows = sorted(parameter_table(task, proposal.values), key=lambda row: not row[3])
    width = max((len(row[0]) for row in rows), default=0)
    for name, written, value, differs in rows:
        line = Text(f"  {name:<{width}}  {value}", style="" if differs else quiet_style(styles))
        if differs:
            line.append(f"  instead of {written}", style=quiet_style(styles))
        lines.append(line)
    return lines


def search_word(row: SearchRow) -> str:
    """Return the one word for how a search stands: ``fail`` when there is a failure."""
    if row.state == "failed":
        return "error"
    answer = row.answer
    if answer is not None and (answer.first is not None or answer.failed):
        return "fail"
    if row.state == "running":
        return "running"
    if row.state == "cancelled":
        return "cancelled"
    if answer is None or answer.ended == "errors":
        return "error"
    return "pass" if answer.best is not None else "inconclusive"


def phase_text(row: SearchRow) -> str:
    """Return what a search is doing, or why it does nothing any more."""
    if row.state == "failed":
        return "it could not go on"
    if row.state == "cancelled":
        return _ENDINGS["cancelled"]
    if row.state == "finished":
        return _ENDINGS.get(row.answer.ended, "ended") if row.answer is not None else "ended"
    return _PHASES[row.phase]


def best_text(value: ObjectiveValue | None) -> str:
    """Return the smallest margin so far, nothing while there is none."""
    return "" if value is None else f"smallest margin {margin(value.margin, value.unit)}"


def search_line(row: SearchRow) -> str:
    """Return how a search stands in one line: ``doors: looking for failures, 23 of 60 runs``."""
    parts = [phase_text(row)]
    answer, exploring = row.answer, row.state == "running" and row.phase == "explore"
    if exploring:
        parts.append(f"{row.finished:,} of {count_noun(row.task.runs, 'run')}")
    else:
        parts.append(count_noun(row.finished, "run"))
    if answer is not None:
        yet = " yet" if row.state == "running" and not answer.failed else ""
        parts.append(f"{failures_text(answer.failed)}{yet}")
        parts.append(best_text(answer.best.value if answer.best else None))
    # While it explores the note has the same numbers, as they were when it was written.
    if row.note and not exploring:
        parts.append(row.note.strip().splitlines()[-1])
    return f"{row.task.name}: {', '.join(filter(None, parts))}"


def failures_text(count: int) -> str:
    """Return ``3 failures``, or that there is none."""
    return count_noun(count, "failure") if count else "no failure"


def headline(row: SearchRow, styles: Styles = DASHBOARD_STYLES) -> Text:
    """Return what was searched, and what came of it in a word."""
    task, word = row.task, search_word(row)
    text = Text.assemble((task.name, "bold"), "  ")
    # Of one oracle that does not fail: others, which it was not about, may.
    passed = "nothing fails" if len(task.scales) > 1 else f"{task.minimise} does not fail"
    said = {"fail": "it can fail", "pass": passed, "running": "running"}.get(word, word)
    text.append(glyph_word(word).replace(word, said), style=styles[word])
    if task.about:
        text.append(f"  {task.about}", style=quiet_style(styles))
    what = f"any of {len(task.scales)} oracles" if len(task.scales) > 1 else task.minimise
    counts = f"{count_noun(len(task.parameters), 'parameter')} of {task.scenario} ({task.sut})"
    text.append(f"\n{what} over {counts}, method {task.method}, seed {task.seed}")
    return text


def answer_lines(row: SearchRow, styles: Styles = DASHBOARD_STYLES) -> list[Text]:
    """Return a search and its answer, the sentences first, then findings and influence."""
    found = row.answer
    lines = list(headline(row, styles).split("\n"))
    if row.note:
        style = styles[_STATES.get(row.state, "inconclusive")]
        lines.extend(Text(line, style=style) for line in row.note.strip().splitlines())
    if found is None:
        lines.append(Text(search_line(row)))
        return lines
    lines.append(Text(_runs_text(row, found), style=quiet_style(styles)))
    lines.append(Text())
    lines.extend(Text(f"- {sentence}") for sentence in found.sentences)
    changes = nearest_lines(row.task, found, styles)
    for title, block in (
        # One change is told in a sentence.
        ("the nearest failure", changes if len(changes) > 1 else []),
        ("findings", finding_lines(found.findings, styles)),
        (_influence_title(found), influence_lines(row.task, found, styles)),
    ):
        if block:
            lines.extend((Text(), Text(f"{title}:", style="bold"), *block))
    return lines


def _runs_text(row: SearchRow, answer: SearchAnswer) -> str:
    words = count_noun(row.finished, "run")
    if answer.reused:
        verb = "was" if answer.reused == 1 else "were"
        words += f", {answer.reused:,} of them {verb} there already"
    # Why it ended is the last of the sentences.
    told = answer.sentences and answer.ended and row.state != "failed"
    return words if told else f"{words}; {phase_text(row)}"


def nearest_lines(
    task: SearchTask, answer: SearchAnswer, styles: Styles = DASHBOARD_STYLES
) -> list[Text]:
    """Return what is not as written in the nearest failure, a parameter a line."""
    if answer.nearest is None or not answer.nearest.changes:
        return []
    named = {one.name: one for one in task.parameters}
    rows = [
        (
            task.short_name(change.parameter),
            value_text(named[change.parameter], change.written),
            value_text(named[change.parameter], change.value),
            "" if change.passing is None else named[change.parameter].shown(change.passing),
        )
        for change in answer.nearest.changes
        if change.parameter in named
    ]
    widths = [max((len(row[column]) for row in rows), default=0) for column in range(3)]
    lines = []
    for name, written, value, passing in rows:
        line = Text(f"  {name:<{widths[0]}}  ")
        line.append(f"{written:>{widths[1]}} → ", style=quiet_style(styles))
        line.append(f"{value:<{widths[2]}}", style=styles["fail"])
        if passing:
            line.append(f"  passes at {passing}", style=quiet_style(styles))
        lines.append(line)
    return lines


def finding_lines(findings: Sequence[Finding], styles: Styles = DASHBOARD_STYLES) -> list[Text]:
    """Return failures that are different ones, each with its example."""
    rows = [finding_cells(found) for found in findings]
    widths = [max((len(row[column]) for row in rows), default=0) for column in range(4)]
    lines = []
    for row in rows:
        count, oracle, where, least = (
            cell.ljust(width) for cell, width in zip(row[:4], widths, strict=True)
        )
        line = Text("  ").append(f"{count}  {oracle}", style=styles["fail"])
        line.append(f"  {where}  {least}  ")
        line.append(row[4], style=quiet_style(styles))
        lines.append(line)
    return lines


def finding_cells(found: Finding) -> tuple[str, str, str, str, str]:
    """Return count, oracle, place, smallest margin and the run to look at."""
    where = " ".join(
        filter(
            None,
            (
                found.object if found.object != found.waypoint else "",
                f"on the way to {found.waypoint}" if found.waypoint else "",
                moment_text(found.evidence.time),
            ),
        )
    )
    example = found.example
    value = example.value
    least = margin(value.margin, value.unit) if value is not None else NOTHING
    return f"{found.count:,}x", found.oracle, where, least, example.run


def _influence_title(answer: SearchAnswer) -> str:
    runs = max((one.runs for one in answer.influence), default=0)
    return f"influence on the margin, rank correlation in {count_noun(runs, 'unguided run')}"


def influence_lines(
    task: SearchTask, answer: SearchAnswer, styles: Styles = DASHBOARD_STYLES
) -> list[Text]:
    """Return a bar for each parameter, those that decide most first.

    To the left: larger values bring the failure nearer. What chance gives as well is dim.
    """
    # With numpy: only where there is an answer.
    from daemon.search.answers.findings import is_by_chance

    found = sorted(answer.influence, key=lambda one: (-_weight(one.correlation), one.parameter))
    names = [task.short_name(one.parameter) for one in found]
    width = max(map(len, names), default=0)
    lines = []
    for one, name in zip(found, names, strict=True):
        style = quiet_style(styles) if is_by_chance(task, one) else ""
        number = f"{one.correlation:+.2f}".replace("-", "−")
        bar = margin_bar(one.correlation, _HALF)
        lines.append(Text(f"  {name:<{width}}  {bar}  {number}", style=style))
    return lines


def _weight(correlation: float) -> float:
    return abs(correlation) if math.isfinite(correlation) else 0.0


def search_commands(row: SearchRow) -> tuple[tuple[str, str], ...]:
    """Return what to type next about a search: commands and what they do."""
    if row.state == "running":
        return (
            (f"scenario search {row.campaign}", "watch it"),
            (f"scenario cancel {row.campaign}", "end it, what was found is kept"),
        )
    answer = row.answer
    shown = answer and (answer.nearest.result if answer.nearest else answer.best or answer.first)
    found: list[tuple[str, str]] = []
    if shown and shown.run:
        begin = f" --from {shown.verdict.oracle}" if shown.fails and shown.verdict else ""
        what = "watch the failure" if shown.fails else "watch the run nearest to failing"
        found.append((f"scenario replay {shown.run}{begin}", what))
        found.append((f"scenario show {shown.run}", "what each oracle says"))
    found.append((f"scenario results {row.campaign} --runs", "every run of the search"))
    return tuple(found)
