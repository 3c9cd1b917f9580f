"""Tables of an assessment: cells by scenario and system under test, comparisons below them."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.table import Table
from rich.text import Text

from daemon.assessment import ComparisonCell
from scenario_tui.judged import Footnotes, cell_text, compared_text, quiet
from scenario_tui.summary import Results
from scenario_tui.wording import NOTHING, STYLES


def matrix(results: Results, notes: Footnotes) -> Table:
    """Return one row for each scenario and one column for each system under test."""
    cells = {(cell.scenario, cell.sut): cell for cell in results.assessment.cells}
    suts = tuple(dict.fromkeys(sut for _, sut in cells))
    alone = len(suts) == 1
    table = _table("scenario", *suts)
    for scenario in dict.fromkeys(scenario for scenario, _ in cells):
        found = (cells.get((scenario, sut)) for sut in suts)
        row = (c and cell_text(c, results, notes, STYLES, alone=alone) for c in found)
        table.add_row(scenario, *(shown or NOTHING for shown in row))
    return table


def _table(*titles: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for title in titles:
        table.add_column(title, overflow="fold")
    return table


def comparison_table(cells: Sequence[ComparisonCell], notes: Footnotes) -> Table:
    """Return one row for each comparison and one column for each system under test."""
    found = {(cell.comparison, cell.sut): cell for cell in cells}
    suts = tuple(dict.fromkeys(cell.sut for cell in cells))
    table = _table("comparison", *suts, "is to be")
    for name, text in {cell.comparison: cell.text for cell in cells}.items():
        row = (found.get((name, sut)) for sut in suts)
        shown = (cell and compared_text(cell, notes, STYLES) for cell in row)
        table.add_row(name, *(one or NOTHING for one in shown), Text(text, style=quiet(STYLES)))
    return table
