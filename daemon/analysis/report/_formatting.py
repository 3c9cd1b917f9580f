"""Numbers as reports say them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from daemon.model.verdicts import Verdict
from grammars.text.words import NOTHING, format_quantity

GLYPHS: Final = {
    "pass": "✓", "fail": "✗", "inconclusive": "?", "error": "‼", "measure": "·",
    "lost": "!", "cancelled": "-", "queued": "…", "running": "▶", "done": "?",
}  # fmt: skip


def percentage(value: float | None) -> str:
    """Return a rate as per cent with one decimal: ``54.9 %``."""
    return NOTHING if value is None else f"{100.0 * value:.1f} %".replace(".0 %", " %")


def mean_and_deviation(values: Sequence[float]) -> tuple[str, str]:
    """Return mean and standard deviation as words with fitting digits: ``("0.124", "0.003")``.

    The deviation is empty for a single value.
    """
    mean = sum(values) / len(values)
    if len(values) < 2:
        return format_quantity(mean), ""
    deviation = math.sqrt(sum((v - mean) ** 2 for v in values) / (len(values) - 1))
    # The deviation's first two digits say how many of the mean mean anything.
    digits = min(_digits(deviation, 1), _digits(mean, 3)) if deviation else _digits(mean, 2)
    return f"{mean:.{digits}f}".replace("-", "−"), f"{deviation:.{digits}f}"


def _digits(value: float, more: int) -> int:
    """Return how many decimals show ``more`` digits after the first one that counts."""
    return 2 if value == 0.0 else max(0, min(4, more - math.floor(math.log10(abs(value)))))


def verdict_details(verdict: Verdict) -> str:
    """Return a verdict's margin and evidence: ``−0.012 m, 41.3 s, door_17``.

    Margins without a unit only say true or false and are left out.
    """
    evidence = verdict.evidence
    parts = [format_quantity(verdict.margin, verdict.unit, signed=True)]
    if verdict.unit == "" or verdict.margin is None:
        parts = []
    parts.append("" if evidence.time is None else f"at {evidence.time:.1f} s")
    # What a stack printed stands below the first line, and in the list of runs.
    parts.extend((evidence.object, evidence.note_text.partition("\n")[0]))
    return ", ".join(part for part in parts if part)
