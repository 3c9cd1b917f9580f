"""Leading margins: how near a run came to failing by an oracle, for searches.

A verdict's margin is flat until its event happens: ``never(contact)`` has the same margin whether
the robot passed a box at 30 cm or at 2 cm. A leading margin has the verdict's sign and continues
there. No verdict and no trace contains leading margins.

- ``always``, ``never``, ``eventually``, ``until``, ``whenever``: quantitative semantics over
  signals that lead. At every sample a clause keeps the sign that it has for the verdict. If the
  units of clauses differ, each is divided by its scale. For a release that never came: the smallest
  distance to it.
- ``time``, ``longest``, ``fraction``, ``count``: the verdict's margin. While the amount is 0, or
  the condition always holds, the smallest distance to a change is added.
- ``max``, ``min``, ``median``, ``final``, ``p95``: of the signal that leads; ``mean``: as judged.
- ``reached``: the way missing to the first unreached waypoint, and the legs behind it.
- Plug-in oracles: the verdict's.

Signals that lead where those of the oracle language are flat: the clearance leads to ``contact``,
and the depth once the robot touches. The way to the border of the place leads to ``in``, the
remainder of two standard deviations to ``loc.inside_2sigma``. ``contact.depth`` and ``distance``
continue below 0.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Final, NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon

from daemon.judging.leading_kind import (
    clause_scale,
    has_unlike_units,
    leading_unit,
    predicate_scale,
    predicate_unit,
)
from daemon.judging.oracles._clearance import nearest_polygons, place_outline
from daemon.judging.oracles._judge import bind_oracle, judge, written_oracle
from daemon.judging.oracles._obstacles import footprint_box, obstacles_named
from daemon.judging.oracles._operators import (
    judge_response,
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
from daemon.judging.oracles._sampler import SignalSampler
from daemon.judging.oracles._series import SignalSeries
from daemon.judging.oracles._validity import trace_problems
from daemon.model.spec import LeadingMargin, OracleText
from daemon.model.verdicts import Evidence, MarginInterval, Outcome, Verdict
from daemon.trace import Trace
from grammars.model.geometry import Floats, Ring
from grammars.model.mission import Waypoint
from grammars.oracle import (
    Amount,
    Oracle,
    Reached,
    Response,
    Signal,
    Statistic,
    Temporal,
    Until,
    obstacle_names,
    thing_of,
)
from grammars.text.expressions import Comparison, Expression, Function

_LEAST: Final = 1e-6
"""The smallest leading margin [SI] that is not 0: a touch without depth fails by this much."""
_NEAR: Final = 0.5
"""Distance [m] up to which the outline of the robot counts instead of the box around it."""


class _Lead(NamedTuple):
    """A margin before it gets the verdict's sign, its evidence and its ``waypoint``, if any."""

    margin: float
    evidence: Evidence
    waypoint: str = ""


def judge_leading(
    trace: Trace, oracles: Sequence[OracleText]
) -> tuple[tuple[Verdict, ...], tuple[LeadingMargin, ...]]:
    """Judge ``trace`` by each oracle, in order; add the leading margins of oracles with a limit.

    The verdicts are those of :func:`daemon.judging.oracles.judge`. A leading margin is negative
    exactly if the verdict is ``fail``. It is ``None`` for ``error`` and ``inconclusive``, and for a
    passing run without anything to come near to. Nothing is raised.
    """
    sampler = None if trace_problems(trace) else SignalSampler(trace)
    verdicts = judge(trace, oracles, sampler=sampler)
    margins = []
    for text, verdict in zip(oracles, verdicts, strict=True):
        oracle = written_oracle(text)
        if verdict.outcome is Outcome.MEASURE or (oracle is not None and oracle.is_measure):
            continue
        if sampler is None or verdict.outcome not in (Outcome.PASS, Outcome.FAIL):
            margins.append(LeadingMargin(text.name, None, _unit_or_empty(oracle)))
        else:
            margins.append(_leading_margin(text, verdict, sampler))
    return verdicts, tuple(margins)


