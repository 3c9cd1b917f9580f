"""Leading margins: how near a run was to failing by an oracle, for those who search for failures.

A verdict's margin is flat where nothing of what it speaks of happened: ``never(contact)`` has the
same one whether the robot passed a box at 30 cm or at 2 cm. A leading margin has the verdict's sign
and goes on where that stops. No verdict and no trace contains any of it.

- ``always``, ``never``, ``eventually``, ``until``: quantitative semantics over signals that lead. A
  clause has the sign that it has for the verdict, at every sample; where clauses are measured in
  different units, each is divided by its scale. A release that never came: the smallest distance
  to it.
- ``time``, ``longest``, ``fraction``, ``count``: the verdict's margin, and while the amount is 0
  also the smallest distance to the condition; likewise while it holds all the time.
- ``max``, ``min``, ``median``, ``final``, ``p95``: of the signal that leads; ``mean``: as judged.
- ``reached``: what was missing to the first waypoint that was not reached, and the legs behind it.
- Oracles that plug in: the verdict's.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from daemon.judging.leading_kind import (
    clause_scale,
    has_unlike_units,
    leading_unit,
    predicate_scale,
    predicate_unit,
)
from daemon.judging.oracles._judge import bind_oracle, judge, written_oracle
from daemon.judging.oracles._leading_signals import leading_flag, leading_quantity
from daemon.judging.oracles._operators import (
    judge_statistic,
    judge_temporal,
    judge_until,
    usable_visits,
    waypoint_distance,
)
from daemon.judging.oracles._predicate import (
    NEGATED,
    ClauseLead,
    PredicateSeries,
    evaluate_predicate,
    evaluate_quantity,
    margin_of,
    scope_of,
    window_of,
)
from daemon.judging.oracles._sampler import PluginError, SignalSampler
from daemon.judging.oracles._validity import trace_problems
from daemon.model.spec import LeadingMargin, OracleText
from daemon.model.verdicts import Evidence, MarginInterval, Outcome, Verdict
from daemon.trace import Trace
from grammars.model.geometry import Floats
from grammars.model.mission import Waypoint
from grammars.oracle import Amount, Oracle, Reached, Signal, Statistic, Temporal, Until
from grammars.text.diagnostics import InputError
from grammars.text.expressions import Comparison, Expression

_LEAST: Final = 1e-6
"""The smallest leading margin [SI] that is not 0: a touch without depth is a failure by so much."""


class _Lead(NamedTuple):
    """A margin before it gets the verdict's sign, and the evidence for it.

    ``waypoint`` is the one it is about, if it is about one.
    """

    margin: float
    evidence: Evidence
    waypoint: str = ""


def judge_leading(
    trace: Trace, oracles: Sequence[OracleText]
) -> tuple[tuple[Verdict, ...], tuple[LeadingMargin, ...]]:
    """Judge ``trace`` by each oracle, in order; return the leading margin of each with a limit too.

    The verdicts are those of :func:`daemon.judging.oracles.judge`. A leading margin is negative
    exactly where the verdict is ``fail``; it is ``None`` where that is ``error`` or
    ``inconclusive``, and where a run that passes says nothing (there is nothing to run into).
    Nothing is raised.
    """
    sampler = None if trace_problems(trace) else SignalSampler(trace)
    verdicts = judge(trace, oracles, sampler=sampler)
    margins = []
    for written, verdict in zip(oracles, verdicts, strict=True):
        oracle = written_oracle(written)
        if verdict.outcome is Outcome.MEASURE or (oracle is not None and oracle.is_measure):
            continue
        if sampler is None or verdict.outcome not in (Outcome.PASS, Outcome.FAIL):
            margins.append(LeadingMargin(written.name, None, _unit_or_nothing(oracle)))
        else:
            margins.append(_leading_margin(written, verdict, sampler))
    return verdicts, tuple(margins)


def _unit_or_nothing(oracle: Oracle | None) -> str:
    """Return the unit of an oracle that may not have been understood."""
    try:
        return "" if oracle is None else leading_unit(oracle)
    except ValueError:  # a plug-in that cannot be used
        return ""


def _leading_margin(written: OracleText, verdict: Verdict, sampler: SignalSampler) -> LeadingMargin:
    lead = None
    try:
        oracle = bind_oracle(written, sampler.trace)
        unit = leading_unit(oracle)
        lead = _lead(oracle, verdict, sampler)
    except (InputError, PluginError, ValueError):
        # The verdict is there, so it is a plug-in that answers differently when asked again.
        unit = verdict.unit
    lead = lead or _Lead(_verdict_margin(verdict), verdict.evidence)
    about = lead.evidence.object or verdict.evidence.object
    moment = verdict.evidence.time if lead.evidence.time is None else lead.evidence.time
    waypoint = lead.waypoint or _waypoint_ahead(moment, sampler)
    return LeadingMargin(written.name, _signed(verdict, lead.margin), unit, about, waypoint)


def _waypoint_ahead(moment: float | None, sampler: SignalSampler) -> str:
    """Return the waypoint being approached at a moment [s], as reported; or nothing."""
    time = sampler.time_base.time
    if moment is None or not len(time):
        return ""
    index = max(int(np.searchsorted(time, moment + 1e-9, side="right")) - 1, 0)
    current, waypoints = sampler.current[index], sampler.trace.spec.mission.waypoints
    ahead = not math.isnan(current) and 0 <= current < len(waypoints)
    return waypoints[int(current)].id if ahead else ""


def _verdict_margin(verdict: Verdict) -> float:
    """Return the verdict's margin, infinite where it has none."""
    return math.inf if verdict.margin is None else verdict.margin


