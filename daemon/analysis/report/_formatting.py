"""Numbers as reports say them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from daemon.model.verdicts import Verdict

NOTHING: Final = "–"
GLYPHS: Final = {
    "pass": "✓", "fail": "✗", "inconclusive": "?", "error": "‼", "measure": "·",
    "lost": "!", "cancelled": "-", "queued": "…", "running": "▶", "done": "?",
}  # fmt: skip


def format_quantity(
    value: float | None, unit: str = "", *, signed: bool = False, digits: int = 3
) -> str:
    """Return so many significant digits and the unit: ``+0.0312 m``; ``–`` for nothing."""
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    sign = "+" if signed else ""
    whole = abs(value) >= 10.0 ** (digits - 1)  # no exponents: 1234 m, not 1.23e+03 m
    text = f"{value:{sign}.0f}" if whole else f"{value:{sign}.{digits}g}"
    text = text.replace("-", "−")
    return f"{text} {unit}" if unit not in ("", "1") else text


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
    seen = verdict.evidence
    parts = [format_quantity(verdict.margin, verdict.unit, signed=True)]
    if verdict.unit == "" or verdict.margin is None:
        parts = []
    parts.append("" if seen.time is None else f"at {seen.time:.1f} s")
    # What a stack printed stands below the first line, and in the list of runs.
    parts.extend((seen.object, seen.note_text.partition("\n")[0]))
    return ", ".join(part for part in parts if part)


def duration_text(seconds: float) -> str:
    """Return a span of time: ``8 s``, ``3 min 20 s``, ``2 h 05 min``."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
