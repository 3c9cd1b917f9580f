"""What oracles say of a run that goes on, in words: so far, waiting for something, or for good."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from rich.text import Text

from daemon.model.verdicts import Outcome
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    GLYPHS,
    QUIET,
    SEVERITY,
    UNSURE,
    margin,
    quantity,
)
from scenario_tui.text.run_text import verdict_text

if TYPE_CHECKING:
    from daemon.model.live_judgement import ProvisionalVerdict
    from daemon.model.verdicts import Verdict

_SO_FAR: Final = {
    Outcome.PASS: "passing so far",
    Outcome.FAIL: "failing so far",
    Outcome.INCONCLUSIVE: "undecided so far",
    Outcome.MEASURE: "so far",
}
WAITING: Final = "waiting"
"""What an oracle does that needs something that has not happened yet."""


def by_urgency(provisional: Iterable[ProvisionalVerdict]) -> list[ProvisionalVerdict]:
    """Return verdicts so far: failures for good first, then by severity, what passed at the end."""

    def place(one: ProvisionalVerdict) -> tuple[int, int]:
        outcome = one.verdict.outcome
        if one.open:
            return 2, 0
        if one.final and outcome is Outcome.FAIL:
            return 0, 0
        return (3 if one.final else 1), SEVERITY.index(outcome)

    return sorted(provisional, key=place)


def provisional_text(one: ProvisionalVerdict) -> Text:
    """Return a verdict so far in a few lines."""
    verdict = one.verdict
    if one.open:
        return _waiting_text(verdict)
    if one.final or verdict.outcome not in _SO_FAR:
        return verdict_text(verdict)
    said = f"{GLYPHS[verdict.outcome]} {_SO_FAR[verdict.outcome]}"
    # A failure that may still be mended is not in the colour of one for good.
    style = UNSURE if verdict.outcome is Outcome.FAIL else ""
    return verdict_text(verdict, so_far=said, style=style)


def _waiting_text(verdict: Verdict) -> Text:
    text = Text()
    text.append(f"{GLYPHS['queued']} {WAITING}  ", style=DASHBOARD_STYLES["queued"])
    text.append(verdict.oracle, style="bold")
    text.append(f"\n    {verdict.text}", style=QUIET)
    seen = verdict.evidence
    parts = [quantity(seen.value, verdict.unit)] if seen.value is not None else []
    parts += [seen.object, seen.note_text.partition("\n")[0]]
    if any(parts):
        # Not "now": of most oracles it is the best of all moments until now.
        text.append(f"\n    so far {', '.join(filter(None, parts))}", style=QUIET)
    return text


def worst_text(value: float | None, unit: str, oracle: str) -> Text:
    """Return the least margin so far and whose it is: ``+0.11 m clear``; nothing when unknown."""
    if value is None or not oracle:
        return Text()
    word = "fail" if value < 0.0 else "pass"
    glyph = f"{GLYPHS['fail']} " if value < 0.0 else ""
    return Text.assemble((f"{glyph}{margin(value, unit)}", DASHBOARD_STYLES[word]), f" {oracle}")