def _signed(verdict: Verdict, margin: float) -> float | None:
    """Return a margin with the sign of its verdict; ``None``: passed, nothing to be near to."""
    if verdict.outcome is Outcome.FAIL:
        return min(margin if math.isfinite(margin) else _verdict_margin(verdict), -_LEAST)
    # + 0.0 makes 0.0 of -0.0.
    return max(margin, 0.0) + 0.0 if math.isfinite(margin) else None


def _lead(oracle: Oracle, verdict: Verdict, sampler: SignalSampler) -> _Lead | None:
    """Return the margin that leads, ``None`` where that is the verdict's."""
    match oracle.judgement:
        case Temporal(predicate=predicate) as judgement:
            lead = _clause_lead(predicate, sampler)
            return _decisive(judge_temporal(oracle, judgement, sampler, lead))
        case Until() as judgement:
            return _lead_until(oracle, judgement, verdict, sampler)
        case Amount() as judgement:
            return _lead_amount(oracle, judgement, verdict, sampler)
        case Statistic() as judgement:
            return _lead_statistic(oracle, judgement, sampler)
        case Reached() as judgement if verdict.outcome is Outcome.FAIL:
            return _lead_reached(oracle, judgement, sampler)
    return None


def _decisive(interval: MarginInterval) -> _Lead:
    """Return the bound of an interval that is known."""
    margin = interval.upper if math.isinf(interval.lower) else interval.lower
    return _Lead(margin, interval.evidence)


def _clause_lead(predicate: Expression, sampler: SignalSampler) -> ClauseLead:
    return partial(_lead_clause, sampler, has_unlike_units(predicate))


def _lead_clause(
    sampler: SignalSampler,
    shares: bool,
    clause: Expression,
    judged: PredicateSeries,
    negated: bool,
) -> PredicateSeries:
    """Return a comparison or a true-or-false signal as a margin that leads, or a share of it.

    At least 0 where it holds and at most -:data:`_LEAST` where it does not, NaN where that is not
    known; infinite where there is nothing to be led by.
    """
    (evaluated,) = judged.clauses
    value, margin = evaluated.value, judged.margin
    if isinstance(clause, Comparison):
        left, right = (leading_quantity(side, sampler) for side in (clause.left, clause.right))
        if left is not None or right is not None:
            left = left or evaluate_quantity(clause.left, sampler)
            right = right or evaluate_quantity(clause.right, sampler)
            operator = NEGATED[clause.operator] if negated else clause.operator
            margin = margin_of(operator, left.values, right.values)
            value = left if left.objects is not None else right
    elif isinstance(clause, Signal) and (flag := leading_flag(clause, sampler)) is not None:
        value, margin = flag, -flag.values if negated else flag.values
    margin = _with_sign(margin, judged.margin)
    if shares:
        # Divided by a large scale a failure must remain one.
        margin = _with_sign(margin / clause_scale(clause, sampler.trace.spec.robot), margin)
    return PredicateSeries(margin, judged.decided, (replace(evaluated, value=value),))


