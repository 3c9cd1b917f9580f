"""Conclusions on campaigns in two words: as expected, undecided, so far fine."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

from grammars.text.words import count_noun
from scenario_tui.text.formatting import margin_share
from scenario_tui.text.styles import GLYPHS, SEVERITY

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.judging.assessment import Expectations
    from daemon.model.assessments import CellAssessment
    from daemon.model.status import CampaignRow


def _no_expectations() -> Expectations:
    # The first screen is drawn before the first campaign is judged, and does not need this.
    from daemon.judging.assessment import Expectations

    return Expectations()


@dataclass(frozen=True, slots=True)
class Conclusion:
    """Agreement of a campaign with its expectations: the ``word`` of its glyph, and a ``text``.

    ``unexpected`` counts runs with a verdict that contradicts an expectation, ``known`` the others
    that fail as expected. ``verdicts`` counts the judged runs. ``margins`` are the worst of
    each cell in the order of the matrix, as a share of their scale in [-1, 1] (below 0: broken;
    ``None``: unknown). ``expectations`` mark the runs.
    """

    word: str
    text: str
    unexpected: int = 0
    known: int = 0
    verdicts: int = 0
    margins: tuple[float | None, ...] = ()
    expectations: Expectations = field(default_factory=_no_expectations, repr=False)

    @property
    def glyph_text(self) -> str:
        """The text behind its glyph: ``✓ as expected``."""
        return f"{GLYPHS[self.word]} {self.text}"

    @property
    def brief(self) -> str:
        """A shorter text: ``3 unexpected``, which counts runs."""
        return f"{self.unexpected:,} unexpected" if self.unexpected else self.text

    @property
    def is_judged(self) -> bool:
        """True if its runs tell about its expectations; cancelled ones do not."""
        return self.text != NONE_JUDGED and self.word != "cancelled"


NONE_JUDGED: Final = "none judged"
"""Words for a campaign without a verdict yet."""
SO_FAR_FINE: Final = "so far fine"
"""Words while all verdicts are as expected, but some are missing."""
_BY_EXIT_CODE: Final = {
    0: ("pass", "as expected"),
    3: ("lost", "not all judged"),
    4: ("inconclusive", "undecided"),
}
"""Word and text by the exit code of `scenario results`, so that scripts and people agree."""


def conclude(results: CampaignResults) -> Conclusion:
    """Return the conclusion of a campaign; so far, if it is unfinished."""
    assessment, marks = results.assessment, results.expectations
    word, text = _standing(results)
    kinds = Counter(mark.kind for mark in marks.runs.values())
    return Conclusion(
        word,
        text,
        unexpected=kinds["news"],
        known=kinds["known"],
        verdicts=sum(run.outcome is not None for run in results.rows),
        margins=tuple(map(cell_margin, matrix_order(assessment.cells))),
        expectations=marks,
    )


def unexpected_text(results: CampaignResults) -> str:
    """Return the number of unexpected results: ``3 runs, 1 comparison unexpected``."""
    marks = results.expectations
    runs = sum(mark.kind == "news" for mark in marks.runs.values())
    kinds = [marks.mark_verdict(one).kind for one in results.assessment.comparisons]
    counts = ((runs, "run"), (kinds.count("news"), "comparison"))
    return f"{', '.join(count_noun(*pair) for pair in counts if pair[0])} unexpected"


def _standing(results: CampaignResults) -> tuple[str, str]:
    """Return the state of a campaign: the word of its glyph, and a text of two words."""
    assessment = results.assessment
    code, states = assessment.exit_code, {cell.state for cell in assessment.cells}
    if code == 1:
        return "fail", unexpected_text(results)
    if code == 4 and not results.row.finished:
        if any(cell.oracles for cell in assessment.cells):
            return "running", SO_FAR_FINE
        # A running search has no run between two proposals.
        has_begun = "queued" not in states or "running" in states
        return "running" if has_begun else "queued", NONE_JUDGED
    if code == 4 and "cancelled" in states:
        return "cancelled", "cancelled"
    return _BY_EXIT_CODE[code]


def matrix_order(cells: Sequence[CellAssessment]) -> list[CellAssessment]:
    """Return cells row by row: scenarios, then systems under test, by first appearance."""
    suts = {sut: place for place, sut in enumerate(dict.fromkeys(cell.sut for cell in cells))}
    rows: dict[str, list[CellAssessment]] = {}
    for cell in cells:
        rows.setdefault(cell.scenario, []).append(cell)
    return [cell for row in rows.values() for cell in sorted(row, key=lambda one: suts[one.sut])]


def cell_margin(cell: CellAssessment) -> float | None:
    """Return the worst margin of a cell as a share of its scale in [-1, 1], ``None`` if unknown."""
    verdicts = (oracle.worst.verdict for oracle in cell.oracles if oracle.worst is not None)
    shares = (margin_share(verdict) for verdict in verdicts)
    return min((share for share in shares if share is not None), default=None)


def worst_conclusion(
    campaigns: Iterable[CampaignRow], conclusions: Mapping[str, Conclusion]
) -> tuple[CampaignRow, Conclusion] | None:
    """Return the campaign in the worst state, without acknowledged ones and searches.

    A better run of the same campaign later changes nothing: people acknowledge what they have seen.
    Of equal states the first campaign counts. ``None`` if no campaign is left.
    """
    judged = [
        (row, conclusions[row.id])
        for row in campaigns
        if row.id in conclusions and not row.acknowledged and not row.search
    ]
    # Campaigns without a verdict count only if there are no others.
    telling = [pair for pair in judged if pair[1].is_judged] or judged
    if not telling:
        return None
    row, worst = min(telling, key=lambda pair: (SEVERITY.index(pair[1].word), -pair[1].unexpected))
    waiting = next((one for one in judged if one[1].text == NONE_JUDGED), None)
    if worst.word == "pass" and waiting is not None:
        return waiting[0], replace(waiting[1], word="running", text=SO_FAR_FINE)
    return row, worst
