"""A search on a terminal: how far it is, its answer, what decides."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from rich.text import Text

from daemon.search.answers.sentences import (
    PHASES,
    finding_words,
    headline,
    is_by_chance,
    margin_words,
    minus,
    phase_words,
    search_word,
)
from daemon.search.points import is_as_written, position_in_range
from grammars.text.words import NOTHING, command_line, count_noun
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    GLYPHS,
    Styles,
    keep_end,
    keep_start,
    margin,
    margin_bar,
    moment_text,
    quiet_style,
)

if TYPE_CHECKING:
    from daemon.model.proposals import Proposal
    from daemon.model.search import Point, PointValue, SearchParameter, SearchTask
    from daemon.model.search_answer import SearchAnswer, SearchRow

BLOCKS: Final = "▁▂▃▄▅▆▇█"
"""Signs of a sparkline, the lowest first."""
_RANGE, _LEAST_NAME = 11, 12
"""Cells of the range of a parameter, and of its name at least."""
_INFLUENCE: Final = 7
_LEGEND: Final = "│ as written  ● in this run  ≠ not as written"
_HALF: Final = 8
"""Cells on either side of a bar of influence."""
_STATES: Final = {"cancelled": "cancelled", "failed": "error"}
"""Words of searches that did not come to their end."""


def sparkline(values: Sequence[float], width: int = 24) -> str:
    """Return values as a line of blocks, at most ``width`` long; nought is always in its range.

    Where there are more values than cells, a cell shows the smallest of its values. What is no
    finite number is left out.
    """
    cells = [value for value in values if math.isfinite(value)]
    if len(cells) > width:
        edges = [len(cells) * cell // width for cell in range(width + 1)]
        cells = [min(cells[a:b]) for a, b in pairwise(edges)]
    low, high = min([*cells, 0.0]), max([*cells, 0.0])
    if high == low:
        return BLOCKS[0] * len(cells)
    top = len(BLOCKS) - 1
    return "".join(BLOCKS[round(top * (value - low) / (high - low))] for value in cells)


def proposal_text(
    task: SearchTask, proposal: Proposal, width: int, styles: Styles = DASHBOARD_STYLES
) -> Text:
    """Return what a run of a search was for, and the values of its point."""
    purpose = PHASES[proposal.phase]
    if proposal.phase == "explore":
        purpose += f" ({proposal.method})"
    if proposal.note:
        purpose += f": {proposal.note}"
    about = f"point {proposal.number} of the search {task.name}, {purpose}\n"
    parameters = parameters_text(task, proposal.values, width, styles=styles)
    return Text(about, style=quiet_style(styles)).append(parameters)


def range_bar(parameter: SearchParameter, value: PointValue, cells: int = _RANGE) -> str:
    """Return the range as a line, with ``│`` where the written value lies and ``●`` at ``value``.

    A value outside of the range is ``<`` or ``>`` at that end; one that has no place is left out.
    """
    line = ["─"] * cells
    for place_of, sign in ((parameter.written, "│"), (value, "●")):
        share = position_in_range(parameter, place_of)
        if not math.isnan(share):
            place = round(min(1.0, max(0.0, share)) * (cells - 1))
            line[place] = "<" if share < 0.0 else ">" if share > 1.0 else sign
    return "".join(line)


def parameters_text(
    task: SearchTask,
    values: Point,
    width: int,
    influence: Mapping[str, float] | None = None,
    styles: Styles = DASHBOARD_STYLES,
) -> Text:
    """Return a line for each parameter, at most ``width`` cells; those not as written stand out.

    ``influence`` are correlations with the margin, shown where there is room for them.
    """
    unsure, quiet = styles["inconclusive"], quiet_style(styles)
    pairs = list(zip(task.parameters, values, strict=True))
    texts = [
        ("" if is_as_written(one, value) else _written(one, value), one.shown(value))
        for one, value in pairs
    ]
    sizes = [max((len(pair[i]) for pair in texts), default=0) for i in (0, 1)]
    names = [task.short_name(one.name) for one, _ in pairs]
    longest = max(map(len, names), default=0)
    most = max((width - _RANGE - 7 - _LEAST_NAME) // 2, 4)
    sizes[0] = min(sizes[0], most)
    sizes[1] = min(sizes[1], 2 * most - sizes[0])
    rest = width - sum(sizes) - _RANGE - 7
    correlations = influence if influence and rest - longest >= _INFLUENCE else {}
    name_cells = max(min(longest, rest), _LEAST_NAME)
    text = Text(no_wrap=True, overflow="ellipsis")
    for name, (one, value), (written, now) in zip(names, pairs, texts, strict=True):
        changed = not is_as_written(one, value)
        text.append("≠ " if changed else "  ", style=unsure)
        text.append(keep_end(name, name_cells), style="bold" if changed else quiet)
        text.append(f" {keep_start(written, sizes[0]):>{sizes[0]}} ", style=quiet)
        text.append("→ " if changed else "  ", style=quiet)
        text.append(
            f"{keep_start(now, sizes[1]):<{sizes[1]}} ", style=f"bold {unsure}" if changed else ""
        )
        text.append(range_bar(one, value), style="" if changed else quiet)
        if one.name in correlations:
            text.append(f"  {minus(f'{correlations[one.name]:+.2f}')}", style=quiet)
        text.append("\n")
    text.append(_LEGEND if width >= len(_LEGEND) else "│ written  ● here", style=quiet)
    return text


def _written(parameter: SearchParameter, value: PointValue) -> str:
    """Return the written value, without its unit where that of the other one follows."""
    if parameter.written is None:
        return NOTHING
    words = parameter.shown(parameter.written)
    numbers = isinstance(value, float | int) and isinstance(parameter.written, float | int)
    return words.removesuffix(f" {parameter.unit}") if numbers and parameter.unit else words


def resuming_command(row: SearchRow) -> str:
    """Return the command that goes on with a search, in the folder in which it was begun."""
    return command_line("search", row.file, row.campaign)


def search_line(row: SearchRow) -> str:
    """Return how a search stands in one line: ``doors: looking for failures, 23 of 60 runs``."""
    waiting = row.state == "waiting"
    parts = [f"waiting for `{resuming_command(row)}`" if waiting else phase_words(row)]
    answer, exploring = row.answer, not row.ended and row.phase == "explore"
    if exploring:
        parts.append(f"{row.finished:,} of {count_noun(row.task.runs, 'run')}")
    else:
        parts.append(count_noun(row.finished, "run"))
    if answer is not None:
        parts.append(count_noun(answer.failed, "failure") if answer.failed else "no failure")
        if answer.best is not None and answer.best.value is not None:
            value = answer.best.value
            parts.append(f"smallest margin {margin(value.margin, value.unit)}")
    # While it explores the note has the same numbers, as they were when it was written.
    if row.note and not exploring:
        parts.append(row.note.strip().splitlines()[-1])
    return f"{row.task.name}: {', '.join(parts)}"


def headline_text(row: SearchRow, styles: Styles = DASHBOARD_STYLES) -> Text:
    """Return the headline of a search, and below it the question that it answers."""
    task, word = row.task, search_word(row)
    text = Text.assemble((task.name, "bold"), "  ")
    text.append(f"{GLYPHS[word]} {headline(row)}", style=styles[word])
    if task.about:
        text.append(f"\n{task.about}", style=quiet_style(styles))
    what = f"any of {len(task.scales)} oracles" if len(task.scales) > 1 else task.minimise
    counts = f"{count_noun(len(task.parameters), 'parameter')} of {task.scenario} ({task.sut})"
    text.append(f"\n{what} over {counts}, method {task.method}, seed {task.seed}")
    return text


def answer_lines(row: SearchRow, styles: Styles = DASHBOARD_STYLES) -> list[Text]:
    """Return a search and its answer, the sentences first, then findings and influence."""
    answer = row.answer
    lines = list(headline_text(row, styles).split("\n"))
    notes = row.note.strip().splitlines()
    # Of a search that failed, the last line is the headline.
    style = styles[_STATES.get(row.state, "inconclusive")]
    lines.extend(Text(note, style=style) for note in notes[: -1 if row.state == "failed" else None])
    if answer is None:
        lines.append(Text(search_line(row)))
        return lines
    lines.append(Text(_runs_text(row, answer), style=quiet_style(styles)))
    lines.append(Text())
    lines.extend(Text(f"- {sentence}") for sentence in answer.sentences[1:])
    for title, block in (
        ("findings", finding_lines(answer, styles)),
        (_influence_title(answer), influence_lines(row.task, answer, styles)),
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
    has_ending = answer.sentences and answer.ended and row.state != "failed"
    return words if has_ending else f"{words}; {phase_words(row)}"


def finding_lines(answer: SearchAnswer, styles: Styles = DASHBOARD_STYLES) -> list[Text]:
    """Return failures that are different ones, each with its example."""
    words = [finding_words(finding) for finding in answer.findings]
    width = max(map(len, words), default=0)
    lines = []
    for finding, text in zip(answer.findings, words, strict=True):
        example = finding.example
        parts = [margin_words(example)]
        if example.verdict is not None:
            parts.append(moment_text(example.verdict.evidence.time))
        line = Text(f"  {text:<{width}}", style=styles["fail"])
        line.append(f"  {' '.join(filter(None, parts))}  ", style="default")
        line.append(example.run, style=quiet_style(styles))
        lines.append(line)
    return lines


def _influence_title(answer: SearchAnswer) -> str:
    runs = max((one.runs for one in answer.influence), default=0)
    return f"influence on the margin, rank correlation in {count_noun(runs, 'unguided run')}"


def influence_lines(
    task: SearchTask, answer: SearchAnswer, styles: Styles = DASHBOARD_STYLES
) -> list[Text]:
    """Return a bar for each parameter, those that decide most first.

    To the left: larger values bring the failure nearer. What chance gives as well is dim.
    """
    ordered = sorted(answer.influence, key=lambda one: (-abs(one.correlation), one.parameter))
    names = [task.short_name(one.parameter) for one in ordered]
    width = max(map(len, names), default=0)
    lines = []
    for one, name in zip(ordered, names, strict=True):
        style = quiet_style(styles) if is_by_chance(task, one) else ""
        number = minus(f"{one.correlation:+.2f}")
        bar = margin_bar(one.correlation, _HALF)
        lines.append(Text(f"  {name:<{width}}  {bar}  {number}", style=style))
    return lines


def search_commands(row: SearchRow) -> tuple[tuple[str, str], ...]:
    """Return what to type next about a search: commands and what they do."""
    if not row.ended:
        watch = (f"scenario search {row.campaign}", "watch it")
        return (
            watch if row.state == "running" else (resuming_command(row), "go on with it"),
            (f"scenario cancel {row.campaign}", "end it, what was found is kept"),
        )
    shown = row.answer.shown if row.answer is not None else None
    commands: list[tuple[str, str]] = []
    if shown is not None and shown.run:
        begin = f" --from {shown.verdict.oracle}" if shown.fails and shown.verdict else ""
        what = "watch the failure" if shown.fails else "watch the run nearest to failing"
        commands.append((f"scenario replay {shown.run}{begin}", what))
        commands.append((f"scenario show {shown.run}", "what each oracle says"))
    commands.append((f"scenario results {row.campaign} --runs", "every run of the search"))
    return tuple(commands)
