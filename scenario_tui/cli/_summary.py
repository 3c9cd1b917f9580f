"""The end of a campaign on standard output: cells, what went wrong, where the traces lie."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from daemon.protocol import CampaignRow, RunDetail, RunRow
from daemon.verdict import Evidence, Verdict
from scenario_tui.cli._output import out
from scenario_tui.summary import Cell, Report, against, problems
from scenario_tui.wording import (
    GLYPHS,
    NOTHING,
    STYLES,
    counted,
    duration,
    glyph_word,
    margin,
    moment,
    run_label,
    word_of,
)

LISTED_PROBLEMS: Final = 12
_SINGLE_GLYPHS: Final = 20


def print_summary(row: CampaignRow, report: Report, *, took: float | None = None) -> None:
    """Print the table of cells and the runs that did not pass."""
    console = out()
    console.print(_headline(row, took))
    console.print()
    console.print(_table(report))
    console.print()
    print_problems(console, report)


def _headline(row: CampaignRow, took: float | None) -> Text:
    text = Text.assemble((row.name, "bold"))
    if row.about:
        text.append(f"  {row.about}", style="dim")
    text.append(f"\n{counted(row.total, 'run')}")
    if took is not None:
        text.append(f" in {duration(took)}" if took >= 1 else f" in {took:.1f} s")
    return text


def _table(report: Report) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for title in ("scenario", "SUT", "repeats", "verdict", "worst margin", "in repeat"):
        table.add_column(title, overflow="fold")
    for cell in report.cells:
        table.add_row(*_cell(cell, report))
    return table


def _cell(cell: Cell, report: Report) -> tuple[Text | str, ...]:
    worst = cell.worst
    evidence = report.evidence(worst) if worst is not None else Evidence()
    if worst is None or not worst.oracle:
        return cell.scenario, cell.sut, repeats(cell.rows), verdict_counts(cell), NOTHING, ""
    shown = f"{worst.oracle} {margin(worst.margin, worst.unit)}"
    return (
        cell.scenario,
        cell.sut,
        repeats(cell.rows),
        verdict_counts(cell),
        shown,
        str(worst.repeat) + ("" if evidence.time is None else f" at {moment(evidence.time)}"),
    )


def repeats(rows: Sequence[RunRow]) -> Text:
    """Return one glyph for each repeat, or their number when there are many."""
    if len(rows) > _SINGLE_GLYPHS:
        return Text(f"{len(rows):,}")
    text = Text()
    for row in rows:
        text.append(GLYPHS[word_of(row)], style=STYLES[word_of(row)])
    return text


def verdict_counts(cell: Cell) -> Text:
    """Return ``✗ 2 fail, ✓ 3 pass``; a single repeat gets ``✓ pass``."""
    text = Text()
    for word, count in cell.words.items():
        label = glyph_word(word) if len(cell.rows) == 1 else f"{GLYPHS[word]} {count} {word}"
        text.append(", " if text else "")
        text.append(label, style=STYLES[word])
    return text


def print_problems(console: Console, report: Report) -> None:
    """Print every run that did not pass, with the oracles against it, up to a dozen."""
    found = problems(report.rows)
    for row in found[:LISTED_PROBLEMS]:
        word = word_of(row)
        console.print(
            Text.assemble((glyph_word(word), STYLES[word]), "  ", (run_label(row), "bold"))
        )
        for line in _against(row, report.details.get(row.id)):
            console.print(f"    {line}", markup=False)
    hidden = len(found) - LISTED_PROBLEMS
    if hidden > 0:
        console.print(f"and {hidden} more that did not pass")
    if found:
        console.print()


def _against(row: RunRow, detail: RunDetail | None) -> Iterable[str]:
    note = detail.result.note if detail is not None and detail.result is not None else ""
    reason = row.reason.strip().splitlines()[-1:]
    lines = [verdict_line(verdict) for verdict in against(detail)]
    lines.extend(extra for extra in (note, *reason) if extra)
    return lines or [f"{row.oracle} {margin(row.margin, row.unit)}".strip()]


def verdict_line(verdict: Verdict) -> str:
    """Return a verdict and its evidence: ``no-collision: −0.03 m at 512.0 s, door-3``."""
    seen = verdict.evidence
    parts = [f"{verdict.oracle}: {margin(verdict.margin, verdict.unit)}"]
    if seen.time is not None:
        parts.append(f"at {moment(seen.time)}")
    text = " ".join(parts)
    for extra in (seen.object, seen.note):
        if extra:
            text += f", {extra}"
    return text


def print_commands(*commands: tuple[str, str]) -> None:
    """Print what to type next: ``(command, what it does)`` pairs, the purpose where it fits."""
    console = out()
    width = max(len(command) for command, _ in commands)
    roomy = all(width + len(purpose) + 4 <= console.width for _, purpose in commands)
    for command, purpose in commands:
        line = Text.assemble("  ", (command, "bold cyan"))
        if roomy:
            line.append(f"{'':{width - len(command)}}  {purpose}", style="dim")
        console.print(line, soft_wrap=True)
