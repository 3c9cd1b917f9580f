"""Signals over a run: every sample of a recorded run, parts of the time of one that goes on."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from daemon.model.live_judgement import LiveSignal, SignalLimit
from daemon.model.ranges import LARGEST_VALUE
from grammars.model.geometry import Floats

TimeSpan: TypeAlias = tuple[float, float]

_MOST_LIMITS: Final = 1000
"""Limits of a thinned signal: with more the lines cannot be told apart."""
_DIGITS: Final = 4
"""Significant digits of thinned values: more are not visible."""


@dataclass(frozen=True, slots=True, eq=False)
class RunSignal:
    """A signal over simulated time, known from the first to the last of its moments.

    ``low`` and ``high`` (n,) are its least and greatest value from each moment of ``time`` (n,) [s]
    to the next, in SI units, NaN where unknown; ``low is high`` when every sample is recorded.
    ``unit`` is ``bool`` for what is true or false. Oracles compare it with ``limits``; ``readers``
    name the oracles that read it, and ``against`` are the stretches [s] in which the run spoke
    against one of these.
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
    """Return stretches of time as few, ascending and disjoint ones, more than ``gap`` [s] apart."""
    merged: list[TimeSpan] = []
    for start, end in sorted(stretches):
        if merged and start <= merged[-1][1] + gap:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return tuple(merged)


def thin_signal(signal: RunSignal, start: float, end: float, columns: int) -> LiveSignal:
    """Return the least and the greatest value in each of ``columns`` equal parts of the time.

    A part without a sample holds the last value before it, as between two samples; values keep four
    significant digits. Stretches that are less than a part apart become one, so that there are not
    more of them than parts.
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
    held = empty & (last >= 0) & finite[np.maximum(last, 0)]
    low[held], high[held] = signal.low[last[held]], signal.high[last[held]]
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
    """Return the signal that :func:`thin_signal` thinned; its last part ends at its last moment."""
    low, high = (
        np.array([*parts, parts[-1]], dtype=np.float64) for parts in (thinned.low, thinned.high)
    )
    return RunSignal(
        thinned.name, thinned.unit, np.linspace(thinned.start, thinned.end, len(low)), low, high,
        thinned.limits, thinned.against, thinned.readers,
    )  # fmt: skip