def _unit_or_empty(oracle: Oracle | None) -> str:
    """Return the unit of an oracle, empty for an unreadable one."""
    try:
        return "" if oracle is None else leading_unit(oracle)
    except ValueError:  # an unusable plug-in
        return ""


def _leading_margin(text: OracleText, verdict: Verdict, sampler: SignalSampler) -> LeadingMargin:
    # The verdict shows that the oracle is usable, and the sampler keeps the signals of plug-ins.
    oracle = bind_oracle(text, sampler.trace)
    lead = _lead(oracle, verdict, sampler)
    lead = lead or _Lead(_verdict_margin(verdict), verdict.evidence)
    about = lead.evidence.object or verdict.evidence.object
    moment = verdict.evidence.time if lead.evidence.time is None else lead.evidence.time
    waypoint = lead.waypoint or _waypoint_ahead(moment, sampler)
    return LeadingMargin(
        text.name, _signed(verdict, lead.margin), leading_unit(oracle), about, waypoint
    )


def _waypoint_ahead(moment: float | None, sampler: SignalSampler) -> str:
    """Return the reported waypoint being approached at a moment [s], empty if there is none."""
    time = sampler.time_base.time
    if moment is None or not len(time):
        return ""
    index = max(int(np.searchsorted(time, moment + 1e-9, side="right")) - 1, 0)
    current, waypoints = sampler.current[index], sampler.trace.spec.mission.waypoints
    ahead = not math.isnan(current) and 0 <= current < len(waypoints)
    return waypoints[int(current)].id if ahead else ""


def _verdict_margin(verdict: Verdict) -> float:
    """Return the verdict's margin, infinite if it has none."""
    return math.inf if verdict.margin is None else verdict.margin


def _signed(verdict: Verdict, margin: float) -> float | None:
    """Return a margin with the sign of its verdict; ``None`` if a pass came near to nothing."""
    if verdict.outcome is Outcome.FAIL:
        return min(margin if math.isfinite(margin) else _verdict_margin(verdict), -_LEAST)
    # + 0.0 makes 0.0 of -0.0.
    return max(margin, 0.0) + 0.0 if math.isfinite(margin) else None


def _lead(oracle: Oracle, verdict: Verdict, sampler: SignalSampler) -> _Lead | None:
    """Return the margin that leads, ``None`` if it is the verdict's."""
    match oracle.judgement:
        case Temporal(predicate=predicate) as judgement:
            lead = _clause_lead(predicate, sampler)
            return _decisive(judge_temporal(oracle, judgement, sampler, lead))
        case Until() as judgement:
            return _lead_until(oracle, judgement, verdict, sampler)
        case Response(predicate=predicate) as judgement:
            lead = _clause_lead(predicate, sampler)
            return _decisive(judge_response(oracle, judgement, sampler, lead))
        case Amount() as judgement:
            return _lead_amount(oracle, judgement, verdict, sampler)
        case Statistic() as judgement:
            return _lead_statistic(oracle, judgement, sampler)
        case Reached() as judgement if verdict.outcome is Outcome.FAIL:
            return _lead_reached(oracle, judgement, sampler)
    return None


