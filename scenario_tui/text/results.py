"""The results of a campaign as people see them: runs, what it declares, how it is assessed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from daemon.model.assessments import ExpectationStatus
from scenario_tui.text.formatting import GLYPHS, SEVERITY, run_word

if TYPE_CHECKING:
    from daemon.model.assessments import (
        Assessment,
        AssessmentRules,
        CellAssessment,
        CellVerdict,
    )
    from daemon.model.status import CampaignRow, RunRow
    from daemon.model.verbs import DaemonClient


@dataclass(frozen=True, slots=True)
class Conclusion:
    """Agreement of a campaign with its expectations: ``word`` names its glyph, ``text`` says it."""

    word: str
    text: str
    unexpected: int = 0

    @property
    def glyph_text(self) -> str:
        """The text behind its glyph: ``✓ as expected``."""
        return f"{GLYPHS[self.word]} {self.text}"


NONE_JUDGED: Final = "none judged"
"""What is said of a campaign while no oracle has judged any of its runs."""

SO_FAR_FINE: Final = Conclusion("running", "so far fine")
"""What has been judged is as expected, and not all has been."""
_CONCLUSIONS: Final = {
    0: Conclusion("pass", "as expected"),
    3: Conclusion("lost", "not all judged"),
    4: Conclusion("inconclusive", "undecided"),
}
"""By the exit code of `scenario results`, so that scripts and people are told the same."""


@dataclass(frozen=True, slots=True)
class CampaignResults:
    """Everything known about a campaign; ``rows`` are its runs with their results, in order."""

    row: CampaignRow
    rows: tuple[RunRow, ...]
    declared: AssessmentRules
    assessment: Assessment
    _by_id: Mapping[str, RunRow] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_by_id", {row.id: row for row in self.rows})

    @property
    def words(self) -> tuple[str, ...]:
        """The word of each run."""
        return tuple(run_word(row) for row in self.rows)

    @property
    def not_repeatable(self) -> tuple[str, ...]:
        """Systems under test of which the same run gives something else each time."""
        return tuple(dict.fromkeys(row.sut for row in self.rows if not row.repeatable))

    def runs_of(self, cell: CellAssessment) -> tuple[RunRow, ...]:
        """Return the runs of a cell."""
        return tuple(self._by_id[run] for run in cell.runs)

    @property
    def undecided(self) -> tuple[CellVerdict, ...]:
        """Open oracles of cells that have all their runs."""
        return tuple(
            oracle
            for cell in self.assessment.cells
            for oracle in cell.oracles
            if oracle.status is ExpectationStatus.OPEN and not oracle.missing
        )

    @property
    def lost_runs(self) -> tuple[RunRow, ...]:
        """Runs that were given up or broke before anything could be judged."""
        return tuple(row for row in self.rows if run_word(row) == "lost")

    @property
    def nondeterministic_runs(self) -> tuple[RunRow, ...]:
        """Runs that came out differently when the same was executed before."""
        return tuple(row for row in self.rows if row.nondeterministic)


def gather_results(daemon: DaemonClient, row: CampaignRow) -> CampaignResults:
    """Ask for everything about a campaign and judge it."""
    from daemon.judging.assessment import assess

    rows, declared = daemon.all_runs(row.id, results=True), daemon.declared(row.id)
    return CampaignResults(row, rows, declared, assess(declared, rows))


def fetch_conclusion(daemon: DaemonClient, row: CampaignRow) -> Conclusion:
    """Ask whether a campaign is as expected."""
    from daemon.judging.assessment import assess

    rows = daemon.all_runs(row.id, results=True)
    return conclude(assess(daemon.declared(row.id), rows), finished=row.finished)


def conclude(assessment: Assessment, *, finished: bool) -> Conclusion:
    """Return an assessment in two words; of an unfinished campaign what can be said so far."""
    code = assessment.exit_code
    if code == 1:
        return unexpected_conclusion(len(assessment.surprises))
    states = {cell.state for cell in assessment.cells}
    if code == 4 and not finished:
        if any(cell.oracles for cell in assessment.cells):
            return SO_FAR_FINE
        # A search that runs has no run between two proposals.
        has_begun = "queued" not in states or "running" in states
        return Conclusion("running" if has_begun else "queued", NONE_JUDGED)
    if code == 4 and "cancelled" in states:
        return Conclusion("cancelled", "cancelled")
    return _CONCLUSIONS[code]


def unexpected_conclusion(count: int) -> Conclusion:
    """Return that so many oracles or comparisons are not as expected."""
    return Conclusion("fail", f"{count:,} unexpected", count)


def overall_conclusion(
    campaigns: Sequence[CampaignRow], conclusions: Mapping[str, Conclusion]
) -> Conclusion | None:
    """Return how the newest campaign of each name stands, all together.

    ``campaigns`` are the newest first. Earlier ones of a name were superseded, by a repair say.
    ``None`` while there is none that was judged.
    """
    newest: dict[str, CampaignRow] = {}
    for row in campaigns:
        newest.setdefault(row.name, row)
    judgements = [conclusions[row.id] for row in newest.values() if row.id in conclusions]
    if count := sum(one.unexpected for one in judgements):
        return unexpected_conclusion(count)
    # What was cancelled says nothing more, and must not hide what the others say.
    judgements = [one for one in judgements if one.word != "cancelled"] or judgements
    judged = [one for one in judgements if one.text != NONE_JUDGED]
    if judged and len(judged) < len(judgements) and all(one.word == "pass" for one in judged):
        return SO_FAR_FINE
    return min(judgements, key=lambda one: SEVERITY.index(one.word), default=None)


def leading_oracle(cell: CellAssessment) -> CellVerdict | None:
    """Return the oracle that tells most about a cell.

    Of those with the cell's verdict one that is not as expected comes first, then the smallest
    margin: a tight pass is worth seeing.
    """
    oracles = [oracle for oracle in cell.oracles if oracle.verdict is cell.verdict]
    # False before True: not met before met, with a margin before without.
    return min(oracles, key=_interest, default=None)


def _interest(oracle: CellVerdict) -> tuple[bool, bool, float]:
    margin = oracle.worst.verdict.margin if oracle.worst else None
    return not oracle.needs_attention, margin is None, margin or 0.0
