"""The operators of the oracle language on one trace: always, fraction, max and the like.

Between two samples everything is held constant. On a trace that was cut, the unknown rest of the
run (at most until its time limit) widens the interval of the margin; what was already seen stays.
"""

from __future__ import annotations

import math

import numpy as np

from daemon.oracles._finding import Finding, sentence, unknown
from daemon.oracles._predicate import Truth, margin_of, series, truth, unit_of_margin
from daemon.oracles._sampler import Sampler
from daemon.oracles._timeline import Timeline
from daemon.oracles._window import Mask, Window, scope_of, window_of
from daemon.verdict import Evidence
from grammars.oracle import Amount, Limit, Oracle, Statistic, Temporal
from grammars.values import Floats


def temporal(oracle: Oracle, judgement: Temporal, sampler: Sampler) -> Finding:
    """Judge ``always``, ``never`` or ``eventually``."""
    timeline = sampler.timeline
    found = truth(judgement.predicate, sampler, negated=judgement.operator == "never")
    window = window_of(oracle, sampler)
    scope = scope_of(oracle, sampler, window, found.margin)
    allowed, closed = scope.allowed, window.closed
    if judgement.within is not None:
        horizon = window.start + judgement.within.value
        closed = closed or window.end >= horizon
        allowed = allowed & (timeline.time <= horizon + 1e-9)
    if not allowed.any():
        return unknown(scope.reason)
    eventually = judgement.operator == "eventually"
    margin = np.where(allowed, found.margin, -math.inf if eventually else math.inf)
    index = int(margin.argmax() if eventually else margin.argmin())
    worst = float(margin[index])
    first = _first(timeline, allowed & ((found.margin >= 0.0) == eventually), index)
    evidence = evidence_at(found, timeline, index, first, scope.note, window.cut)
    if not unit_of_margin(judgement.predicate) and (worst >= 0.0) != eventually:
        # True or false, and nothing happened: no moment of the run is more telling than another.
        evidence = Evidence(note=sentence(*found.notes, scope.note, window.cut))
    if eventually:
        return Finding(worst, worst if closed else math.inf, evidence)
    return Finding(worst if closed else -math.inf, worst, evidence)


def amount(oracle: Oracle, judgement: Amount, sampler: Sampler) -> Finding:
    """Judge or measure ``fraction``, ``time``, ``longest`` or ``count``."""
    timeline, limit = sampler.timeline, judgement.limit
    found = truth(judgement.predicate, sampler)
    window = window_of(oracle, sampler)
    scope = scope_of(oracle, sampler, window, found.margin)
    if not scope.allowed.any():
        return unknown(scope.reason, measured=limit is None)
    allowed = scope.allowed
    holds = allowed & (found.margin >= 0.0)
    value, low, high = _amount(judgement.operator, timeline, window, allowed, holds)
    if math.isnan(value):
        return unknown("no time has passed", measured=limit is None)
    wants_more = limit is not None and limit.operator in (">=", ">")
    stretch = _longest_stretch(timeline, allowed & ~holds if wants_more else holds)
    note = sentence(*found.notes, scope.note, window.cut)
    evidence = Evidence(value=value, note=note)
    if stretch is not None:
        inside = found.margin[stretch]
        index = stretch.start + int(inside.argmin() if wants_more else inside.argmax())
        clause = found.clauses[found.decided[index]]
        evidence = Evidence(
            float(timeline.time[stretch.start]), value, None, clause.value.object_at(index), note
        )
    return _limited(limit, low, high, evidence)


def statistic(oracle: Oracle, judgement: Statistic, sampler: Sampler) -> Finding:
    """Judge or measure ``max``, ``min``, ``mean``, ``final`` or ``p95`` of a signal."""
    timeline, limit = sampler.timeline, judgement.limit
    signal = series(judgement.signal, sampler)
    window = window_of(oracle, sampler)
    scope = scope_of(oracle, sampler, window, signal.values)
    if not scope.allowed.any():
        return unknown(scope.reason, measured=limit is None)
    value, index = _statistic(judgement.operator, timeline, scope.allowed, signal.values)
    low, high = value, value
    if not window.closed:
        low = value if judgement.operator == "max" else -math.inf
        high = value if judgement.operator == "min" else math.inf
    note = sentence(signal.note, scope.note, window.cut)
    evidence = Evidence(value=value, note=note)
    if index is not None:
        evidence = Evidence(float(timeline.time[index]), value, None, signal.object_at(index), note)
    return _limited(limit, low, high, evidence)