def _decisive(interval: MarginInterval) -> _Lead:
    """Return the known bound of an interval."""
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

    It is at least 0 where the clause holds, at most -:data:`_LEAST` where it does not, and NaN
    where that is unknown. It is infinite without anything to follow.
    """
    (evaluated,) = judged.clauses
    value, margin = evaluated.value, judged.margin
    if isinstance(clause, Comparison):
        left, right = (_leading_quantity(side, sampler) for side in (clause.left, clause.right))
        if left is not None or right is not None:
            left = left or evaluate_quantity(clause.left, sampler)
            right = right or evaluate_quantity(clause.right, sampler)
            operator = NEGATED[clause.operator] if negated else clause.operator
            margin = margin_of(operator, left.values, right.values)
            value = left if left.objects is not None else right
    elif isinstance(clause, Signal) and (flag := _leading_flag(clause, sampler)) is not None:
        value, margin = flag, -flag.values if negated else flag.values
    margin = _with_sign(margin, judged.margin)
    if shares:
        # A failure must remain one after division by a large scale.
        margin = _with_sign(margin / clause_scale(clause, sampler.trace.spec.robot), margin)
    return PredicateSeries(margin, judged.decided, (replace(evaluated, value=value),))


def _with_sign(margin: Floats, judged: Floats) -> Floats:
    """Return ``margin`` with the sign of ``judged``, NaN where ``judged`` is NaN."""
    signed = np.where(judged >= 0.0, np.maximum(margin, 0.0), np.minimum(margin, -_LEAST))
    return np.where(np.isnan(judged), np.nan, signed)


def _lead_until(
    oracle: Oracle, judgement: Until, verdict: Verdict, sampler: SignalSampler
) -> _Lead:
    """Lead to a violation before the release, or to a release that never came."""
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
    # The verdict has the unit of the predicate, so the distance to the release is converted by the
    # scales of both.
    robot = sampler.trace.spec.robot
    factor = predicate_scale(predicate, robot) / predicate_scale(release, robot)
    return nearest._replace(margin=nearest.margin * factor)


def _lead_amount(
    oracle: Oracle, judgement: Amount, verdict: Verdict, sampler: SignalSampler
) -> _Lead | None:
    """Lead to a change of the condition if it held never or all the time."""
    predicate, limit = judgement.predicate, judgement.limit
    if limit is None or limit.operator in ("==", "!="):
        return None
    judged = evaluate_predicate(predicate, sampler).margin
    allowed = scope_of(oracle, sampler, window_of(oracle, sampler), judged).allowed
    holds = judged[allowed] >= 0.0
    never, always = not holds.any(), bool(holds.all())
    # A condition that holds all the time counts once; to count again it must end first.
    if not never and (not always or judgement.operator == "count"):
        return None
    condition = Temporal("eventually" if never else "always", predicate)
    lead = _clause_lead(predicate, sampler)
    nearest = _decisive(judge_temporal(oracle, condition, sampler, lead))
    sign = 1.0 if limit.operator in (">=", ">") else -1.0
    return nearest._replace(margin=_verdict_margin(verdict) + sign * nearest.margin)


def _lead_statistic(oracle: Oracle, judgement: Statistic, sampler: SignalSampler) -> _Lead | None:
    """Lead below the 0 at which a depth or a distance stops."""
    signal = _leading_quantity(judgement.signal, sampler)
    if signal is None:
        return None
    if judgement.operator == "mean":
        plain = evaluate_quantity(judgement.signal, sampler).values
        allowed = scope_of(oracle, sampler, window_of(oracle, sampler), plain).allowed
        if plain[allowed].any():
            return None
        # While all values are 0, take the one nearest to a change.
        below = bool((signal.values[allowed] <= 0.0).all())
        judgement = replace(judgement, operator="max" if below else "min")
    return _decisive(judge_statistic(oracle, judgement, sampler, signal))


def _lead_reached(oracle: Oracle, judgement: Reached, sampler: SignalSampler) -> _Lead:
    """Return minus the missing way [m], straight from waypoint to waypoint."""
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


def _leading_flag(signal: Signal, sampler: SignalSampler) -> SignalSeries | None:
    """Return the length [m] that leads to a true-or-false signal; ``None`` if there is none.

    It is larger the truer the signal is.
    """
    match signal.name:
        case "contact":
            return _contact(_thing(signal), sampler)
        case "loc.inside_2sigma":
            return sampler.localisation.inside_margin()
        case "in":
            return _inside(signal, sampler)
    return None


def _leading_quantity(expression: Expression, sampler: SignalSampler) -> SignalSeries | None:
    """Return a signal continued below 0, ``None`` if it is not flat there.

    It must stand alone: below 0 a product or a magnitude would change its meaning.
    """
    match expression:
        case Function(name="-", operands=(operand,)):
            signal = _leading_quantity(operand, sampler)
            if signal is not None:
                return SignalSeries(-signal.values, signal.objects, signal.names, signal.note)
        case Signal(name="contact.depth"):
            return _contact(_thing(expression), sampler)
        case Signal(name="distance"):
            return _distance(expression, sampler)
    return None


def _thing(signal: Signal) -> str:
    thing = thing_of(signal)
    return thing.name if thing is not None else ""


def _contact(thing: str, sampler: SignalSampler) -> SignalSeries:
    """Return the depth [m] in contact, otherwise minus the clearance; -inf without obstacles."""
    named = (Signal(thing),) if thing else ()
    touched = sampler.sample(Signal("contact.depth", named))
    objects = touched.objects
    if objects is None:
        raise TypeError("contacts are always with something")
    touching = objects >= 0
    near = sampler.sample(Signal("clearance", named))
    clear = _refine(near, thing, sampler)
    # The recorded contact decides: one between two samples may be over at the next one, and the
    # physics lets things overlap a little before it reports a contact.
    values = np.where(touching, touched.values, -np.maximum(clear.values, 0.0))
    values = np.where(np.isnan(values), -np.inf, values)
    if clear.objects is None:
        return SignalSeries(values, objects, touched.names)
    nearest = np.where(clear.objects >= 0, clear.objects + len(touched.names), -1)
    both = np.where(touching, objects, nearest).astype(np.int32)
    return SignalSeries(values, both, (*touched.names, *clear.names))


def _distance(signal: Signal, sampler: SignalSampler) -> SignalSeries:
    """Return the distance [m], or minus the depth of contact where the distance is 0."""
    sampled, thing = sampler.sample(signal), _thing(signal)
    if thing not in obstacle_names(sampler.trace.scene):
        return sampled
    depth = sampler.sample(Signal("contact.depth", (Signal(thing),))).values
    values = np.where(sampled.values > 0.0, sampled.values, -depth + 0.0 * sampled.values)
    return SignalSeries(values, sampled.objects, sampled.names, sampled.note)


def _inside(signal: Signal, sampler: SignalSampler) -> SignalSeries:
    """Return the depth [m] of the robot's base in a place, negative outside."""
    sampled = sampler.sample(signal)
    border = Polygon(place_outline(sampler.trace.scene, _thing(signal))).exterior
    away = shapely.distance(shapely.points(sampler.poses[:, :2]), border)
    return SignalSeries(np.where(sampled.values > 0.0, away, -away), sampled.objects, sampled.names)


def _refine(near: SignalSeries, thing: str, sampler: SignalSampler) -> SignalSeries:
    """Return the clearance of the robot's outline instead of that of the box around it.

    Both are the same if the outline is a box; otherwise only near obstacles differ. The result
    grows with both, so that a nearer robot never has the larger value.
    """
    footprint = sampler.trace.spec.robot.footprint
    close = np.flatnonzero(near.values < _NEAR)
    if _is_box(footprint) or not len(close):
        return near
    obstacles = obstacles_named(sampler.obstacles, thing) if thing else sampler.obstacles
    values, objects = near.values.copy(), np.array(near.objects)
    # The outline is nowhere nearer than the box around it, so _NEAR limits it too.
    away, owner = nearest_polygons(obstacles, footprint, sampler.poses, close, reach=_NEAR)
    values[close], within = np.minimum(away, _NEAR), owner >= 0
    objects[close[within]] = owner[within]
    return SignalSeries(values, objects, near.names, near.note)


def _is_box(footprint: Ring) -> bool:
    """Return whether a footprint is the box around it."""
    _, (hx, hy) = footprint_box(footprint)
    return abs(Polygon(footprint).area - 4.0 * hx * hy) < 1e-9
