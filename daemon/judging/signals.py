"""Signals over a run: every sample of a recorded run, parts of the time of a running one."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from daemon.model.ids import LARGEST_VALUE
from daemon.model.live_judgement import LiveSignal, SignalLimit
from grammars.model.geometry import Floats

TimeSpan: TypeAlias = tuple[float, float]

_MOST_LIMITS: Final = 1000
"""Most limits of a thinned signal: more lines cannot be told apart."""
_DIGITS: Final = 4
"""Significant digits of thinned values: more are not visible."""


@dataclass(frozen=True, slots=True, eq=False)
class RunSignal:
    """A signal over simulated time, from the first to the last of its moments.

    ``low`` and ``high`` (n,) are its least and greatest value from each moment of ``time`` (n,) [s]
    to the next. They are in SI units, NaN where unknown; ``low is high`` if every sample is
    recorded.
    ``unit`` is ``bool`` for true or false. Oracles compare the signal with ``limits``. ``readers``
    name the oracles that read it; ``against`` are the stretches [s] in which one of them is
    violated.
    """

    name: str
    unit: str
    time: Floats
    low: Floats
    high: Floats
    limits: tuple[SignalLimit, ...] = ()
    against: tuple[TimeSpan, ...] = ()
    readers: tuple[str, ...] = ()

    def at(self, time: float) -> tuple[float, float]:
        """Return the least and greatest value at a moment [s], NaN before the first one."""
        index = int(np.searchsorted(self.time, time + 1e-9, side="right")) - 1
        if index < 0:
            return np.nan, np.nan
        return float(self.low[index]), float(self.high[index])


def merge_spans(stretches: Iterable[TimeSpan], gap: float = 0.0) -> tuple[TimeSpan, ...]:
    """Join stretches of time that overlap or are at most ``gap`` [s] apart; ascending."""
    merged: list[TimeSpan] = []
    for start, end in sorted(stretches):
        if merged and start <= merged[-1][1] + gap:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return tuple(merged)


def thin_signal(signal: RunSignal, start: float, end: float, columns: int) -> LiveSignal:
    """Return the least and the greatest value in each of ``columns`` equal parts of the time.

    A part without a sample holds the last value before it, as between two samples. Values keep four
    significant digits. Stretches less than a part apart become one, so there are never more
    stretches than parts.
    """
    span = max(end - start, 1e-9)
    column = np.floor((signal.time - start) / span * columns).astype(np.int64)
    column = np.clip(column, 0, columns - 1)
    finite = np.isfinite(signal.low)
    low, high = np.full(columns, np.inf), np.full(columns, -np.inf)
    np.minimum.at(low, column[finite], signal.low[finite])
    np.maximum.at(high, column[finite], signal.high[finite])
    last = np.searchsorted(column, np.arange(columns), side="right") - 1
    empty = np.bincount(column, minlength=columns) == 0
    filled = empty & (last >= 0) & finite[np.maximum(last, 0)]
    low[filled], high[filled] = signal.low[last[filled]], signal.high[last[filled]]
    return LiveSignal(
        signal.name, signal.unit, start, end, _rounded(low), _rounded(high),
        signal.limits[:_MOST_LIMITS], merge_spans(signal.against, span / columns), signal.readers,
    )  # fmt: skip


def _rounded(values: Floats) -> tuple[float | None, ...]:
    return tuple(
        float(f"{min(max(value, -LARGEST_VALUE), LARGEST_VALUE):.{_DIGITS}g}")
        if math.isfinite(value)
        else None
        for value in values.tolist()
    )


def received_signal(thinned: LiveSignal) -> RunSignal:
    """Return a signal from :func:`thin_signal` again; its last part ends at its last moment."""
    low, high = (
        np.array([*parts, parts[-1]], dtype=np.float64) for parts in (thinned.low, thinned.high)
    )
    return RunSignal(
        thinned.name, thinned.unit, np.linspace(thinned.start, thinned.end, len(low)), low, high,
        thinned.limits, thinned.against, thinned.readers,
    )  # fmt: skip
