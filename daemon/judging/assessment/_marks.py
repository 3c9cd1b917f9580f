"""Marks beside verdicts: news, which contradict an expectation, and known failures."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from daemon.judging.assessment._cell_verdicts import trusted_verdicts
from daemon.model.assessments import (
    NO_MARK,
    Assessment,
    AssessmentRules,
    CellAssessment,
    CellVerdict,
    ComparisonVerdict,
    ExpectationStatus,
    Mark,
)
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome

NEWS: Final = "!"
"""The sign beside everything unexpected."""
_LETTERS: Final = "abcdefghijklmnopqrstuvwxyz"


@dataclass(frozen=True, slots=True)
class Expectations:
    """Marks of the cells, comparisons and runs of a campaign.

    Each reason in the campaign has one of the ``letters``, in the order of its file. ``failures``
    are the marks of known failures that happened. ``oracles`` are those that fail or contradict, by
    cell (scenario, SUT); ``runs`` are marks by id and outcome.
    """

    letters: Mapping[str, str] = field(default_factory=dict)
    failures: tuple[Mark, ...] = ()
    oracles: Mapping[tuple[str, str], Mapping[str, CellVerdict]] = field(default_factory=dict)
    runs: Mapping[tuple[str, Outcome | None], Mark] = field(default_factory=dict)

    def mark(self, row: RunRow) -> Mark:
        """Return the mark of a run, an empty one for a run that has ended since."""
        return self.runs.get((row.id, row.outcome), NO_MARK)

    def mark_verdicts(self, row: RunRow) -> dict[str, Mark]:
        """Return the marks of the verdicts of a run with its result, by the oracle's name."""
        oracles = self.oracles.get((row.scenario, row.sut), {})
        marks = {
            verdict.oracle: self._mark_outcome(oracles[verdict.oracle], verdict.outcome)
            for verdict in trusted_verdicts(row)
            if verdict.oracle in oracles
        }
        return {oracle: mark for oracle, mark in marks.items() if mark.kind}

    def mark_cells(self, cells: Iterable[CellAssessment]) -> Mark:
        """Return the joint mark of cells: news first, with the letters of known failures."""
        return _join(self.mark_verdict(oracle) for cell in cells for oracle in cell.oracles)

    def mark_verdict(self, verdict: CellVerdict | ComparisonVerdict) -> Mark:
        """Return the mark of a comparison, or of an oracle over all repeats of a cell."""
        if verdict.status is ExpectationStatus.CONTRADICTED:
            return Mark("news", NEWS, f"expected {verdict.expected}")
        return self._known(verdict) if _fails_as_known(verdict) else NO_MARK

    def _mark_outcome(self, oracle: CellVerdict, outcome: Outcome) -> Mark:
        """Return the mark of one repeat."""
        failed, expects_pass = outcome is Outcome.FAIL, oracle.expected == "pass"
        if failed and not expects_pass:
            return self._known(oracle)
        unexpected = failed if expects_pass else outcome is Outcome.PASS
        # A policy by rate tolerates some failures of a cell.
        return self.mark_verdict(oracle) if unexpected else NO_MARK

    def _known(self, verdict: CellVerdict | ComparisonVerdict) -> Mark:
        return Mark("known", self.letters[verdict.why], verdict.why)


def find_marks(
    declared: AssessmentRules, assessment: Assessment, records: Iterable[RunRow]
) -> Expectations:
    """Return the marks of an assessed campaign and of its runs, ``records``."""
    reasons = dict.fromkeys(one.why for one in declared.expectations)
    letters = {reason: _letter(index) for index, reason in enumerate(reasons)}
    oracles: dict[tuple[str, str], dict[str, CellVerdict]] = defaultdict(dict)
    reasons_met = {one.why for one in assessment.comparisons if _fails_as_known(one)}
    for oracle in (oracle for cell in assessment.cells for oracle in cell.oracles):
        if oracle.failed or oracle.status is ExpectationStatus.CONTRADICTED:
            oracles[oracle.scenario, oracle.sut][oracle.oracle] = oracle
        if _fails_as_known(oracle):
            reasons_met.add(oracle.why)
    failures = tuple(Mark("known", letters[why], why) for why in letters if why in reasons_met)
    marks = Expectations(letters, failures, dict(oracles))
    of_runs = (
        (row, _join(marks.mark_verdicts(row).values()))
        for row in records
        if (row.scenario, row.sut) in oracles
    )
    runs = {(row.id, row.outcome): mark for row, mark in of_runs if mark.kind}
    return replace(marks, runs=runs)


def _join(marks: Iterable[Mark]) -> Mark:
    """Return one mark for several: news first, with the reasons of that kind alone."""
    ordered = sorted((mark for mark in marks if mark.kind), key=lambda mark: mark.kind == "known")
    kind = ordered[0].kind if ordered else ""
    letters = dict.fromkeys(mark.letter for mark in ordered)
    reasons = dict.fromkeys(mark.reason for mark in ordered if mark.kind == kind)
    return Mark(kind, "".join(letters), "; ".join(reasons))


def _fails_as_known(verdict: CellVerdict | ComparisonVerdict) -> bool:
    """Return whether a verdict failed that was not expected to pass."""
    if isinstance(verdict, CellVerdict):
        return verdict.failed > 0 and verdict.expected != "pass"
    return verdict.verdict is Outcome.FAIL and verdict.expected != "pass"


def _letter(index: int) -> str:
    return _LETTERS[index] if index < len(_LETTERS) else f"({index + 1})"
