"""A search on a terminal: its progress, its answer, the deciding parameters."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from rich.text import Text

from daemon.search.answers import sentences
from daemon.search.points import is_as_written, position_in_range
from grammars.text.words import NOTHING, command_line, count_noun
from scenario_tui.text.formatting import keep_end, keep_start, margin, margin_bar, moment_text
from scenario_tui.text.styles import CHANGED, GLYPHS, QUIET

if TYPE_CHECKING:
    from collections.abc import Callable

    from daemon.model.search import Point, PointValue, Proposal, SearchParameter, SearchTask
    from daemon.model.search_answer import SearchAnswer, SearchRow

_RANGE, _LEAST_NAME = 11, 12
"""Cells of the range of a parameter, and least cells of its name."""
_LEGEND: Final = "│ as written  ● in this run  ≠ not as written"
_HALF: Final = 8
"""Cells on either side of a bar of influence."""
GAZEBO_KINDS: Final = ("map", "sdf", "keyframes", "tasks", "launch")
"""Artefacts of a world in Gazebo: its map, models, doors that move, waypoints, launch files."""
_STATES: Final = {"cancelled": "cancelled", "failed": "error"}
"""Words for searches that ended early."""


def proposal_text(task: SearchTask, proposal: Proposal, width: int) -> Text:
    """Return the purpose of a run of a search, and the values of its point."""
    purpose = sentences.PHASES[proposal.phase]
    if proposal.phase == "explore":
        purpose += f" ({proposal.method})"
    if proposal.note:
        purpose += f": {proposal.note}"
    about = f"point {proposal.number} of the search {task.name}, {purpose}\n"
    parameters = parameters_text(task, proposal.values, width)
    return Text.assemble((about, QUIET), parameters)


def range_bar(parameter: SearchParameter, value: PointValue) -> str:
    """Return the range as a line, with ``│`` at the written value and ``●`` at ``value``.

    A value outside of the range is ``<`` or ``>`` at that end; one without a place is left out.
    """
    line = ["─"] * _RANGE
    for place_of, sign in ((parameter.written, "│"), (value, "●")):
        share = position_in_range(parameter, place_of)
        if not math.isnan(share):
            place = round(min(1.0, max(0.0, share)) * (_RANGE - 1))
            line[place] = "<" if share < 0.0 else ">" if share > 1.0 else sign
    return "".join(line)


def parameters_text(task: SearchTask, values: Point, width: int) -> Text:
    """Return a line for each parameter, at most ``width`` cells; changed ones stand out."""
    pairs = list(zip(task.parameters, values, strict=True))
    names = [task.short_name(one.name) for one, _ in pairs]
    amounts = [_change_text(one, value) for one, value in pairs]
    room = width - _RANGE - 4
    name_cells = min(max(map(len, names)), max(_LEAST_NAME, room - max(map(len, amounts))))
    cells = min(max(map(len, amounts)), room - name_cells)
    text = Text(no_wrap=True, overflow="ellipsis")
    for name, amount, (one, value) in zip(names, amounts, pairs, strict=True):
        changed = not is_as_written(one, value)
        text.append("≠ " if changed else "  ", style="inconclusive")
        text.append(keep_end(name, name_cells), style="bold" if changed else QUIET)
        amount = keep_start(amount, cells)
        text.append(f" {amount:>{cells}} ", style=CHANGED if changed else "")
        text.append(f"{range_bar(one, value)}\n", style="" if changed else QUIET)
    text.append(_LEGEND if width >= len(_LEGEND) else "│ written  ● here", style=QUIET)
    return text


def _change_text(parameter: SearchParameter, value: PointValue) -> str:
    """Return ``8 → 8.54 s``; the value alone if it is as written."""
    now, before = parameter.shown(value), NOTHING
    if is_as_written(parameter, value):
        return now
    if parameter.written is not None:
        before = parameter.shown(parameter.written)
    if parameter.unit and isinstance(value, float | int):
        before = before.removesuffix(f" {parameter.unit}")
    return f"{before} → {now}"


def search_line(row: SearchRow) -> str:
    """Return the state of a search in a line: ``doors: looking for failures, 23 of 60 runs``."""
    return f"{row.task.name}: {search_state(row)}"


def search_state(row: SearchRow) -> str:
    """Return the state of a search, without its name."""
    parts = [sentences.phase_words(row)]
    if row.state == "waiting":
        parts = [f"waiting for `{command_line('search', row.file, row.campaign)}`"]
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
    # During exploration the note has older values of the same numbers.
    if row.note and not exploring:
        parts.append(row.note.strip().splitlines()[-1])
    return ", ".join(parts)


def headline_text(row: SearchRow) -> Text:
    """Return the headline of a search, and below it the question that it answers."""
    task, word = row.task, sentences.search_word(row)
    text = Text.assemble((task.name, "bold"), "  ")
    text.append(f"{GLYPHS[word]} {sentences.headline(row)}", style=word)
    if task.about:
        text.append(f"\n{task.about}", style=QUIET)
    what = f"any of {len(task.scales)} oracles" if len(task.scales) > 1 else task.minimise
    counts = f"{count_noun(len(task.parameters), 'parameter')} of {task.scenario} ({task.sut})"
    text.append(f"\n{what} over {counts}, method {task.method}, seed {task.seed}")
    return text


def answer_lines(row: SearchRow) -> list[Text]:
    """Return a search and its answer, the sentences first, then findings and influence."""
    answer = row.answer
    lines = list(headline_text(row).split("\n"))
    notes = row.note.strip().splitlines()
    # The last line of a failed search is in the headline.
    style = _STATES.get(row.state, "inconclusive")
    lines.extend(Text(note, style=style) for note in notes[: -1 if row.state == "failed" else None])
    if answer is None:
        lines.append(Text(search_line(row)))
        return lines
    lines.append(Text(_runs_text(row, answer), style=QUIET))
    if answer.sentences[1:]:
        lines.append(Text())
    lines.extend(Text(f"- {sentence}") for sentence in answer.sentences[1:])
    for title, block in (
        ("findings", finding_lines(answer)),
        (_influence_title(answer), influence_lines(row.task, answer)),
    ):
        if block:
            lines.extend((Text(), Text(f"{title}:", style="bold"), *block))
    return lines


def _runs_text(row: SearchRow, answer: SearchAnswer) -> str:
    words = count_noun(row.finished, "run")
    if answer.reused:
        verb = "was" if answer.reused == 1 else "were"
        words += f", {answer.reused:,} of them {verb} recorded before"
    # The last sentence of an answer gives the reason of its end.
    has_ending = answer.sentences and answer.ended and row.state != "failed"
    return words if has_ending else f"{words}; {sentences.phase_words(row)}"


def finding_lines(answer: SearchAnswer) -> list[Text]:
    """Return a line for each distinct failure, with its example."""
    words = [sentences.finding_words(finding) for finding in answer.findings]
    width = max(map(len, words), default=0)
    lines = []
    for finding, text in zip(answer.findings, words, strict=True):
        example = finding.example
        parts = [sentences.margin_words(example)]
        if example.verdict is not None:
            parts.append(moment_text(example.verdict.evidence.time))
        line = Text(f"  {text:<{width}}", style="fail")
        line.append(f"  {' '.join(filter(None, parts))}  ", style="default")
        line.append(example.run, style=QUIET)
        lines.append(line)
    return lines


def _influence_title(answer: SearchAnswer) -> str:
    runs = max((one.runs for one in answer.influence), default=0)
    return f"influence on the margin, rank correlation in {count_noun(runs, 'unguided run')}"


def influence_lines(task: SearchTask, answer: SearchAnswer) -> list[Text]:
    """Return a bar for each parameter, the most influential first.

    A bar to the left means that larger values bring the failure nearer. Influence that may be
    chance is dim.
    """
    ordered = sorted(answer.influence, key=lambda one: (-abs(one.correlation), one.parameter))
    names = [task.short_name(one.parameter) for one in ordered]
    width = max(map(len, names), default=0)
    lines = []
    for one, name in zip(ordered, names, strict=True):
        style = QUIET if sentences.is_by_chance(task, one) else ""
        number = sentences.minus(f"{one.correlation:+.2f}")
        bar = margin_bar(one.correlation, _HALF)
        lines.append(Text(f"  {name:<{width}}  {bar}  {number}", style=style))
    return lines


def search_commands(
    row: SearchRow, failure_file: str = "", command: Callable[..., str] = command_line
) -> tuple[tuple[str, str], ...]:
    """Return the next commands for a search, each with its purpose.

    ``failure_file`` is the campaign file of its failure, if that is here. ``command`` joins words
    to a line for the daemon of the search.
    """
    if not row.ended:
        watch = (command("search", row.campaign), "watch it")
        resume = (command("search", row.file, row.campaign), "continue it")
        end = (command("cancel", row.campaign), "end it, its findings are kept")
        return (watch if row.state == "running" else resume, end)
    decisive = row.answer.shown if row.answer is not None else None
    commands: list[tuple[str, str]] = []
    if decisive is not None and decisive.run:
        begin = ("--from", decisive.verdict.oracle) if decisive.fails and decisive.verdict else ()
        purpose = "watch the failure" if decisive.fails else "watch the run nearest to failing"
        commands.append((command("replay", decisive.run, *begin), purpose))
        commands.append((command("show", decisive.run), "the verdict of each oracle"))
    if decisive is not None and failure_file:
        cell = decisive.label.split("/")[:2]
        export = command_line("export", failure_file, *GAZEBO_KINDS, "-o", "gazebo")
        commands += [
            (command_line("run", failure_file), "run the failure on its own"),
            (command_line("blame", failure_file, *cell), "the smallest part that still fails"),
            (export, "its world for Gazebo"),
        ]
    commands.append((command("report", row.campaign), "a page with figures"))
    commands.append((command("results", row.campaign, "--runs"), "every run of the search"))
    return tuple(commands)
