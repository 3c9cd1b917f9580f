"""A campaign's assessment beside its matrix: the cell under the cursor, then everything else."""

from __future__ import annotations

from rich.text import Text

from daemon.assessment import Cell, OracleCell
from scenario_tui.judged import BOUNDS, Footnotes, cell_text, compared_text, evidence_parts, listed
from scenario_tui.palette import QUIET, WORDS
from scenario_tui.summary import Results
from scenario_tui.wording import NOTHING, SEVERITY, glyph_word

MatrixRow = tuple[str, tuple[Text, ...]]
"""The label of a row, and a cell for each column."""


def matrix_lines(
    results: Results, notes: Footnotes
) -> tuple[tuple[str, ...], tuple[MatrixRow, ...]]:
    """Return systems under test and, for each scenario, its label with a cell for each of them."""

    cells = {(cell.scenario, cell.sut): cell for cell in results.assessment.cells}
    suts = tuple(dict.fromkeys(sut for _, sut in cells))
    alone = len(suts) == 1
    lines = []
    for scenario in dict.fromkeys(scenario for scenario, _ in cells):
        found = (cells.get((scenario, sut)) for sut in suts)
        shown = (c and cell_text(c, results, notes, WORDS, alone=alone) for c in found)
        lines.append((scenario, tuple(text or Text(NOTHING, style=QUIET) for text in shown)))
    return suts, tuple(lines)


def cell_notes(cell: Cell) -> Text:
    """Return a cell oracle by oracle: counts, what they show, the worst run, what was expected."""
    text = Text.assemble((f"{cell.scenario}  {cell.sut}\n", "bold"))
    for oracle in sorted(cell.oracles, key=lambda o: (o.met, SEVERITY.index(o.verdict))):
        _oracle(text, oracle)
    if not cell.oracles:
        text.append("no run was judged yet\n", style=QUIET)
    return text


def _oracle(text: Text, oracle: OracleCell) -> None:
    word = str(oracle.verdict)
    text.append(f"{glyph_word(word)}  ", style=WORDS[word])
    text.append(oracle.oracle, style="bold")
    if not oracle.met:
        text.append("  ! ", style="bold")
        text.append(f"expected {oracle.expected}")
    elif oracle.expected != "pass":
        text.append(f"  as expected ({oracle.expected})")
    text.append("\n")
    lines = [oracle.statement]
    if oracle.worst is not None:
        said = ", ".join(evidence_parts(oracle.worst.verdict))
        lines.append(f"worst in repeat {oracle.worst.repeat}: {said}" if said else "")
    lines.append(oracle.why and f"known: {oracle.why}")
    for line in lines:
        text.append(f"  {line}\n" if line else "", style=QUIET)


def campaign_notes(results: Results, notes: Footnotes) -> Text:
    """Return comparisons, what is known, and what is to be looked at."""
    text = Text()
    for title, lines in listed(results, WORDS):
        text.append(f"\n{len(lines):,} {title}\n", style="bold")
        for line in lines:
            text.append_text(line).append("\n")
    if results.assessment.comparisons:
        text.append("\ncomparisons\n", style="bold")
    for cell in results.assessment.comparisons:
        text.append(f"  {cell.sut} {cell.comparison}  ")
        text.append_text(compared_text(cell, notes, WORDS))
        text.append(f"\n    is to be {cell.text}\n", style=QUIET)
    if results.assessment.comparisons:
        text.append(f"{BOUNDS}\n", style=QUIET)
    if known := notes.lines():
        text.append("\n").append_text(Text("\n").join(known)).append("\n")
    text.append(f"\nscenario results {results.row.id}\n", style=QUIET)
    return text
