"""The results of a campaign: as a table with what is not as expected, as JSON, and read back."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.table import Table
from rich.text import Text

from daemon.judging.assessment import CampaignDifference, JudgedCampaign
from daemon.judging.statistics import at_least, cut_percentage
from daemon.model.assessments import Assessment, AssessmentRules, ComparisonVerdict
from daemon.model.status import CampaignRow, RunRow
from grammars.text import codec
from grammars.text.diagnostics import Finding, InputError, Where
from grammars.text.words import NOTHING, count_noun
from scenario_tui.cli.answer import schema_identifier
from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.output import Output, plain_table, stdout_console
from scenario_tui.text.assessment_text import (
    BOUNDS,
    Footnotes,
    attention_lists,
    comparison_cell_text,
    matrix_rows,
    repeatability_text,
)
from scenario_tui.text.formatting import NOT_REPEATABLE, TERMINAL_STYLES, fine_duration, quiet_style
from scenario_tui.text.results import CampaignResults, conclude
from scenario_tui.text.run_state import progress_text, unfinished_text


class ResultsOutput(Output, schema="results"):
    """Everything about a campaign, with what it was held against."""

    campaign: CampaignRow
    declared: AssessmentRules
    assessment: Assessment
    runs: tuple[RunRow, ...]
    comparison: CampaignDifference | None


def emit_results(results: CampaignResults, comparison: CampaignDifference | None = None) -> None:
    """Write everything about a campaign as JSON."""
    ResultsOutput(
        results.row,
        results.declared,
        results.assessment,
        results.rows,
        comparison,
    ).emit()


def read_results(path: Path) -> JudgedCampaign:
    """Read what ``--json`` wrote; raises :class:`InputError` for anything else."""
    where = Where(str(path))
    try:
        body = json.loads(path.read_text(encoding="utf-8"))
        if body["schema"] != schema_identifier(ResultsOutput.schema):
            raise ValueError(f"it holds {body['schema']}")
        declared = codec.from_plain(AssessmentRules, body["declared"])
        runs = codec.from_plain(tuple[RunRow, ...], body["runs"])
        return JudgedCampaign(str(body["campaign"]["id"]), declared, runs)
    except OSError as error:
        message = f"cannot be read: {error.strerror}"
        raise InputError(Finding(where, message)) from error
    except (ValueError, KeyError, TypeError) as error:
        hint = "write one with: scenario results CAMPAIGN --json"
        raise InputError(Finding(where, "is no file of results", hint)) from error


def matrix_table(results: CampaignResults, notes: Footnotes) -> Table:
    """Return one row for each scenario and one column for each system under test."""
    suts, rows = matrix_rows(results, notes, TERMINAL_STYLES)
    marked = (f"{s} ({NOT_REPEATABLE})" if s in results.not_repeatable else s for s in suts)
    table = plain_table("scenario", *marked)
    for scenario, cells in rows:
        table.add_row(scenario, *cells)
    return table


def comparison_table(cells: Sequence[ComparisonVerdict], notes: Footnotes) -> Table:
    """Return one row for each comparison and one column for each system under test."""
    found = {(cell.comparison, cell.sut): cell for cell in cells}
    suts = tuple(dict.fromkeys(cell.sut for cell in cells))
    table = plain_table("comparison", *suts, "is to be")
    for name, text in {cell.comparison: cell.text for cell in cells}.items():
        row = (found.get((name, sut)) for sut in suts)
        shown = (cell and comparison_cell_text(cell, notes, TERMINAL_STYLES) for cell in row)
        table.add_row(
            name, *(one or NOTHING for one in shown), Text(text, style=quiet_style(TERMINAL_STYLES))
        )
    return table


LISTED: Final = 12


def print_summary(results: CampaignResults, *, took: float | None = None) -> None:
    """Print the matrix of cells, the comparisons, and what is not as expected."""
    console, notes, judged = stdout_console(), Footnotes(), results.assessment
    console.print(_headline(results, took))
    console.print()
    console.print(matrix_table(results, notes))
    if judged.comparisons:
        console.print()
        console.print(comparison_table(judged.comparisons, notes))
        console.print(BOUNDS, style="dim", markup=False)
    for line in notes.lines():
        console.print(line)
    if said := repeatability_text(results):
        console.print(said, style="dim", markup=False, soft_wrap=True)
    console.print()
    for title, lines in attention_lists(results, TERMINAL_STYLES):
        _print_list(console, title, lines)
    console.print(_conclusion_line(results), markup=False)
    console.print()


def _headline(results: CampaignResults, took: float | None) -> Text:
    row = results.row
    text = Text.assemble((row.name, "bold"))
    if row.about:
        text.append(f"  {row.about}", style="dim")
    text.append(f"\n{progress_text(row)}")
    if row.cached:
        text.append(f", {row.cached:,} cached")
    if took is not None:
        text.append(f" in {fine_duration(took)}")
    return text


def _print_list(console: Console, title: str, lines: list[Text]) -> None:
    console.print(Text(f"{title}:", style="bold"))
    for line in lines[:LISTED]:
        console.print(line, soft_wrap=True)
    if len(lines) > LISTED:
        console.print(f"and {len(lines) - LISTED} more")
    console.print()


def _conclusion_line(results: CampaignResults) -> str:
    """Return the last word: whether all is as expected, and how little that shows."""
    code, row = results.assessment.exit_code, results.row
    said = {
        ExitCode.EXPECTED: "everything is as expected",
        ExitCode.UNEXPECTED: "not as expected",
        ExitCode.INFRASTRUCTURE: "some runs could not be executed or judged",
    }.get(ExitCode(code), "not everything is decided")
    if code == ExitCode.INCONCLUSIVE and row.cancelled:
        said = f"not everything is decided: {count_noun(row.cancelled, 'run')} cancelled"
    if not row.finished:
        standing = conclude(results.assessment, finished=False).text
        if code == ExitCode.UNEXPECTED:
            standing = "not as expected already"
        return f"{standing}; {unfinished_text(row)}"
    # n passes of n are no pass rate of 100 %: what they show at least is the lower bound of Clopper
    # and Pearson.
    # More than the policy says where no system of the campaign is repeatable and nobody said how
    # often it is run.
    cells = results.assessment.cells
    n = max(results.declared.policy.n, min((len(cell.runs) for cell in cells), default=0))
    if code == ExitCode.EXPECTED and results.declared.policy.rule == "all":
        said += f"; {n} of {n} shows a pass rate of at least {cut_percentage(at_least(n, n))}"
    return said


def print_commands(*commands: tuple[str, str]) -> None:
    """Print what to type next: ``(command, what it does)`` pairs, the purpose where it fits."""
    console = stdout_console()
    width = max(len(command) for command, _ in commands)
    roomy = all(width + len(purpose) + 4 <= console.width for _, purpose in commands)
    for command, purpose in commands:
        line = Text.assemble("  ", (command, "bold cyan"))
        if roomy:
            line.append(f"{'':{width - len(command)}}  {purpose}", style="dim")
        console.print(line, soft_wrap=True)
