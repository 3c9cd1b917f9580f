"""What an assessment says, as styled text: the same words in the command line and the dashboard.

``styles`` maps words of :data:`scenario_tui.wording.GLYPHS` to styles, those of the terminal or
those of the dashboard.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

from rich.text import Text

from daemon.assessment import Cell, ComparisonCell, OracleCell, Surprise
from daemon.protocol import RunRow
from daemon.verdict import Outcome, Verdict
from scenario_tui.summary import Results, leading
from scenario_tui.wording import GLYPHS, glyph_word, margin, moment, run_label, word_of

Styles = Mapping[str, str]

BOUNDS: Final = "mean difference [one-sided 95 % bounds] over n repeats"
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

    def lines(self) -> list[Text]:
        """Return a line for each letter."""
        return [
            Text.assemble((letter, "bold"), f"  known: {reason}")
            for reason, letter in self.letters.items()
        ]

    def _next(self) -> str:
        count = len(self.letters)
        return _LETTERS[count] if count < len(_LETTERS) else f"({count + 1})"


def quiet(styles: Styles) -> str:
    """Return the style of what is not to draw the eye."""
    return styles["cancelled"]


def cell_text(
    cell: Cell, results: Results, notes: Footnotes, styles: Styles, *, alone: bool = False
) -> Text:
    """Return a cell in two lines: verdict, counts and mark, then the oracle that tells most.

    ``!`` marks what is not as expected, a letter what is known. With the row to itself (``alone``)
    it is one line with a glyph for each repeat.
    """
    word = results.word(cell)
    text = Text.assemble((glyph_word(word), styles[word]))
    text.append(f" {_repeats(cell, results, alone)}")
    if not cell.met:
        text.append(" !", style="bold")
    elif known := notes.mark(oracle.why for oracle in cell.oracles if oracle.expected != "pass"):
        text.append(f" {known}", style="bold")
    shown = _worst(cell)
    if shown:
        text.append("  " if alone else "\n")
        text.append(shown, style=quiet(styles))
    return text


def _repeats(cell: Cell, results: Results, alone: bool) -> str:
    """Return ``4/5``, how many of its runs pass; with room also a glyph for each."""
    records = results.records_of(cell)
    passed = sum(record.outcome is Outcome.PASS for record in records)
    share = f"{passed}/{len(records)}"
    if not alone or not 1 < len(records) <= _MANY:
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


def compared_text(cell: ComparisonCell, notes: Footnotes, styles: Styles) -> Text:
    """Return a comparison with one system under test: verdict, mean, bounds, pairs, mark."""
    word = str(cell.verdict)
    text = Text.assemble((glyph_word(word), styles[word]), f" {margin(cell.mean, cell.unit)}")
    if cell.low is not None and cell.high is not None:
        text.append(f" [{margin(cell.low, '')}, {margin(cell.high, '')}]")
    pairs = f" n={cell.n}" if cell.method != "welch" else f" n={cell.n} unpaired"
    text.append(pairs, style=quiet(styles))
    if not cell.met:
        text.append(" !", style="bold")
    elif cell.expected != "pass":
        text.append(f" {notes.mark([cell.why])}", style="bold")
    if cell.note:
        text.append(f"\n{cell.note}", style=quiet(styles))
    return text


def evidence_parts(verdict: Verdict) -> list[str]:
    """Return margin, moment, object and note of a verdict, as far as there are any."""
    seen = verdict.evidence
    parts = ["" if verdict.margin is None else margin(verdict.margin, verdict.unit)]
    parts.append("" if seen.time is None else f"at {moment(seen.time)}")
    return [part for part in (*parts, seen.object, seen.note) if part]


def surprise_text(found: Surprise, styles: Styles) -> Text:
    """Return what is not as expected, with the run to look at."""
    known = found.why and f"known: {found.why}"
    text = _line(str(found.verdict), found.text, [known], styles)
    if found.run:
        text.append(f"  -> {found.run}", style=styles["measure"])
    return text


def undecided_text(oracle: OracleCell, styles: Styles) -> Text:
    """Return what could not be decided and why."""
    worst = oracle.worst.verdict if oracle.worst else None
    note = worst.evidence.note if worst and worst.outcome is not Outcome.PASS else ""
    said = f"{oracle.sut} {oracle.scenario} {oracle.oracle}"
    return _line(str(oracle.verdict), said, [oracle.statement, note], styles)


def listed(results: Results, styles: Styles) -> list[tuple[str, list[Text]]]:
    """Return what is to be looked at, as titles with lines; empty lists are left out."""
    groups = (
        ("unexpected", [surprise_text(found, styles) for found in results.assessment.surprises]),
        ("undecided", [undecided_text(found, styles) for found in results.undecided]),
        ("not executed", [_lost(row, styles) for row in results.unexecuted]),
        (
            "not reproducible",
            [_line(word_of(r), run_label(r), [r.reason], styles) for r in results.doubtful],
        ),
    )
    return [(title, lines) for title, lines in groups if lines]


def _lost(row: RunRow, styles: Styles) -> Text:
    return _line("lost", run_label(row), row.reason.strip().splitlines()[-1:], styles)


def _line(word: str, subject: str, more: Iterable[str], styles: Styles) -> Text:
    text = Text.assemble("  ", (glyph_word(word), styles[word]), "  ", subject)
    for part in more:
        text.append(f"  {part}" if part else "")
    return text