def _with_sign(margin: Floats, judged: Floats) -> Floats:
    """Return ``margin`` with the sign of ``judged``, NaN where that is."""
    signed = np.where(judged >= 0.0, np.maximum(margin, 0.0), np.minimum(margin, -_LEAST))
    return np.where(np.isnan(judged), np.nan, signed)


def _lead_until(
    oracle: Oracle, judgement: Until, verdict: Verdict, sampler: SignalSampler
) -> _Lead:
    """Lead to what is forbidden before the release, or to a release that never came."""
    predicate, release = judgement.predicate, judgement.release
    lead = _clause_lead(predicate, sampler)
    worst = _decisive(judge_until(oracle, judgement, sampler, lead))
    if verdict.outcome is Outcome.PASS or worst.margin < 0.0:
        return worst
    awaited = Temporal("eventually", release, judgement.within)
    lead = _clause_lead(release, sampler)
    nearest = _decisive(judge_temporal(replace(oracle, guard=None), awaited, sampler, lead))
    if predicate_unit(predicate) == predicate_unit(release):
        return nearest
    # The verdict's unit is that of the predicate: the distance to the release is converted, by what
    # each of them is measured with.
    robot = sampler.trace.spec.robot
    factor = predicate_scale(predicate, robot) / predicate_scale(release, robot)
    return nearest._replace(margin=nearest.margin * factor)


def _lead_amount(
    oracle: Oracle, judgement: Amount, verdict: Verdict, sampler: SignalSampler
) -> _Lead | None:
    """Lead to the condition while the amount cannot change: it held never, or all the time."""
    predicate, limit = judgement.predicate, judgement.limit
    if limit is None or limit.operator in ("==", "!="):
        return None
    judged = evaluate_predicate(predicate, sampler).margin
    allowed = scope_of(oracle, sampler, window_of(oracle, sampler), judged).allowed
    holds = judged[allowed] >= 0.0
    never, always = not holds.any(), bool(holds.all())
    # A condition that holds all the time was met once: it counts once more only after it did not.
    if not never and (not always or judgement.operator == "count"):
        return None
    condition = Temporal("eventually" if never else "always", predicate)
    lead = _clause_lead(predicate, sampler)
    nearest = _decisive(judge_temporal(oracle, condition, sampler, lead))
    sign = 1.0 if limit.operator in (">=", ">") else -1.0
    return nearest._replace(margin=_verdict_margin(verdict) + sign * nearest.margin)


def _lead_statistic(oracle: Oracle, judgement: Statistic, sampler: SignalSampler) -> _Lead | None:
    """Lead below the 0 at which a depth or a distance stops."""
    signal = leading_quantity(judgement.signal, sampler)
    if signal is None:
        return None
    if judgement.operator == "mean":
        plain = evaluate_quantity(judgement.signal, sampler).values
        allowed = scope_of(oracle, sampler, window_of(oracle, sampler), plain).allowed
        if plain[allowed].any():
            return None
        # While all of it is 0, the nearest it came to anything else.
        below = bool((signal.values[allowed] <= 0.0).all())
        judgement = replace(judgement, operator="max" if below else "min")
    return _decisive(judge_statistic(oracle, judgement, sampler, signal))


def _lead_reached(oracle: Oracle, judgement: Reached, sampler: SignalSampler) -> _Lead:
    """Return minus the way [m] that was missing, straight from waypoint to waypoint."""
    usable, tolerance = usable_visits(oracle, sampler), judgement.tolerance.value
    ahead, start = list(sampler.trace.spec.mission.waypoints), 0
    while (distance := waypoint_distance(sampler, usable, ahead[0])[start:]).min() <= tolerance:
        start += int((distance <= tolerance).argmax())
        del ahead[0]
    closest = float(distance.min())
    if math.isinf(closest):  # the guard never held again
        everywhere = np.full(len(usable), True)
        closest = float(waypoint_distance(sampler, everywhere, ahead[0])[start:].min())
    missing = closest - tolerance
    waypoint = ahead[0].id
    return _Lead(-max(missing, 0.0) - _route(ahead), Evidence(object=waypoint), waypoint)


def _route(waypoints: Sequence[Waypoint]) -> float:
    """Return the length [m] of the straight legs between waypoints."""
    return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in itertools.pairwise(waypoints))
