"""Verdicts in words: how an oracle judged a run, by how much, when and at what."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

from rich.text import Text

from daemon.model.verdicts import Outcome, Verdict
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    QUIET,
    SEVERITY,
    Styles,
    glyph_word,
    margin,
    margin_bar,
    moment_text,
    quantity,
    quiet_style,
)

VERDICT_LINES: Final = 3
"""Lines for verdicts: the worst of them, and how the others are."""


def by_severity(verdicts: Iterable[Verdict]) -> list[Verdict]:
    """Return verdicts, what people must look at first."""
    return sorted(verdicts, key=lambda v: SEVERITY.index(v.outcome))


def verdict_text(verdict: Verdict, styles: Styles = DASHBOARD_STYLES) -> Text:
    """Return a verdict in a few lines: margin, bar, evidence."""
    text = Text()
    text.append(f"{glyph_word(verdict.outcome)}  ", style=styles[verdict.outcome])
    text.append(verdict.oracle, style="bold")
    text.append(f"  {_value(verdict)}")
    first, *rest = (*_evidence_lines(verdict), "")
    if verdict.margin is not None:
        bar = margin_bar(_share(verdict))
        text.append("\n    ").append(f"{bar}  ", style=styles[verdict.outcome])
        text.append(first, style=quiet_style(styles))
    else:
        rest = [first, *rest]
    for line in filter(None, rest):
        text.append(f"\n    {line}", style=quiet_style(styles))
    return text


def _value(verdict: Verdict) -> str:
    if verdict.outcome is Outcome.MEASURE:
        return quantity(verdict.evidence.value, verdict.unit)
    shown = margin(verdict.margin, verdict.unit)
    if verdict.outcome is Outcome.INCONCLUSIVE and verdict.upper is not None:
        return f"{shown} to {margin(verdict.upper, verdict.unit)}"
    return shown


def _share(verdict: Verdict) -> float:
    """Return a margin as a share of the larger of value and limit, of 1 SI unit without those."""
    seen, found = verdict.evidence, verdict.margin or 0.0
    sizes = [abs(size) for size in (seen.value, seen.limit) if size is not None]
    # With a limit of zero the value is the margin: compared with that it would always be all.
    scale = max(sizes) if seen.limit and len(sizes) == 2 else 1.0
    return math.copysign(1.0, found) if math.isinf(scale) or math.isinf(found) else found / scale


def _evidence_lines(verdict: Verdict) -> list[str]:
    """Return the evidence: when and at what, then how much and what else there is to say."""
    seen = verdict.evidence
    where = [moment_text(seen.time), seen.object]
    amounts = ""
    if seen.value is not None and seen.limit is not None:
        value, limit = quantity(seen.value, verdict.unit), quantity(seen.limit, verdict.unit)
        amounts = f"{value}, limit {limit}"
    lines = (where, [amounts, seen.note])
    return [", ".join(filter(None, line)) for line in lines if any(line)]


def evidence_parts(verdict: Verdict) -> list[str]:
    """Return margin, moment, object and note of a verdict, as far as there are any."""
    seen = verdict.evidence
    amount = "" if verdict.margin is None else margin(verdict.margin, verdict.unit)
    return [part for part in (amount, moment_text(seen.time), seen.object, seen.note) if part]


def verdict_lines(
    verdicts: Sequence[Verdict], time: float, most: int = VERDICT_LINES
) -> list[Text]:
    """Return at most ``most`` lines on the verdicts, what was decided against first.

    What is decided later than ``time`` is known already but said to lie ahead.
    """
    judged = [v for v in verdicts if v.outcome is not Outcome.MEASURE]
    ordered = sorted(judged, key=lambda v: (SEVERITY.index(v.outcome), v.evidence.time or 0.0))
    # A line for each that did not pass; those that passed share one, which needs room, too.
    bad = [v for v in ordered if v.outcome is not Outcome.PASS]
    passed = len(ordered) - len(bad)
    room = most - (1 if passed or len(bad) > most else 0)
    lines = [_verdict_line(verdict, time) for verdict in bad[:room]]
    rest = [f"and {len(bad) - room} more not passed"] if len(bad) > room else []
    if passed:
        rest.append(glyph_word("pass").replace("pass", f"{passed} pass"))
    if rest:
        lines.append(
            Text(", ".join(rest), style=QUIET if len(rest) > 1 else DASHBOARD_STYLES["pass"])
        )
    return lines or [Text("no oracle judged this run", style=QUIET)]


def _verdict_line(verdict: Verdict, time: float) -> Text:
    text = Text(no_wrap=True, overflow="ellipsis")
    text.append(glyph_word(verdict.outcome), style=DASHBOARD_STYLES[verdict.outcome])
    text.append(f"  {verdict.oracle}", style="bold")
    text.append(f"  {margin(verdict.margin, verdict.unit)}")
    decided = verdict.evidence.time
    if decided is not None:
        ahead = f", {decided - time:.1f} s ahead" if decided > time + 1e-6 else ""
        text.append(f" {moment_text(decided)}{ahead}", style=QUIET)
    if verdict.evidence.object:
        text.append(f"  {verdict.evidence.object}", style=QUIET)
    return text
