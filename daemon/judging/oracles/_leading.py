"""Leading margins: how near a run was to failing by an oracle, for those who search for failures.

A verdict's margin is flat where nothing of what it speaks of happened: ``never(contact)`` has the
same one whether the robot passed a box at 30 cm or at 2 cm. A leading margin has the verdict's sign
and goes on where that stops. Nothing of this is part of a verdict or a trace.

- ``always``, ``never``, ``eventually``, ``until``: quantitative semantics over signals that lead
  (:mod:`daemon.judging.oracles._leading_series`). A release that never came: the smallest
  distance to it.
- ``time``, ``longest``, ``fraction``, ``count``: the verdict's margin, and while the amount is 0
  also the smallest distance to the condition; likewise while it holds all the time.
- ``max``, ``min``, ``final``, ``p95``: of the signal that leads; ``mean`` the verdict's.
- ``reached``: what was missing to the first waypoint that was not reached, and the legs behind it.
- Oracles that plug in: the verdict's.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from daemon.judging.oracles._judge import bind_oracle, judge, written_oracle
from daemon.judging.oracles._leading_kind import leading_unit, predicate_scale, predicate_unit
from daemon.judging.oracles._leading_series import LEAST, leading_series, leads_further
from daemon.judging.oracles._leading_signals import leading_quantity
from daemon.judging.oracles._operators import statistic_of, waypoint_distance, window_within
from daemon.judging.oracles._predicate import (
    PredicateSeries,
    SampleMask,
    evaluate_predicate,
    evaluate_quantity,
    margin_of,
    scope_of,
    window_of,
)
from daemon.judging.oracles._sampler import PluginError, SignalSampler
from daemon.judging.oracles._validity import trace_problems
from daemon.model.spec import LeadingMargin, OracleText
from daemon.model.verdicts import Outcome, Verdict
from daemon.trace import Trace
from grammars.model.mission import Waypoint
from grammars.oracle import Amount, Oracle, Reached, Statistic, Temporal, Until
from grammars.text.diagnostics import InputError


@dataclass(frozen=True, slots=True)
class _Lead:
    """A margin before it is given the verdict's sign, what it is about, and when that was.

    ``index`` is the decisive sample, ``None`` where the verdict's evidence says when. ``waypoint``
    is the one it is about, where it is about one.
    """

    margin: float
    object: str = ""
    index: int | None = None
    waypoint: str = ""


def judge_leading(
    trace: Trace, oracles: Sequence[OracleText]
) -> tuple[tuple[Verdict, ...], tuple[LeadingMargin, ...]]:
    """Judge ``trace`` by each oracle, in order, and return the leading margins as well.

    The verdicts are those of :func:`daemon.judging.oracles.judge`; signals are sampled once.
    """
    sampler = None if trace_problems(trace) else SignalSampler(trace)
    verdicts = judge(trace, oracles, sampler=sampler)
    return verdicts, leading_margins(trace, oracles, sampler=sampler, verdicts=verdicts)


def leading_margins(
    trace: Trace,
    oracles: Sequence[OracleText],
    *,
    sampler: SignalSampler | None = None,
    verdicts: Sequence[Verdict] | None = None,
) -> tuple[LeadingMargin, ...]:
    """Return the leading margin of each oracle with a limit, in order; measures are left out.

    Negative exactly where the verdict is ``fail``; ``None`` where it is ``error`` or
    ``inconclusive``, and where a run that passes says nothing (there is nothing to run into). With
    ``verdicts``, those of the same trace and oracles, nothing is judged again. Nothing is raised.
    """
    if verdicts is None:
        sampler = sampler or (None if trace_problems(trace) else SignalSampler(trace))
        verdicts = judge(trace, oracles, sampler=sampler)
    found = []
    for written, verdict in zip(oracles, verdicts, strict=True):
        oracle = written_oracle(written)
        if verdict.outcome is Outcome.MEASURE or (oracle is not None and oracle.is_measure):
            continue
        if verdict.outcome not in (Outcome.PASS, Outcome.FAIL):
            found.append(LeadingMargin(written.name, None, _unit_or_nothing(oracle)))
            continue
        sampler = sampler or SignalSampler(trace)
        found.append(_lead_one(written, verdict, sampler))
    return tuple(found)


def _unit_or_nothing(oracle: Oracle | None) -> str:
    """Return the unit of an oracle that may not have been understood."""
    try:
        return "" if oracle is None else leading_unit(oracle)
    except ValueError:  # a plug-in that cannot be used
        return ""


def _lead_one(written: OracleText, verdict: Verdict, sampler: SignalSampler) -> LeadingMargin:
    try:
        oracle = bind_oracle(written, sampler.trace)
        unit = leading_unit(oracle)
        lead = _evaluate(oracle, verdict, sampler)
    except (InputError, PluginError, ValueError):
        # The verdict is there, so it is a plug-in that answers differently when asked again.
        unit, lead = verdict.unit, _own(verdict)
    about = lead.object or verdict.evidence.object
    waypoint = lead.waypoint or _waypoint_ahead(verdict, lead, sampler)
    return LeadingMargin(written.name, _signed(verdict, lead.margin), unit, about, waypoint)


def _waypoint_ahead(verdict: Verdict, lead: _Lead, sampler: SignalSampler) -> str:
    """Return the waypoint being approached at the decisive moment, as reported; or nothing."""
    index = lead.index
    if index is None:
        moment, time = verdict.evidence.time, sampler.time_base.time
        if moment is None or not len(time):
            return ""
        index = max(int(np.searchsorted(time, moment + 1e-9, side="right")) - 1, 0)
    current, waypoints = sampler.current[index], sampler.trace.spec.mission.waypoints
    ahead = not math.isnan(current) and 0 <= current < len(waypoints)
    return waypoints[int(current)].id if ahead else ""


def _own(verdict: Verdict) -> _Lead:
    """Return the verdict's margin, infinite where it has none."""
    return _Lead(math.inf if verdict.margin is None else verdict.margin)


