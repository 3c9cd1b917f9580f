"""Axes: their round ticks, and a range of values with the limits in view."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

_ROUND: Final = (1.0, 2.0, 5.0, 10.0)
_LEAST_SHARE: Final = 0.25
"""The values keep at least this share of an axis: a limit further away is shown at its edge."""
_MOST_TICKS: Final = 1000


@dataclass(frozen=True, slots=True)
class AxisScale:
    """An axis from ``low`` to ``high``, marked at ``ticks``, which are ``step`` apart."""

    low: float
    high: float
    ticks: tuple[float, ...]
    step: float

    def share(self, value: float) -> float:
        """Return where a value lies: 0 at ``low``, 1 at ``high``."""
        return (value - self.low) / (self.high - self.low)


def round_step(least: float) -> float:
    """Return the smallest of 1, 2, 5 x 10^n that is not below ``least``, which is above 0."""
    size = 10.0 ** math.floor(math.log10(least))
    # A hair of rounding must not double a step.
    return next(size * one for one in _ROUND if size * one >= least * (1.0 - 1e-9))


def round_ticks(low: float, high: float, step: float) -> tuple[float, ...]:
    """Return the multiples of ``step`` from ``low`` to ``high``, ascending."""
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return tuple(index * step for index in range(first, min(last, first + _MOST_TICKS) + 1))


def tick_text(value: float, step: float) -> str:
    """Return a tick as short as its ``step`` allows: ``0.05``, ``−20``, ``3e7``."""
    if value and not 1e-4 <= max(abs(value), step) < 1e6:
        return f"{value:.3g}".replace("e-0", "e−").replace("e+0", "e").replace("-", "−")
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    text = f"{value:.{decimals}f}".replace("-", "−")
    return text if value or "−" not in text else text[1:]


def mark_axis(low: float, high: float, room: float, apart: float) -> AxisScale:
    """Return an axis from ``low`` to ``high``, ``room`` cells long, with ticks ``apart`` or more.

    If fewer than two fit, they may stand half as far apart; there is always one.
    """
    low, high = _widened(low, high)
    step = round_step((high - low) * apart / max(room, 1.0))
    ticks = round_ticks(low, high, step)
    if len(ticks) < 2:
        step = round_step((high - low) * 0.5 * apart / max(room, 1.0))
        ticks = round_ticks(low, high, step)
    while not ticks:
        step = round_step(step * 0.35)
        ticks = round_ticks(low, high, step)[:1]
    return AxisScale(low, high, ticks, step)


def fit_axis(low: float, high: float, limits: Sequence[float], rows: int) -> AxisScale:
    """Return the axis of values from ``low`` to ``high`` on ``rows`` rows of cells.

    It holds every limit that leaves the values a quarter of it; for others see
    :meth:`AxisScale.share`, which is then below 0 or above 1.
    """
    size = high - low
    near = sorted(limits, key=lambda limit: max(low - limit, limit - high))
    for limit in near:
        wider = max(high, limit) - min(low, limit)
        if size <= 0.0 or size >= _LEAST_SHARE * wider:
            low, high = min(low, limit), max(high, limit)
    return mark_axis(low, high, rows - 1, 2.0)


def _widened(low: float, high: float) -> tuple[float, float]:
    """Return a range that is not empty."""
    if high - low > 1e-9 * max(abs(low), abs(high), 1e-3):
        return low, high
    room = max(abs(low) * 0.1, 0.05)
    return low - room, high + room
