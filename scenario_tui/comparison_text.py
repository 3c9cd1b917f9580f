"""How two runs differ, in words: verdicts and margins, then specifications."""

from __future__ import annotations

from rich.text import Text

from daemon.spec import RunSpec
from daemon.verdict import Verdict
from scenario_tui.comparing import differences, pairs
from scenario_tui.palette import QUIET, WORDS
from scenario_tui.wording import NOTHING, glyph_word, margin, quantity


def comparison_text(
    first: tuple[Verdict, ...], second: tuple[Verdict, ...], one: RunSpec, other: RunSpec
) -> Text:
    """Return verdicts, margins and specifications of two runs, those that differ first."""
    text = Text()
    text.append("oracle               first              second             change\n", style=QUIET)
    for pair in pairs(first, second):
        unit = next(v.unit for v in (pair.first, pair.second) if v is not None)
        text.append(f"{pair.oracle:<20.20} ", style="bold" if pair.differs else "")
        for verdict in (pair.first, pair.second):
            text.append(*_cell(verdict))
        change = "" if pair.change is None else margin(pair.change, unit)
        text.append(f"{change}{'  ≠' if pair.differs else ''}\n")
    found = differences(one, other)
    text.append("\nspecification\n", style="bold")
    if not found:
        text.append("the same, but for the repeat\n", style=QUIET)
    for part in found:
        text.append(f"{part.path}\n  ", style="")
        text.append(f"{part.first}  →  {part.second}\n", style=QUIET)
    return text


def _cell(verdict: Verdict | None) -> tuple[str, str]:
    """Return a verdict in 19 columns and its style."""
    if verdict is None:
        return f"{NOTHING:<19}", QUIET
    amount = verdict.margin
    shown = margin(amount, verdict.unit)
    if amount is None:
        shown = quantity(verdict.evidence.value, verdict.unit)
    sign = glyph_word(verdict.outcome).split()[0]
    return f"{f'{sign} {verdict.outcome:.4} {shown}':<18.18} ", WORDS[verdict.outcome]