def _signed(verdict: Verdict, margin: float) -> float | None:
    """Return a margin with the sign of its verdict; ``None``: passed, nothing to be near to."""
    if verdict.outcome is Outcome.FAIL:
        own = _own(verdict).margin
        return min(margin if math.isfinite(margin) else own, -LEAST)
    # + 0.0 makes 0.0 of -0.0.
    return max(margin, 0.0) + 0.0 if math.isfinite(margin) else None


def _evaluate(oracle: Oracle, verdict: Verdict, sampler: SignalSampler) -> _Lead:
    match oracle.judgement:
        case Temporal() as judgement:
            return _lead_temporal(oracle, judgement, verdict, sampler)
        case Until() as judgement:
            return _lead_until(oracle, judgement, verdict, sampler)
        case Amount() as judgement:
            return _lead_amount(oracle, judgement, verdict, sampler)
        case Statistic() as judgement:
            return _lead_statistic(oracle, judgement, verdict, sampler)
        case Reached() as judgement if verdict.outcome is Outcome.FAIL:
            return _lead_reached(oracle, judgement, sampler)
    return _own(verdict)


def _lead_temporal(
    oracle: Oracle, judgement: Temporal, verdict: Verdict, sampler: SignalSampler
) -> _Lead:
    if not leads_further(judgement.predicate):
        return _own(verdict)
    negated = judgement.operator == "never"
    found = leading_series(judgement.predicate, sampler, negated=negated)
    window, _, in_time = window_within(oracle, judgement, sampler)
    allowed = scope_of(oracle, sampler, window, found.margin).allowed & in_time
    return _extreme(found, allowed, largest=judgement.operator == "eventually")


def _lead_until(
    oracle: Oracle, judgement: Until, verdict: Verdict, sampler: SignalSampler
) -> _Lead:
    """Lead to what is forbidden before the release, or to a release that never came."""
    negated = judgement.operator == "never"
    held = leading_series(judgement.predicate, sampler, negated=negated)
    release = leading_series(judgement.release, sampler)
    window, _, awaited = window_within(oracle, judgement, sampler)
    came = awaited & (release.margin >= 0.0)
    first = int(came.argmax()) if came.any() else len(came)
    allowed = scope_of(oracle, sampler, window, held.margin).allowed
    worst = _extreme(held, allowed & awaited & (np.arange(len(came)) < first), largest=False)
    if verdict.outcome is Outcome.PASS or worst.margin < 0.0:
        return worst
    # The verdict's unit is that of the predicate: the distance to the release is converted, by what
    # each of them is measured with, where it has another one.
    nearest = _extreme(release, awaited & ~np.isnan(release.margin), largest=True)
    factor = 1.0
    if predicate_unit(judgement.predicate) != predicate_unit(judgement.release):
        robot = sampler.trace.spec.robot
        factor = predicate_scale(judgement.predicate, robot)
        factor /= predicate_scale(judgement.release, robot)
    return replace(nearest, margin=nearest.margin * factor)


