"""The time base of judging: ground-truth samples, how long each counts, what is still unknown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from grammars.values import Floats

if TYPE_CHECKING:
    from daemon.trace import Trace

_TICK: Final = 0.01
"""A run may end one simulation tick past its limit [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """Samples of a trace that can be trusted.

    ``time`` (n,) [s]; ``weight`` (n,) [s]: a sample counts until the next one, the last one until
    ``end``. ``closed``: the end of the trace is the end of the run; otherwise up to ``remaining``
    seconds are unknown.
    """

    time: Floats
    weight: Floats
    end: float
    closed: bool
    remaining: float

    @property
    def start(self) -> float:
        """Time of the first sample [s], 0 without samples."""
        return float(self.time[0]) if len(self.time) else 0.0


def timeline_of(trace: Trace) -> Timeline:
    """Return the time base of ``trace``: its ground truth up to ``valid_until``.

    A run that crashed counts as cut: what the robot would have done is unknown.
    """
    recorded = np.asarray(trace.ground_truth.time, dtype=np.float64)
    count = int(np.searchsorted(recorded, trace.valid_until + 1e-9, side="right"))
    time = recorded[:count]
    end = max(float(trace.valid_until), float(time[-1])) if count else float(trace.valid_until)
    weight = np.diff(time, append=end) if count else np.empty(0)
    closed = trace.complete and trace.ended != "crashed"
    start = float(time[0]) if count else 0.0
    remaining = 0.0 if closed else max(0.0, start + trace.spec.limit + _TICK - end)
    return Timeline(time, weight, end, closed, remaining)


def hold(stamps: Floats, values: Floats, time: Floats) -> Floats:
    """Sample ``values`` (m,) taken at ``stamps`` (m,) at ``time`` (n,), holding the last one.

    NaN before the first stamp.
    """
    if not len(stamps):
        return np.full(len(time), np.nan)
    index = np.searchsorted(stamps, time + 1e-9, side="right") - 1
    return np.where(index < 0, np.nan, values[np.maximum(index, 0)])
