"""Results of a campaign in one look: matrix, comparisons, surprises, conclusion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from daemon.analysis.results import CampaignResults
from daemon.judging.statistics import at_least, cut_percentage
from grammars.text.words import NOTHING, count_noun, duration_text
from scenario_tui.text.assessment_text import (
    BOUNDS,
    attention_lists,
    cell_text,
    comparison_cell_text,
    known_lines,
    repeatability_text,
)
from scenario_tui.text.formatting import NOT_REPEATABLE, plain_table
from scenario_tui.text.results import conclude
from scenario_tui.text.run_state import progress_text, unfinished_text
from scenario_tui.text.styles import QUIET

_LISTED: Final = 12
"""Most lines of each list of surprises and problems."""


def matrix_table(results: CampaignResults) -> Table:
    """Return one row for each scenario and one column for each system under test."""
    cells = {(cell.scenario, cell.sut): cell for cell in results.assessment.cells}
    suts = tuple(dict.fromkeys(sut for _, sut in cells))
    marked = (f"{s} ({NOT_REPEATABLE})" if s in results.not_repeatable else s for s in suts)
    table = plain_table("scenario", *marked)
    for scenario in dict.fromkeys(scenario for scenario, _ in cells):
        row = (cells.get((scenario, sut)) for sut in suts)
        texts = (cell and cell_text(cell, results, alone=len(suts) == 1) for cell in row)
        table.add_row(scenario, *(text or Text(NOTHING, style=QUIET) for text in texts))
    return table


def comparison_table(results: CampaignResults) -> Table:
    """Return one row for each comparison and one column for each system under test."""
    cells, marks = results.assessment.comparisons, results.expectations
    by_name = {(cell.comparison, cell.sut): cell for cell in cells}
    suts = tuple(dict.fromkeys(cell.sut for cell in cells))
    table = plain_table("comparison", *suts, "should be")
    for name, text in {cell.comparison: cell.text for cell in cells}.items():
        row = (by_name.get((name, sut)) for sut in suts)
        words = (cell and comparison_cell_text(cell, marks.mark_verdict(cell)) for cell in row)
        table.add_row(name, *(one or NOTHING for one in words), Text(text, style=QUIET))
    return table


def summary_parts(
    results: CampaignResults, *, took: float | None = None
) -> Iterator[RenderableType]:
    """Yield the matrix of cells, the comparisons, and the surprises.

    ``took`` is the duration [s]. Print the parts without cropping: some lines are never broken.
    """
    yield _headline(results, took)
    yield ""
    yield matrix_table(results)
    if results.assessment.comparisons:
        yield ""
        yield comparison_table(results)
        yield Text(BOUNDS, style="dim")
    yield from known_lines(results)
    if words := repeatability_text(results):
        yield _unbroken(Text(words, style="dim"))
    yield ""
    for title, lines in attention_lists(results):
        yield Text(f"{title}:", style="bold")
        yield from map(_unbroken, lines[:_LISTED])
        if len(lines) > _LISTED:
            yield f"and {len(lines) - _LISTED} more"
        yield ""
    yield Text(_conclusion_line(results))
    yield ""


def _unbroken(line: Text) -> Text:
    """Return a line that is never broken, because people and scripts look for whole names."""
    line.no_wrap, line.overflow = True, "ignore"
    return line


def _headline(results: CampaignResults, took: float | None) -> Text:
    row = results.row
    text = Text.assemble((row.name, "bold"))
    if row.about:
        text.append(f"  {row.about}", style="dim")
    text.append(f"\n{progress_text(row)}")
    if row.cached:
        text.append(f", {row.cached:,} cached")
    if took is not None:
        text.append(f" in {duration_text(took)}")
    return text


def _conclusion_line(results: CampaignResults) -> str:
    """Return the last line: the agreement with the expectations, and the proven pass rate."""
    code, row = results.assessment.exit_code, results.row
    words = {
        0: "everything is as expected",
        1: "not as expected",
        3: "some runs could not be executed or judged",
    }.get(code, "not everything is decided")
    if code == 4 and row.cancelled:
        words = f"not everything is decided: {count_noun(row.cancelled, 'run')} cancelled"
    if not row.finished:
        standing = conclude(results).text
        if code == 1:
            standing = "already not as expected"
        return f"{standing}; {unfinished_text(row)}"
    # n of n passes do not prove a pass rate of 100 %, only the lower bound of Clopper and Pearson.
    # A folder may hold fewer runs than the campaign has.
    n = min((len(cell.runs) for cell in results.assessment.cells), default=0)
    if code == 0 and n and results.declared.policy.rule == "all":
        words += f"; {n} of {n} shows a pass rate of at least {cut_percentage(at_least(n, n))}"
    return words
