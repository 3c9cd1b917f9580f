"""The end of a campaign on standard output: cells, surprises, what could not be decided."""

from __future__ import annotations

from typing import Final

from rich.console import Console
from rich.text import Text

from daemon.statistics import at_least
from scenario_tui.cli._matrix import comparison_table, matrix
from scenario_tui.cli._output import out
from scenario_tui.judged import BOUNDS, Footnotes, listed
from scenario_tui.summary import Results
from scenario_tui.wording import (
    STYLES,
    counted,
    fine_duration,
)

LISTED: Final = 12


def print_summary(results: Results, *, took: float | None = None) -> None:
    """Print the matrix of cells, the comparisons, and what is not as expected."""
    console, notes, judged = out(), Footnotes(), results.assessment
    console.print(_headline(results, took))
    console.print()
    console.print(matrix(results, notes))
    if judged.comparisons:
        console.print()
        console.print(comparison_table(judged.comparisons, notes))
        console.print(BOUNDS, style="dim", markup=False)
    for line in notes.lines():
        console.print(line)
    console.print()
    for title, lines in listed(results, STYLES):
        _print_list(console, title, lines)
    console.print(_conclusion(results), markup=False)
    console.print()


def _headline(results: Results, took: float | None) -> Text:
    row = results.row
    text = Text.assemble((row.name, "bold"))
    if row.about:
        text.append(f"  {row.about}", style="dim")
    text.append(f"\n{counted(row.total, 'run')}")
    if row.cached:
        text.append(f", {row.cached:,} cached")
    if took is not None:
        text.append(f" in {fine_duration(took)}")
    return text


def _print_list(console: Console, title: str, lines: list[Text]) -> None:
    console.print(Text(f"{len(lines):,} {title}:", style="bold"))
    for line in lines[:LISTED]:
        console.print(line, soft_wrap=True)
    if len(lines) > LISTED:
        console.print(f"and {len(lines) - LISTED} more")
    console.print()


def _conclusion(results: Results) -> str:
    """Return the last word: whether all is as expected, and how little that shows."""
    code = results.assessment.exit_code
    said = {
        0: "everything is as expected",
        1: "not as expected",
        3: "some runs could not be executed or judged",
    }.get(code, "not everything is decided")
    n = results.declared.policy.n
    if code == 0 and results.declared.policy.rule == "all":
        said += f"; {n} of {n} shows a pass rate of at least {100 * at_least(n, n):.1f} %"
    return said


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
