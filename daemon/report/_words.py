"""Numbers as reports say them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

NOTHING: Final = "–"
GLYPHS: Final = {
    "pass": "✓", "fail": "✗", "inconclusive": "?", "error": "‼", "measure": "·",
    "lost": "!", "cancelled": "-", "queued": "…", "running": "▶", "done": "?",
}  # fmt: skip


def quantity(value: float | None, unit: str = "", *, signed: bool = False) -> str:
    """Return three significant digits and the unit: ``+0.0312 m``; ``–`` for nothing."""
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    sign = "+" if signed else ""
    whole = abs(value) >= 100.0
    text = f"{value:{sign}.0f}" if whole else f"{value:{sign}.3g}"
    text = text.replace("-", "−")
    return f"{text} {unit}" if unit not in ("", "1") else text


def share(value: float | None) -> str:
    """Return a rate as per cent with one decimal: ``54.9 %``."""
    return NOTHING if value is None else f"{100.0 * value:.1f} %".replace(".0 %", " %")


def spread_of(values: Sequence[float]) -> tuple[str, str]:
    """Return mean and standard deviation as words with fitting digits: ``("0.124", "0.003")``.

    The deviation is empty for a single value.
    """
    mean = sum(values) / len(values)
    if len(values) < 2:
        return quantity(mean), ""
    deviation = math.sqrt(sum((v - mean) ** 2 for v in values) / (len(values) - 1))
    largest = max(abs(mean), deviation)
    digits = 2 if largest == 0.0 else max(0, min(4, 2 - math.floor(math.log10(largest))))
    return f"{mean:.{digits}f}".replace("-", "−"), f"{deviation:.{digits}f}"


def counted(number: int, noun: str, plural: str = "") -> str:
    """Return ``1 run`` or ``2 runs``."""
    return f"{number:,} {noun if number == 1 else plural or noun + 's'}"


def span(seconds: float) -> str:
    """Return a span of time: ``8 s``, ``3 min 20 s``, ``2 h 05 min``."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
