"""An assessment as styled text: cells of the matrix, comparisons, reasons, what to look at."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final

from rich.text import Text

from daemon.model.assessments import (
    CellAssessment,
    CellVerdict,
    ComparisonVerdict,
    ExpectationStatus,
    Mark,
    UnexpectedVerdict,
    group_errors,
)
from daemon.model.verdicts import Outcome
from grammars.text.words import count_noun
from scenario_tui.text.formatting import (
    NOT_REPEATABLE,
    glyph_word,
    margin,
    moment_text,
    run_word,
)
from scenario_tui.text.results import unexpected_text
from scenario_tui.text.run_text import append_mark, evidence_parts, known_text, marked_style
from scenario_tui.text.styles import GLYPHS, QUIET, SEVERITY

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.judging.assessment import Expectations
    from daemon.model.status import RunRow

BOUNDS: Final = "mean difference [one-sided 95 % bounds] over n repeats"
_MANY: Final = 20
"""Most repeats with a glyph each: more would leave no room for the oracle in 80 columns."""


def known_lines(results: CampaignResults) -> list[Text]:
    """Return a line for each reason of a failure that happened."""
    return [known_text(mark) for mark in results.expectations.failures]


def cell_text(cell: CellAssessment, results: CampaignResults, *, alone: bool = False) -> Text:
    """Return a cell in two lines: verdict, counts and mark, then the most telling oracle.

    With the row to itself (``alone``) it is one line with a glyph for each repeat.
    """
    word, mark = cell.word, results.expectations.mark_cells([cell])
    text = Text.assemble((glyph_word(word), marked_style(word, mark)))
    text.append(f" {_repeats(cell, results, alone)}")
    append_mark(text, mark)
    if worst := _worst(cell):
        text.append("  " if alone else "\n")
        text.append(worst, style=QUIET)
    return text


def _repeats(cell: CellAssessment, results: CampaignResults, alone: bool) -> str:
    """Return ``4/5``, the share of passed runs, with a glyph for each run if there is room."""
    records = results.runs_of(cell)
    passed = sum(record.outcome is Outcome.PASS for record in records)
    share = f"{passed}/{len(records)}"
    if not alone or not 1 < len(records) <= _MANY:
        return share
    return f"{share} {''.join(GLYPHS[run_word(record)] for record in records)}"


def _worst(cell: CellAssessment) -> str:
    oracle = leading_oracle(cell)
    if oracle is None or oracle.worst is None:
        return ""
    verdict = oracle.worst.verdict
    text = oracle.oracle
    if verdict.margin is not None:
        text += f" {margin(verdict.margin, verdict.unit)}"
    if verdict.evidence.time is not None and verdict.outcome is not Outcome.PASS:
        text += f" {moment_text(verdict.evidence.time)}"
    return text


def leading_oracle(cell: CellAssessment) -> CellVerdict | None:
    """Return the most telling oracle of a cell.

    Of those with the cell's verdict, an unexpected one comes first, then the smallest margin: a
    tight pass is worth seeing.
    """
    oracles = [oracle for oracle in cell.oracles if oracle.verdict is cell.verdict]
    # False sorts before True: unexpected before expected, with a margin before without.
    return min(oracles, key=_interest, default=None)


def _interest(oracle: CellVerdict) -> tuple[bool, bool, float]:
    least = oracle.worst.verdict.margin if oracle.worst else None
    return not oracle.needs_attention, least is None, least or 0.0


def comparison_cell_text(cell: ComparisonVerdict, mark: Mark) -> Text:
    """Return a comparison with one system under test: verdict, mean, bounds, pairs, mark."""
    style = marked_style(cell.word, mark)
    text = Text.assemble((glyph_word(cell.word), style), f" {margin(cell.mean, cell.unit)}")
    if cell.low is not None and cell.high is not None:
        text.append(f" [{margin(cell.low, '')}, {margin(cell.high, '')}]")
    pairs = f" n={cell.n}" if cell.method != "welch" else f" n={cell.n} unpaired"
    append_mark(text.append(pairs, style=QUIET), mark)
    if cell.note:
        text.append(f"\n{cell.note}", style=QUIET)
    return text


def _surprise_text(verdict: UnexpectedVerdict) -> Text:
    """Return an unexpected verdict in words, with the run to look at."""
    reason = verdict.why and f"known: {verdict.why}"
    text = _attention_line(str(verdict.verdict), verdict.text, [reason])
    if verdict.run:
        text.append(f"  → {verdict.run}", style="measure")
    return text


def undecided_text(oracles: Sequence[CellVerdict]) -> Text:
    """Return which oracles of a cell could not decide, and the reason that they share."""
    oracle = oracles[0]
    worst = oracle.worst.verdict if oracle.worst else None
    note = worst.evidence.note_text if worst and worst.outcome is not Outcome.PASS else ""
    # The first line says what happened; output of the stack is shown with the run.
    note = note.partition("\n")[0]
    subject = f"{oracle.sut} {oracle.scenario} {', '.join(one.oracle for one in oracles)}"
    return _attention_line(str(oracle.verdict), subject, [oracle.statement, note])


def repeatability_text(results: CampaignResults) -> str:
    """Return which systems are not repeatable and its consequence, empty without any."""
    names = ", ".join(results.not_repeatable)
    if not names:
        return ""
    return f"{names}: {NOT_REPEATABLE}, equal runs may differ and no result is used again"


def attention_lists(results: CampaignResults) -> list[tuple[str, list[Text]]]:
    """Return lists of surprises and problems, each a title with lines, without empty ones."""
    surprises, undecided = results.assessment.surprises, results.undecided
    lost_runs, differing = results.lost_runs, results.nondeterministic_runs
    groups = (
        (unexpected_text(results), [_surprise_text(one) for one in surprises]),
        (
            f"{count_noun(len(undecided), 'oracle')} undecided",
            [undecided_text(oracles) for oracles in group_errors(undecided)],
        ),
        (
            f"{count_noun(len(lost_runs), 'run')} not executed",
            [_lost_run_text(row) for row in lost_runs],
        ),
        (
            f"{count_noun(len(differing), 'run')} not reproducible",
            [_attention_line(run_word(r), r.label, [r.reason]) for r in differing],
        ),
    )
    return [(title, lines) for title, lines in groups if lines]


def _lost_run_text(row: RunRow) -> Text:
    return _attention_line("lost", row.label, row.reason.strip().splitlines()[-1:])


def _attention_line(word: str, subject: str, more: Iterable[str]) -> Text:
    text = Text.assemble("  ", (glyph_word(word), word), "  ", subject)
    for part in more:
        text.append(f"  {part}" if part else "")
    return text


_WITHOUT_VERDICT: Final = {
    "queued": "{} queued, none was judged yet",
    "running": "{}, none was judged yet",
    "lost": "{}, none was judged: no attempt gave a result",
    "cancelled": "{}, none was judged: they were cancelled",
    "done": "{}, judged by no oracle",
}
"""Sentences about a cell without a verdict, by the state of its runs."""


def cell_notes(cell: CellAssessment, marks: Expectations) -> Text:
    """Return a cell oracle by oracle: counts, statement, worst run, expectation."""
    text = Text.assemble((f"{cell.scenario}  {cell.sut}\n", "bold"))
    pairs = [(oracle, marks.mark_verdict(oracle)) for oracle in cell.oracles]
    for oracle, mark in sorted(
        pairs, key=lambda pair: (pair[1].kind != "news", SEVERITY.index(pair[0].word))
    ):
        text.append_text(oracle_notes(oracle, mark))
    if not cell.oracles:
        runs = count_noun(len(cell.runs), "run")
        text.append(f"{_WITHOUT_VERDICT[cell.state].format(runs)}\n", style=QUIET)
    return text


def oracle_notes(oracle: CellVerdict, mark: Mark) -> Text:
    """Return an oracle over all repeats: counts, statement, worst run, expectation."""
    text, word = Text(), oracle.word
    text.append(f"{glyph_word(word)}  ", style=marked_style(word, mark))
    text.append(oracle.oracle, style="bold")
    if mark.kind == "news":
        append_mark(text.append(" "), mark).append(f" {mark.reason}")
    elif oracle.expected != "pass":
        so_far = "" if oracle.status is ExpectationStatus.MET else "so far "
        text.append(f"  {so_far}as expected ({oracle.expected})")
    text.append(f"\n  {oracle.statement}\n", style=QUIET)
    if oracle.worst is not None and (evidence := evidence_parts(oracle.worst.verdict)):
        worst = f"  worst in repeat {oracle.worst.repeat}: {', '.join(evidence)}\n"
        text.append(worst, style=QUIET)
    if mark.kind == "known":
        text.append("  ").append_text(known_text(mark)).append("\n")
    return text


def comparison_notes(cell: ComparisonVerdict, mark: Mark) -> Text:
    """Return a comparison with one system under test, and its expectation."""
    text = Text(f"{cell.sut} {cell.comparison}  ")
    text.append_text(comparison_cell_text(cell, mark))
    return text.append(f"\n    should be {cell.text}\n", style=QUIET)


def campaign_notes(results: CampaignResults) -> Text:
    """Return the notes on a campaign: surprises, problems, comparisons, known failures."""
    text, comparisons = Text(), results.assessment.comparisons
    for title, lines in attention_lists(results):
        text.append(f"\n{title}\n", style="bold")
        for line in lines:
            text.append_text(line).append("\n")
    text.append("\ncomparisons\n" if comparisons else "", style="bold")
    for cell in comparisons:
        mark = results.expectations.mark_verdict(cell)
        text.append("  ").append_text(comparison_notes(cell, mark))
    text.append(f"{BOUNDS}\n" if comparisons else "", style=QUIET)
    if words := repeatability_text(results):
        text.append(f"\n{words}\n", style=QUIET)
    if reasons := known_lines(results):
        text.append("\n").append_text(Text("\n").join(reasons)).append("\n")
    return text.append(f"\nscenario results {results.row.id}\n", style=QUIET)
