"""The operators of the oracle language on one trace: always, fraction, max, until, whenever.

Between two samples everything is constant. On a trace that was cut, the unknown rest of the run (at
most until its time limit) widens the interval of the margin; recorded violations stay.

``always(...) until (...)``: the margin is that of the predicate before the release, in the
predicate's unit. A release that never came has no amount in that unit, so it is missed by the
smallest possible number.

``whenever A then B within T``: the margin is that of ``B``, of each occasion the best and of all
occasions the worst. The end of the run may cut the time of an occasion: it then counts only if
``B`` held before. Without an occasion there is nothing to judge.

``reached(mission, tolerance)``: all waypoints, in strict order, by the true position. A run is as
good as its best reading: of all ways to name a moment for every waypoint, in order, the one whose
worst distance is smallest. The margin is the tolerance minus that distance. So a waypoint passed at
0.26 m instead of 0.25 m misses by 0.01 m, whatever comes after it. Waypoints with a heading are
judged by position only: the paper's requirement is to reach them (section 4.1.1).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.judging.oracles._predicate import (
    JUST_BELOW,
    VACUOUS,
    ClauseLead,
    JudgedWindow,
    PredicateSeries,
    SampleMask,
    evaluate_predicate,
    evaluate_quantity,
    margin_of,
    scope_of,
    unit_of_margin,
    window_of,
)
from daemon.judging.oracles._sampler import SignalSampler
from daemon.judging.oracles._series import SignalSeries, TimeBase, quantile_index
from daemon.model.verdicts import Evidence, MarginInterval, join_notes, unknown_margin
from grammars.model.geometry import Floats
from grammars.model.mission import Waypoint
from grammars.oracle import Amount, Limit, Oracle, Reached, Response, Statistic, Temporal, Until
from grammars.text.expressions import render

_RELEASED = "what it waits for held from the start"
_SHARES: Final = {"median": 0.5, "p95": 0.95}
"""Statistics that are quantiles of time, with the share of time that they cover."""


def judge_temporal(
    oracle: Oracle, judgement: Temporal, sampler: SignalSampler, lead: ClauseLead | None = None
) -> MarginInterval:
    """Judge ``always``, ``never`` or ``eventually``, or return the margin that leads."""
    time_base, negated = sampler.time_base, judgement.operator == "never"
    series = evaluate_predicate(judgement.predicate, sampler, negated=negated, lead=lead)
    window, closed, in_time = _window_within(oracle, judgement, sampler)
    scope = scope_of(oracle, sampler, window, series.margin)
    allowed = scope.allowed & in_time
    if not allowed.any():
        return unknown_margin(scope.reason)
    eventually = judgement.operator == "eventually"
    margin = np.where(allowed, series.margin, -math.inf if eventually else math.inf)
    # The decisive moment is the worst one, for ``eventually`` the best one.
    index = int(margin.argmax() if eventually else margin.argmin())
    worst = float(margin[index])
    first = _first_note(time_base, allowed & ((series.margin >= 0.0) == eventually), index)
    evidence = _evidence_at_sample(series, time_base, index, first, scope.note, window.cut)
    flat = lead is None and not unit_of_margin(judgement.predicate)
    if flat and (worst >= 0.0) != eventually:
        # A predicate that is only true or false and never changed has no telling moment.
        evidence = Evidence(note=join_notes(*series.notes, scope.note, window.cut))
    # The rest of the run can only make the best better, and the worst worse.
    if eventually:
        return MarginInterval(worst, worst if closed else math.inf, evidence)
    return MarginInterval(worst if closed else -math.inf, worst, evidence)


def judge_amount(oracle: Oracle, judgement: Amount, sampler: SignalSampler) -> MarginInterval:
    """Judge or measure ``fraction``, ``time``, ``longest`` or ``count``."""
    time_base, limit = sampler.time_base, judgement.limit
    series = evaluate_predicate(judgement.predicate, sampler)
    window = window_of(oracle, sampler)
    scope = scope_of(oracle, sampler, window, series.margin)
    if not scope.allowed.any():
        return unknown_margin(scope.reason, measured=limit is None)
    allowed = scope.allowed
    holds = allowed & (series.margin >= 0.0)
    value, low, high = _amount(judgement.operator, time_base, window, allowed, holds)
    if math.isnan(value):
        return unknown_margin("no time has passed", measured=limit is None)
    # The evidence is the longest stretch that speaks against the limit: for "at least" where the
    # predicate does not hold, for "at most" (and a mere measure) where it does.
    is_lower_limit = limit is not None and limit.operator in (">=", ">")
    stretch = _longest(time_base, allowed & ~holds if is_lower_limit else holds)
    note = join_notes(*series.notes, scope.note, window.cut)
    evidence = Evidence(value=value, note=note)
    if stretch is not None:
        inside = series.margin[stretch]
        index = stretch.start + int(inside.argmin() if is_lower_limit else inside.argmax())
        clause = series.clauses[series.decided[index]]
        evidence = Evidence(
            float(time_base.time[stretch.start]), value, None, clause.value.object_at(index), note
        )
    return _compare_with_limit(limit, low, high, evidence)


def judge_statistic(
    oracle: Oracle, judgement: Statistic, sampler: SignalSampler, lead: SignalSeries | None = None
) -> MarginInterval:
    """Judge or measure a statistic of a signal, such as ``max(speed)``.

    ``lead`` replaces the signal by one that continues where it is flat.
    """
    time_base, limit = sampler.time_base, judgement.limit
    signal = lead or evaluate_quantity(judgement.signal, sampler)
    window = window_of(oracle, sampler)
    scope = scope_of(oracle, sampler, window, signal.values)
    if not scope.allowed.any():
        return unknown_margin(scope.reason, measured=limit is None)
    value, index = _statistic(judgement.operator, time_base, scope.allowed, signal.values)
    low, high = value, value
    # A maximum so far can only grow, a minimum only shrink; the others are still unknown.
    if not window.closed:
        low = value if judgement.operator == "max" else -math.inf
        high = value if judgement.operator == "min" else math.inf
    note = join_notes(signal.note, scope.note, window.cut)
    evidence = Evidence(value=value, note=note)
    if index is not None:
        evidence = Evidence(
            float(time_base.time[index]), value, None, signal.object_at(index), note
        )
    return _compare_with_limit(limit, low, high, evidence)


def _amount(
    operator: str, time_base: TimeBase, window: JudgedWindow, allowed: SampleMask, holds: SampleMask
) -> tuple[float, float, float]:
    """Return the amount so far and its bounds at the end of the run."""
    rest = window.remaining
    duration = float(time_base.weight[holds].sum())
    if operator == "time":
        return duration, duration, duration + rest
    if operator == "fraction":
        total = float(time_base.weight[allowed].sum())
        if total <= 0.0:
            return math.nan, 0.0, 1.0
        return duration / total, duration / (total + rest), (duration + rest) / (total + rest)
    if operator == "longest":
        lengths = [float(time_base.weight[s].sum()) for s in true_stretches(holds)]
        longest = max(lengths, default=0.0)
        # A stretch that lasts to the end of a cut trace may go on for all of the rest.
        current = lengths[-1] if lengths and not window.closed and holds[-1] else 0.0
        return longest, longest, max(longest, current + rest) if rest else longest
    count = float(len(true_stretches(holds)))
    return count, count, count if window.closed else math.inf


def _statistic(
    operator: str, time_base: TimeBase, allowed: SampleMask, values: Floats
) -> tuple[float, int | None]:
    """Return the statistic and its deciding sample, ``None`` if all samples decide."""
    indices = np.flatnonzero(allowed)
    judged, weight = values[indices], time_base.weight[indices]
    if weight.sum() <= 0.0:
        weight = np.ones(len(judged))
    if operator == "mean":
        return float(np.average(judged, weights=weight)), None
    if operator in _SHARES:
        place = quantile_index(judged, weight, _SHARES[operator])
    elif operator == "final":
        place = len(indices) - 1
    else:
        place = int(judged.argmax() if operator == "max" else judged.argmin())
    return float(judged[place]), int(indices[place])


def _compare_with_limit(
    limit: Limit | None, low: float, high: float, evidence: Evidence
) -> MarginInterval:
    """Compare the bounds of a value with its limit, if it has one."""
    if limit is None:
        return MarginInterval(-math.inf, math.inf, evidence, measured=True)
    target = limit.number.value
    judged = Evidence(evidence.time, evidence.value, target, evidence.object, evidence.note)
    ends = np.array([low, high])
    # The margin of an equality has its extreme at the limit, if the interval contains it.
    if limit.operator in ("==", "!=") and low <= target <= high:
        ends = np.array([low, target, high])
    margins = margin_of(limit.operator, ends, np.full(len(ends), target))
    return MarginInterval(float(margins.min()), float(margins.max()), judged)


def true_stretches(holds: SampleMask) -> list[slice]:
    """Return the unbroken runs of true samples."""
    edges = np.flatnonzero(np.diff(holds.astype(np.int8), prepend=0, append=0))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _longest(time_base: TimeBase, holds: SampleMask) -> slice | None:
    return max(true_stretches(holds), key=lambda s: float(time_base.weight[s].sum()), default=None)


def _first_note(time_base: TimeBase, samples: SampleMask, decisive: int) -> str:
    """Return when it first happened, empty if that is the decisive moment."""
    if not samples.any():
        return ""
    index = int(samples.argmax())
    return f"first at {time_base.time[index]:.2f} s" if index != decisive else ""


def _evidence_at_sample(
    series: PredicateSeries, time_base: TimeBase, index: int, *notes: str
) -> Evidence:
    """Return the evidence for a predicate at sample ``index``, from the deciding clause."""
    clause = series.clauses[series.decided[index]]
    value = float(clause.value.values[index])
    limit = None if clause.limit is None else float(clause.limit[index])
    decided = f"decided by {clause.text}" if len(series.clauses) > 1 else ""
    note = join_notes(decided, *series.notes, *notes)
    return Evidence(float(time_base.time[index]), value, limit, clause.value.object_at(index), note)


def judge_until(
    oracle: Oracle, judgement: Until, sampler: SignalSampler, lead: ClauseLead | None = None
) -> MarginInterval:
    """Judge ``always`` or ``never`` a predicate until another one holds.

    The release counts anywhere inside the window; the guard says where the predicate is judged. A
    violation before the release is a failure, whatever comes. With ``lead``, return the margin of
    the predicate that leads, even if the release never came.
    """
    time_base, negated = sampler.time_base, judgement.operator == "never"
    window, closed, awaited = _window_within(oracle, judgement, sampler)
    required = evaluate_predicate(judgement.predicate, sampler, negated=negated, lead=lead)
    release = evaluate_predicate(judgement.release, sampler)
    scope = scope_of(oracle, sampler, window, required.margin)
    came = awaited & (release.margin >= 0.0)
    first = int(came.argmax()) if came.any() else len(came)
    before = scope.allowed & awaited & (np.arange(len(came)) < first)
    if not before.any():
        at_once = came.any() and scope.allowed.any()
        return unknown_margin(f"vacuous: {_RELEASED}" if at_once else scope.reason)
    margin = np.where(before, required.margin, math.inf)
    index = int(margin.argmin())
    worst = float(margin[index])
    if lead is None and not came.any() and closed and worst >= 0.0:
        return _release_never_came(judgement, release, sampler, awaited)
    ended = f"until {time_base.time[first]:.2f} s" if came.any() else window.cut
    evidence = _evidence_at_sample(required, time_base, index, scope.note, ended)
    if lead is None and not unit_of_margin(judgement.predicate) and worst >= 0.0:
        # A predicate that is only true or false and never changed has no telling moment.
        evidence = Evidence(note=join_notes(*required.notes, scope.note, ended))
    return MarginInterval(worst if came.any() or closed else -math.inf, worst, evidence)


def occasions_of(
    judgement: Response, sampler: SignalSampler, allowed: SampleMask
) -> tuple[list[slice], SampleMask]:
    """Return the samples in which each occasion has its answer, and whether all were recorded."""
    time, within = sampler.time_base.time, judgement.within.value
    holds = evaluate_predicate(judgement.occasion, sampler).margin >= 0.0
    starts = [s.start for s in true_stretches(holds) if allowed[s.start]]
    ends = np.searchsorted(time, time[starts] + within + 1e-9, side="right").tolist()
    over = sampler.time_base.end >= time[starts] + within - 1e-9
    return [slice(*ends) for ends in zip(starts, ends, strict=True)], over


def judge_response(
    oracle: Oracle, judgement: Response, sampler: SignalSampler, lead: ClauseLead | None = None
) -> MarginInterval:
    """Judge the answer to every occasion by its best moment, or return the margin that leads."""
    window, ended = window_of(oracle, sampler), sampler.time_base.closed
    occasion = evaluate_predicate(judgement.occasion, sampler).margin
    scope = scope_of(oracle, sampler, window, occasion)
    spans, over = occasions_of(judgement, sampler, scope.allowed)
    answer = evaluate_predicate(judgement.predicate, sampler, lead=lead)
    margin = np.where(np.isnan(answer.margin), -math.inf, answer.margin)
    best = np.array([span.start + int(margin[span].argmax()) for span in spans], dtype=np.int64)
    # Of a time that the end of the run cuts, only an answer counts; in a cut trace it goes on.
    judged = best[~np.isinf(margin[best]) & (over | (ended & (margin[best] >= 0.0)))]
    if not len(judged):
        reason = f"vacuous: no answer to {render(judgement.occasion)} was due"
        return unknown_margin(reason if scope.allowed.any() else scope.reason)
    index = int(judged[margin[judged].argmin()])
    begun = max(span.start for span in spans if span.start <= index)
    when = f"{render(judgement.occasion)} at {sampler.time_base.time[begun]:.2f} s"
    notes = (when, scope.note, window.cut)
    evidence = _evidence_at_sample(answer, sampler.time_base, index, *notes)
    closed = window.closed and (ended or bool(over.all()))
    worst = float(margin[index])
    return MarginInterval(worst if closed else -math.inf, worst, evidence)


def _window_within(
    oracle: Oracle, judgement: Temporal | Until, sampler: SignalSampler
) -> tuple[JudgedWindow, bool, SampleMask]:
    """Return the window, whether it is over for good, and the samples in which events count."""
    window = window_of(oracle, sampler)
    if judgement.within is None:
        return window, window.closed, window.inside
    horizon = window.start + judgement.within.value
    in_time = window.inside & (sampler.time_base.time <= horizon + 1e-9)
    return window, window.closed or window.end >= horizon, in_time


def _release_never_came(
    judgement: Until, release: PredicateSeries, sampler: SignalSampler, awaited: SampleMask
) -> MarginInterval:
    """Fail, with the moment at which the release was nearest, if it has a distance."""
    margin = JUST_BELOW if unit_of_margin(judgement.predicate) else -1.0
    note = f"{render(judgement.release)} never came"
    nearness = np.where(awaited & ~np.isnan(release.margin), release.margin, -math.inf)
    if not unit_of_margin(judgement.release) or np.isinf(nearness).all():
        return MarginInterval(margin, margin, Evidence(note=note))
    evidence = _evidence_at_sample(release, sampler.time_base, int(nearness.argmax()), note)
    return MarginInterval(margin, margin, evidence)


def judge_reached(oracle: Oracle, judgement: Reached, sampler: SignalSampler) -> MarginInterval:
    """Judge the mission; positions count as visits only where the guard, if any, holds."""
    time_base, tolerance = sampler.time_base, judgement.tolerance.value
    if not len(time_base.time):
        return unknown_margin("nothing was recorded")
    usable = usable_visits(oracle, sampler)
    if not usable.any():
        return unknown_margin(VACUOUS)
    waypoints = sampler.trace.spec.mission.waypoints
    closest = _closest(sampler, usable, waypoints)
    if math.isinf(closest):
        return unknown_margin(VACUOUS)
    evidence = _decisive_visit(sampler, usable, waypoints, closest, tolerance)
    margin = tolerance - closest
    return MarginInterval(margin, margin if time_base.closed else math.inf, evidence)


def usable_visits(oracle: Oracle, sampler: SignalSampler) -> SampleMask:
    """Return the samples (n,) that count as visits: those where the guard, if any, holds."""
    if oracle.guard is None:
        return np.full(len(sampler.time_base.time), True)
    return evaluate_predicate(oracle.guard, sampler).margin >= 0.0


def waypoint_distance(sampler: SignalSampler, usable: SampleMask, waypoint: Waypoint) -> Floats:
    """Return the distance [m] at every sample, infinite where it is not ``usable``."""
    distance = np.hypot(sampler.x - waypoint.x, sampler.y - waypoint.y)
    distance[~usable] = math.inf
    return distance


def _closest(sampler: SignalSampler, usable: SampleMask, waypoints: tuple[Waypoint, ...]) -> float:
    """Return the smallest worst distance [m] over all ways to visit the waypoints in order."""
    # Dynamic programming over the waypoints: best[i] is the smallest worst distance of all ways to
    # visit those so far by sample i. Each takes one pass of numpy; the number of readings is n to
    # the power of the waypoints.
    best = np.zeros(len(sampler.time_base.time))
    for waypoint in waypoints:
        worst = np.maximum(best, waypoint_distance(sampler, usable, waypoint))
        best = np.minimum.accumulate(worst)
    return float(best[-1])


def _decisive_visit(
    sampler: SignalSampler,
    usable: SampleMask,
    waypoints: tuple[Waypoint, ...],
    closest: float,
    tolerance: float,
) -> Evidence:
    """Return the evidence of the best reading: its first missed waypoint, otherwise its worst."""
    time, count, within = sampler.time_base.time, len(waypoints), max(closest, tolerance)
    worst, decisive, when, note = -math.inf, 0, 0, ""
    # The earliest visits of the best reading, and those within the tolerance.
    loose = start = 0
    for index, waypoint in enumerate(waypoints):
        distance = waypoint_distance(sampler, usable, waypoint)
        if distance[start:].min() > within:
            start = loose
        visit = _first_visit(distance[start:], within)
        best = start + visit.start + int(distance[start:][visit].argmin())
        is_missed = distance[best] > tolerance
        if distance[best] > worst or is_missed:
            worst, decisive, when = float(distance[best]), index, best
        if is_missed:
            note = f"waypoint {index + 1} of {count} is the first missed"
            if closest > worst + 1e-9:
                note += f", a later one by {closest - tolerance:.2f} m"
            break
        loose += _first_visit(distance[loose:], within).start
        start += int((distance[start:] <= tolerance).argmax())
    else:
        note = f"all {count} waypoints visited, the last at {time[start]:.2f} s"
    if not sampler.time_base.closed and closest > tolerance:
        note = join_notes(note, f"the trace ends at {sampler.time_base.end:.2f} s, before the run")
    return Evidence(float(time[when]), worst, tolerance, waypoints[decisive].id, note)


def _first_visit(distance: Floats, within: float) -> slice:
    """Return the first unbroken stay within a distance, which is reached at least once."""
    near = distance <= within
    first = int(near.argmax())
    away = ~near[first:]
    last = first + int(away.argmax()) if away.any() else len(near)
    return slice(first, last)
