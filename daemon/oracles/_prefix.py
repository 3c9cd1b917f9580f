"""A trace as it was while its run was going on."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from daemon.trace import Trace

_EPSILON = 1e-9


def prefix(trace: Trace, at: float) -> Trace:
    """Return ``trace`` as if its recording had been cut at ``at`` [s]; nothing later is in it.

    ``trace`` itself when it is cut and ends before that.
    """
    if not trace.complete and trace.valid_until <= at:
        return trace
    tracks = ("ground_truth", "odometry", "command", "estimate", "joints", "scans")
    changes: dict[str, Any] = {name: _upto(getattr(trace, name), at) for name in tracks}
    for name in ("contacts", "progress", "events"):
        records = getattr(trace, name)
        changes[name] = tuple(r for r in records if r.time <= at + _EPSILON)
    return replace(
        trace,
        ended=None,
        note="judged while it was going on",
        complete=False,
        valid_until=min(at, trace.valid_until),
        cloud=_upto(trace.cloud, at),
        cloud_count=trace.cloud_count[: _count(trace.cloud.time, at)],
        **changes,
    )


def _upto(track: Any, at: float) -> Any:
    if track is None:
        return None
    count = _count(track.time, at)
    names = [field.name for field in fields(track)]
    arrays = {n: getattr(track, n) for n in names if isinstance(getattr(track, n), np.ndarray)}
    return replace(track, **{name: array[:count] for name, array in arrays.items()})


def _count(time: Any, at: float) -> int:
    """Return how many leading samples are not later than ``at``; clocks may run backwards."""
    later = np.flatnonzero(time > at + _EPSILON)
    return int(later[0]) if len(later) else len(time)