def _lead_amount(
    oracle: Oracle, judgement: Amount, verdict: Verdict, sampler: SignalSampler
) -> _Lead:
    """Lead to the condition while the amount cannot change: it held never, or all the time."""
    own, limit = _own(verdict), judgement.limit
    if limit is None or limit.operator in ("==", "!="):
        return own
    judged = evaluate_predicate(judgement.predicate, sampler).margin
    allowed = scope_of(oracle, sampler, window_of(oracle, sampler), judged).allowed
    holds = judged[allowed] >= 0.0
    never, always = not holds.any(), bool(holds.all())
    # A condition that holds all the time was met once: it counts once more only after it did not.
    if not never and (not always or judgement.operator == "count"):
        return own
    found = leading_series(judgement.predicate, sampler)
    nearest = _extreme(found, allowed, largest=never)
    more = limit.operator in (">=", ">")
    margin = own.margin + (nearest.margin if more else -nearest.margin)
    return replace(nearest, margin=margin)


def _lead_statistic(
    oracle: Oracle, judgement: Statistic, verdict: Verdict, sampler: SignalSampler
) -> _Lead:
    """Lead below the 0 at which a depth or a distance stops."""
    own, limit = _own(verdict), judgement.limit
    led = None if limit is None else leading_quantity(judgement.signal, sampler)
    if limit is None or led is None:
        return own
    plain = evaluate_quantity(judgement.signal, sampler).values
    allowed = scope_of(oracle, sampler, window_of(oracle, sampler), plain).allowed
    operator: str = judgement.operator
    if operator == "mean":
        if plain[allowed].any():
            return own
        # While all of it is 0, the nearest it came to anything else.
        operator = "max" if (led.values[allowed] <= 0.0).all() else "min"
    if not allowed.any():
        return own
    value, index = statistic_of(operator, sampler.time_base, allowed, led.values)
    margin = margin_of(limit.operator, np.array([value]), np.array([limit.number.value]))
    return _Lead(float(margin[0]), "" if index is None else led.object_at(index), index)


def _lead_reached(oracle: Oracle, judgement: Reached, sampler: SignalSampler) -> _Lead:
    """Return minus the way [m] that was missing, straight from waypoint to waypoint."""
    usable = np.full(len(sampler.time_base.time), True)
    if oracle.guard is not None:
        usable = evaluate_predicate(oracle.guard, sampler).margin >= 0.0
    waypoints, start = sampler.trace.spec.mission.waypoints, 0
    for index, waypoint in enumerate(waypoints):
        distance = waypoint_distance(sampler, usable, waypoint)[start:]
        near = distance <= judgement.tolerance.value
        if near.any():
            start += int(near.argmax())
            continue
        closest = float(distance.min())
        if math.isinf(closest):  # the guard never held again
            everywhere = np.full(len(usable), True)
            closest = float(waypoint_distance(sampler, everywhere, waypoint)[start:].min())
        missing = max(closest - judgement.tolerance.value, 0.0)
        return _Lead(-missing - _route(waypoints[index:]), waypoint.id, waypoint=waypoint.id)
    return _Lead(-LEAST)


def _route(waypoints: Sequence[Waypoint]) -> float:
    """Return the length [m] of the straight legs between waypoints."""
    return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in itertools.pairwise(waypoints))


def _extreme(found: PredicateSeries, allowed: SampleMask, *, largest: bool) -> _Lead:
    """Return the largest or smallest margin among samples, and the object it is about."""
    if not allowed.any():
        return _Lead(-math.inf if largest else math.inf)
    margin = np.where(allowed, found.margin, -math.inf if largest else math.inf)
    index = int(margin.argmax() if largest else margin.argmin())
    about = found.clauses[found.decided[index]].value.object_at(index)
    return _Lead(float(margin[index]), about, index)
