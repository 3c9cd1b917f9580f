"""Tables of an assessment: cells by scenario and system under test, comparisons below them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

from rich import box
from rich.table import Table
from rich.text import Text

from daemon.assessment import Cell, ComparisonCell
from daemon.verdict import Outcome
from scenario_tui.summary import Results, leading
from scenario_tui.wording import GLYPHS, NOTHING, STYLES, glyph_word, margin, moment

_LETTERS: Final = "abcdefghijklmnopqrstuvwxyz"
_MANY: Final = 20


@dataclass(slots=True)
class Footnotes:
    """Reasons people gave for verdicts that are not pass, each with a letter."""

    letters: dict[str, str] = field(default_factory=dict)

    def mark(self, reasons: Iterable[str]) -> str:
        """Return the letters of reasons, new ones for those not seen before."""
        found = dict.fromkeys(reason for reason in reasons if reason)
        return "".join(self.letters.setdefault(reason, self._next()) for reason in found)

    def _next(self) -> str:
        count = len(self.letters)
        return _LETTERS[count] if count < len(_LETTERS) else f"({count + 1})"


def matrix(results: Results, notes: Footnotes) -> Table:
    """Return one row for each scenario and one column for each system under test."""
    cells = {(cell.scenario, cell.sut): cell for cell in results.assessment.cells}
    suts = tuple(dict.fromkeys(sut for _, sut in cells))
    table = _table("scenario", *suts)
    for scenario in dict.fromkeys(scenario for scenario, _ in cells):
        found = (cells.get((scenario, sut)) for sut in suts)
        table.add_row(scenario, *(_cell(cell, results, notes, len(suts)) for cell in found))
    return table


def _table(*titles: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for title in titles:
        table.add_column(title, overflow="fold")
    return table


def _cell(cell: Cell | None, results: Results, notes: Footnotes, columns: int) -> Text | str:
    if cell is None:
        return NOTHING
    word = results.word(cell)
    text = Text.assemble((glyph_word(word), STYLES[word]))
    text.append(f" {_repeats(cell, results, columns)}")
    if not cell.met:
        text.append(" !", style="bold")
    elif known := notes.mark(oracle.why for oracle in cell.oracles if oracle.expected != "pass"):
        text.append(f" {known}", style="bold")
    shown = _worst(cell)
    if shown:
        text.append("  " if columns == 1 else "\n")
        text.append(shown, style="dim")
    return text


def _repeats(cell: Cell, results: Results, columns: int) -> str:
    """Return ``4/5``, how many of its runs pass; with room also a glyph for each."""
    records = results.records_of(cell)
    passed = sum(record.outcome is Outcome.PASS for record in records)
    share = f"{passed}/{len(records)}"
    if columns > 1 or not 1 < len(records) <= _MANY:
        return share
    words = (str(r.outcome) if r.state == "done" and r.outcome else r.state for r in records)
    return f"{share} {''.join(GLYPHS[word] for word in words)}"


def _worst(cell: Cell) -> str:
    oracle = leading(cell)
    if oracle is None or oracle.worst is None:
        return ""
    verdict = oracle.worst.verdict
    text = oracle.oracle
    if verdict.margin is not None:
        text += f" {margin(verdict.margin, verdict.unit)}"
    if verdict.evidence.time is not None and verdict.outcome is not Outcome.PASS:
        text += f" at {moment(verdict.evidence.time)}"
    return text


def comparison_table(cells: Sequence[ComparisonCell], notes: Footnotes) -> Table:
    """Return one row for each comparison and one column for each system under test."""
    found = {(cell.comparison, cell.sut): cell for cell in cells}
    suts = tuple(dict.fromkeys(cell.sut for cell in cells))
    table = _table("comparison", *suts, "is to be")
    for name, text in {cell.comparison: cell.text for cell in cells}.items():
        row = (found.get((name, sut)) for sut in suts)
        table.add_row(name, *(_compared(cell, notes) for cell in row), Text(text, style="dim"))
    return table


def _compared(cell: ComparisonCell | None, notes: Footnotes) -> Text | str:
    if cell is None:
        return NOTHING
    word = str(cell.verdict)
    text = Text.assemble((glyph_word(word), STYLES[word]), f" {margin(cell.mean, cell.unit)}")
    if cell.low is not None and cell.high is not None:
        text.append(f" [{margin(cell.low, '')}, {margin(cell.high, '')}]")
    text.append(f" n={cell.n}" if cell.method != "welch" else f" n={cell.n} unpaired", style="dim")
    if not cell.met:
        text.append(" !", style="bold")
    elif cell.expected != "pass":
        text.append(f" {notes.mark([cell.why])}", style="bold")
    if cell.note:
        text.append(f"\n{cell.note}", style="dim")
    return text
