"""Marks beside verdicts: news, which contradict an expectation, and known failures."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

from daemon.judging.assessment._cell_verdicts import trusted_verdicts
from daemon.model.assessments import (
    Assessment,
    CellAssessment,
    CellVerdict,
    ComparisonVerdict,
    ExpectationStatus,
)
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome

NEWS: Final = "!"
"""The sign beside everything that is not as expected."""
_LETTERS: Final = "abcdefghijklmnopqrstuvwxyz"


@dataclass(frozen=True, slots=True)
class Mark:
    """Mark of a verdict: ``letter`` is the sign to show, ``!`` for news, ``reason`` its meaning.

    ``known``: every failure was expected, and ``reason`` is the one people gave. Letters of known
    failures may follow the sign of news. Without a kind there is nothing to say.
    """

    kind: Literal["news", "known", ""] = ""
    letter: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Expectations:
    """Marks of the cells, comparisons and runs of a campaign; each known reason has a letter.

    ``letters`` are in the order of the matrix. Only reasons of failures that happened have one.
    """

    letters: Mapping[str, str] = field(default_factory=dict)
    runs: Mapping[tuple[str, Outcome | None], Mark] = field(default_factory=dict)

    def mark(self, row: RunRow) -> Mark:
        """Return the mark of a run, an empty one for a run that has ended since."""
        return self.runs.get((row.id, row.outcome), Mark())

    def mark_cell(self, cell: CellAssessment) -> Mark:
        """Return the mark of a cell: news first, with the letters of its known failures."""
        return _join(map(self.mark_verdict, cell.oracles))

    def mark_verdict(self, verdict: CellVerdict | ComparisonVerdict) -> Mark:
        """Return the mark of an oracle over all repeats of a cell, or that of a comparison."""
        if verdict.status is ExpectationStatus.CONTRADICTED:
            return Mark("news", NEWS, _expected_text(verdict))
        if _fails_as_known(verdict):
            return Mark("known", self.letters[verdict.why], verdict.why)
        return Mark()


def find_marks(assessment: Assessment, records: Iterable[RunRow]) -> Expectations:
    """Return the marks of an assessed campaign and of its runs, ``records``."""
    judged = [oracle for cell in assessment.cells for oracle in cell.oracles]
    verdicts: list[CellVerdict | ComparisonVerdict] = [*judged, *assessment.comparisons]
    reasons = dict.fromkeys(one.why for one in verdicts if _fails_as_known(one))
    letters = {reason: _letter(index) for index, reason in enumerate(reasons)}
    oracles: dict[tuple[str, str], dict[str, CellVerdict]] = defaultdict(dict)
    for oracle in judged:
        if oracle.failed or oracle.status is ExpectationStatus.CONTRADICTED:
            oracles[oracle.scenario, oracle.sut][oracle.oracle] = oracle
    marks = (
        (row, _join(_run_marks(row, found, letters)))
        for row in records
        if (found := oracles.get((row.scenario, row.sut)))
    )
    return Expectations(letters, {(row.id, row.outcome): mark for row, mark in marks if mark.kind})


def _run_marks(
    row: RunRow, oracles: Mapping[str, CellVerdict], letters: Mapping[str, str]
) -> Iterator[Mark]:
    """Yield a mark for each verdict of a run that was expected to fail, or not to come out so."""
    for verdict in trusted_verdicts(row):
        oracle = oracles.get(verdict.oracle)
        if oracle is None:
            continue
        failed, expects_pass = verdict.outcome is Outcome.FAIL, oracle.expected == "pass"
        unexpected = failed if expects_pass else verdict.outcome is Outcome.PASS
        if failed and not expects_pass:
            yield Mark("known", letters[oracle.why], oracle.why)
        # A policy by rate tolerates some failures of a cell.
        elif unexpected and oracle.status is ExpectationStatus.CONTRADICTED:
            yield Mark("news", NEWS, _expected_text(oracle))


def _join(marks: Iterable[Mark]) -> Mark:
    """Return one mark for several: news first, and then for that reason."""
    said = sorted((mark for mark in marks if mark.kind), key=lambda mark: mark.kind == "known")
    kind = said[0].kind if said else ""
    letters = dict.fromkeys(mark.letter for mark in said)
    reasons = dict.fromkeys(mark.reason for mark in said if mark.kind == kind)
    return Mark(kind, "".join(letters), "; ".join(reasons))


def _fails_as_known(verdict: CellVerdict | ComparisonVerdict) -> bool:
    """Return whether something failed that was not expected to pass."""
    if isinstance(verdict, CellVerdict):
        return verdict.failed > 0 and verdict.expected != "pass"
    return verdict.verdict is Outcome.FAIL and verdict.expected != "pass"


def _expected_text(verdict: CellVerdict | ComparisonVerdict) -> str:
    return f"expected {verdict.expected}" + (f": {verdict.why}" if verdict.why else "")


def _letter(index: int) -> str:
    return _LETTERS[index] if index < len(_LETTERS) else f"({index + 1})"
