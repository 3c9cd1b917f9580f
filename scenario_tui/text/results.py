"""Campaigns in two words: as expected, undecided, so far fine; one of them, or several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from scenario_tui.text.formatting import GLYPHS, SEVERITY

if TYPE_CHECKING:
    from daemon.model.assessments import Assessment
    from daemon.model.status import CampaignRow


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
"""Words for a campaign of which no oracle has judged a run yet."""

SO_FAR_FINE: Final = Conclusion("running", "so far fine")
"""All verdicts are as expected, and some are missing."""
_CONCLUSIONS: Final = {
    0: Conclusion("pass", "as expected"),
    3: Conclusion("lost", "not all judged"),
    4: Conclusion("inconclusive", "undecided"),
}
"""Conclusions by the exit code of `scenario results`: scripts and people learn the same."""


def conclude(assessment: Assessment, *, finished: bool) -> Conclusion:
    """Return an assessment in two words; so far, if the campaign is unfinished."""
    code = assessment.exit_code
    if code == 1:
        return unexpected_conclusion(len(assessment.surprises))
    states = {cell.state for cell in assessment.cells}
    if code == 4 and not finished:
        if any(cell.oracles for cell in assessment.cells):
            return SO_FAR_FINE
        # A running search has no run between two proposals.
        has_begun = "queued" not in states or "running" in states
        return Conclusion("running" if has_begun else "queued", NONE_JUDGED)
    if code == 4 and "cancelled" in states:
        return Conclusion("cancelled", "cancelled")
    return _CONCLUSIONS[code]


def unexpected_conclusion(count: int) -> Conclusion:
    """Return the conclusion for ``count`` oracles or comparisons that are not as expected."""
    return Conclusion("fail", f"{count:,} unexpected", count)


def overall_conclusion(
    campaigns: Sequence[CampaignRow], conclusions: Mapping[str, Conclusion]
) -> Conclusion | None:
    """Return one conclusion for the newest campaign of each name.

    ``campaigns`` begin with the newest. Earlier ones of a name were superseded, by a repair say.
    ``None`` while no campaign was judged.
    """
    newest: dict[str, CampaignRow] = {}
    for row in campaigns:
        newest.setdefault(row.name, row)
    judgements = [conclusions[row.id] for row in newest.values() if row.id in conclusions]
    if count := sum(one.unexpected for one in judgements):
        return unexpected_conclusion(count)
    # Cancelled campaigns must not hide the conclusions of the others.
    judgements = [one for one in judgements if one.word != "cancelled"] or judgements
    judged = [one for one in judgements if one.text != NONE_JUDGED]
    if judged and len(judged) < len(judgements) and all(one.word == "pass" for one in judged):
        return SO_FAR_FINE
    return min(judgements, key=lambda one: SEVERITY.index(one.word), default=None)