def _amount(
    operator: str, timeline: Timeline, window: Window, allowed: Mask, holds: Mask
) -> tuple[float, float, float]:
    """Return the amount so far and the bounds of what it can be at the end of the run."""
    rest = window.remaining
    held = float(timeline.weight[holds].sum())
    if operator == "time":
        return held, held, held + rest
    if operator == "fraction":
        total = float(timeline.weight[allowed].sum())
        if total <= 0.0:
            return math.nan, 0.0, 1.0
        return held / total, held / (total + rest), (held + rest) / (total + rest)
    if operator == "longest":
        lengths = [float(timeline.weight[s].sum()) for s in stretches(holds)]
        longest = max(lengths, default=0.0)
        current = lengths[-1] if lengths and not window.closed and holds[-1] else 0.0
        return longest, longest, max(longest, current + rest) if rest else longest
    count = float(len(stretches(holds)))
    return count, count, count if window.closed else math.inf


def _statistic(
    operator: str, timeline: Timeline, allowed: Mask, values: Floats
) -> tuple[float, int | None]:
    """Return the statistic and the sample that decides it (``None``: all of them)."""
    indices = np.flatnonzero(allowed)
    judged, weight = values[indices], timeline.weight[indices]
    if weight.sum() <= 0.0:
        weight = np.ones(len(judged))
    if operator == "mean":
        return float(np.average(judged, weights=weight)), None
    if operator == "p95":
        order = np.argsort(judged, kind="stable")
        covered = np.cumsum(weight[order])
        rank = min(int(np.searchsorted(covered, 0.95 * covered[-1] - 1e-9)), len(order) - 1)
        chosen = int(order[rank])
    elif operator == "final":
        chosen = len(indices) - 1
    else:
        chosen = int(judged.argmax() if operator == "max" else judged.argmin())
    return float(judged[chosen]), int(indices[chosen])


def _limited(limit: Limit | None, low: float, high: float, evidence: Evidence) -> Finding:
    """Compare the bounds of a value with its limit, if it has one."""
    if limit is None:
        return Finding(-math.inf, math.inf, evidence, measured=True)
    target = limit.number.value
    judged = Evidence(evidence.time, evidence.value, target, evidence.object, evidence.note)
    ends = np.array([low, high])
    if limit.operator in ("==", "!=") and low <= target <= high:
        ends = np.array([low, target, high])
    margins = margin_of(limit.operator, ends, np.full(len(ends), target))
    return Finding(float(margins.min()), float(margins.max()), judged)


def stretches(holds: Mask) -> list[slice]:
    """Return the unbroken runs of true samples."""
    edges = np.flatnonzero(np.diff(holds.astype(np.int8), prepend=0, append=0))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _longest_stretch(timeline: Timeline, holds: Mask) -> slice | None:
    return max(stretches(holds), key=lambda s: float(timeline.weight[s].sum()), default=None)


def _first(timeline: Timeline, samples: Mask, decisive: int) -> str:
    """Say when it first happened, when that is not the decisive moment."""
    if not samples.any():
        return ""
    index = int(samples.argmax())
    return f"first at {timeline.time[index]:.2f} s" if index != decisive else ""


def evidence_at(found: Truth, timeline: Timeline, index: int, *notes: str) -> Evidence:
    """Return the evidence for a predicate at sample ``index``: of the clause that decided there."""
    clause = found.clauses[found.decided[index]]
    value = float(clause.value.values[index])
    limit = None if clause.limit is None else float(clause.limit[index])
    decided = f"decided by {clause.text}" if len(found.clauses) > 1 else ""
    note = sentence(decided, *found.notes, *notes)
    return Evidence(float(timeline.time[index]), value, limit, clause.value.object_at(index), note)
