"""Expressions and predicates over sampled signals, and the part of a run an oracle judges.

A predicate becomes a margin per sample: >= 0 where it holds, < 0 where it does not, NaN where it is
unknown. Negations are pushed down to the comparisons, so that ``<`` and ``<=`` keep their exact
meaning. An oracle judges a whole run, or the leg of one waypoint.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.judging.oracles._sampler import SignalSampler
from daemon.judging.oracles._series import ObjectIndices, SignalSeries, TimeBase
from grammars.model.geometry import Floats
from grammars.oracle import Leg, Oracle, Signal, kind_of, leg_number, margin_kind
from grammars.text.expressions import (
    Arithmetic,
    Comparison,
    Expression,
    Function,
    Logic,
    Not,
    Number,
    fold,
    render,
)

SampleMask = npt.NDArray[np.bool_]

VACUOUS = "vacuous: the guard never held"

JUST_BELOW: Final = -float(np.finfo(np.float64).tiny)
"""Margin of a strict comparison whose sides are equal: it fails by the smallest number."""

NEGATED: Final = {"<=": ">", "<": ">=", ">=": "<", ">": "<=", "==": "!=", "!=": "=="}


@dataclass(frozen=True, slots=True, eq=False)
class PredicateClause:
    """A comparison or a true-or-false signal inside a predicate, with its sampled sides."""

    text: str
    unit: str
    value: SignalSeries
    limit: Floats | None


@dataclass(frozen=True, slots=True, eq=False)
class PredicateSeries:
    """A predicate on the time base: ``margin`` (n,), and the index of the deciding clause (n,)."""

    margin: Floats
    decided: ObjectIndices
    clauses: tuple[PredicateClause, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the signals of its clauses, each once."""
        return tuple(dict.fromkeys(c.value.note for c in self.clauses if c.value.note))


ClauseLead: TypeAlias = Callable[[Expression, PredicateSeries, bool], PredicateSeries]
"""Turns an evaluated, perhaps negated, clause into one whose margins can be compared with those of
the other clauses of its predicate."""


def unit_of_margin(predicate: Expression) -> str:
    """Return the unit of a predicate's margin; empty if it is only true or false."""
    kind = margin_kind(predicate)
    return "" if kind is None else kind.unit


def evaluate_predicate(
    predicate: Expression,
    sampler: SignalSampler,
    *,
    negated: bool = False,
    lead: ClauseLead | None = None,
) -> PredicateSeries:
    """Evaluate a checked predicate, or its negation, on the time base.

    ``lead`` changes each clause.
    """
    match predicate:
        case Not(operand=operand):
            return evaluate_predicate(operand, sampler, negated=not negated, lead=lead)
        case Logic(operator=word, operands=operands):
            parts = [
                evaluate_predicate(operand, sampler, negated=negated, lead=lead)
                for operand in operands
            ]
            comparable = lead is not None or margin_kind(predicate) is not None
            return _combine_predicates(
                parts, every=(word == "and") != negated, comparable=comparable
            )
        case Comparison():
            clause = _evaluate_comparison(predicate, sampler, negated)
        case _:
            clause = _evaluate_flag(predicate, sampler, negated)
    return clause if lead is None else lead(predicate, clause, negated)


def evaluate_quantity(expression: Expression, sampler: SignalSampler) -> SignalSeries:
    """Evaluate a checked quantity on the time base; division by zero is unknown (NaN)."""

    def visit(part: Expression, sides: Sequence[SignalSeries]) -> SignalSeries:
        match part:
            case Number(value=value):
                return SignalSeries(np.full(len(sampler.time_base.time), value))
            case Signal():
                return sampler.sample(part)
            case Function(name="min" | "max" as name):
                return _extreme(name, sides)
            case Function(name=name):
                (side,) = sides
                values = -side.values if name == "-" else np.abs(side.values)
                return SignalSeries(values, side.objects, side.names, side.note)
            case Arithmetic(operator=operator):
                return _arithmetic(operator, *sides)
        raise TypeError(f"{render(part)} is not a quantity")

    return fold(expression, visit)


def _arithmetic(operator: str, left: SignalSeries, right: SignalSeries) -> SignalSeries:
    a, b = left.values, right.values
    match operator:
        case "+":
            values = a + b
        case "-":
            values = a - b
        case "*":
            values = a * b
        case _:
            values = np.divide(a, b, out=np.full(len(a), np.nan), where=b != 0.0)
    about = left if left.objects is not None else right
    return SignalSeries(values, about.objects, about.names, _notes((left, right)))


def _extreme(name: str, sides: Sequence[SignalSeries]) -> SignalSeries:
    """Return the smallest or largest of some series, with the object of that one."""
    values = np.stack([side.values for side in sides])
    # numpy takes an unknown value (NaN) for the extreme one, as it should be here.
    extreme = values.argmin(axis=0) if name == "min" else values.argmax(axis=0)
    picked = (extreme, np.arange(values.shape[1]))
    names: tuple[str, ...] = ()
    objects = []
    for side in sides:
        own = np.full(values.shape[1], -1) if side.objects is None else side.objects
        objects.append(np.where(own >= 0, own + len(names), -1))
        names += side.names
    owners = np.stack(objects)[picked].astype(np.int32) if names else None
    return SignalSeries(values[picked], owners, names, _notes(sides))


def _notes(sides: Sequence[SignalSeries]) -> str:
    return "; ".join(dict.fromkeys(side.note for side in sides if side.note))


def margin_of(operator: str, value: Floats, limit: Floats) -> Floats:
    """Return the signed margin of ``value operator limit``, elementwise: >= 0 iff it holds."""
    match operator:
        case "<=" | "<":
            margin = limit - value
        case ">=" | ">":
            margin = value - limit
        case "==":
            margin = 0.0 - np.abs(value - limit)
        case _:
            margin = np.abs(value - limit)
    # The sign alone tells whether it holds, even if the sides of a strict comparison are equal.
    if operator in ("<", ">", "!="):
        margin = np.where(margin == 0.0, JUST_BELOW, margin)
    return margin + 0.0  # makes 0.0 of -0.0


def _evaluate_comparison(
    comparison: Comparison, sampler: SignalSampler, negated: bool
) -> PredicateSeries:
    left, right = (
        evaluate_quantity(comparison.left, sampler),
        evaluate_quantity(comparison.right, sampler),
    )
    operator = NEGATED[comparison.operator] if negated else comparison.operator
    if left.objects is None and right.objects is not None:
        left = SignalSeries(left.values, right.objects, right.names, left.note)
    margin = margin_of(operator, left.values, right.values)
    kind = kind_of(comparison.left)
    clause = PredicateClause(render(comparison), kind.unit if kind else "", left, right.values)
    return PredicateSeries(margin, np.zeros(len(margin), dtype=np.int32), (clause,))


def _evaluate_flag(signal: Expression, sampler: SignalSampler, negated: bool) -> PredicateSeries:
    if not isinstance(signal, Signal):
        raise TypeError(f"{render(signal)} is not true or false")
    sampled = sampler.sample(signal)
    margin = 2.0 * sampled.values - 1.0
    clause = PredicateClause(render(signal), "", sampled, None)
    decided = np.zeros(len(margin), dtype=np.int32)
    return PredicateSeries(-margin if negated else margin, decided, (clause,))


def _combine_predicates(
    parts: list[PredicateSeries], *, every: bool, comparable: bool
) -> PredicateSeries:
    """Join predicates by ``and`` (``every``) or ``or``, in Kleene's three-valued logic.

    Only the signs of margins in different units count.
    """
    # ``and`` is the minimum of margins and ``or`` the maximum, as in robust semantics of temporal
    # logic; an unknown one leaves the result unknown unless the others settle it.
    margins = np.stack([p.margin if comparable else _sign(p.margin) for p in parts])
    unknown = np.isnan(margins)
    bounds = np.where(unknown, np.inf if every else -np.inf, margins)
    winner = bounds.argmin(axis=0) if every else bounds.argmax(axis=0)
    columns = np.arange(margins.shape[1])
    margin = bounds[winner, columns]
    settled = (margin < 0.0) if every else (margin >= 0.0)
    margin = np.where(unknown.any(axis=0) & ~settled, np.nan, margin)
    shifts = np.cumsum([0, *(len(p.clauses) for p in parts[:-1])])
    decided = np.stack([p.decided + shift for p, shift in zip(parts, shifts, strict=True)])
    clauses = tuple(clause for part in parts for clause in part.clauses)
    return PredicateSeries(margin, decided[winner, columns].astype(np.int32), clauses)


def _sign(margin: Floats) -> Floats:
    return np.where(np.isnan(margin), np.nan, np.where(margin >= 0.0, 1.0, -1.0))


@dataclass(frozen=True, slots=True, eq=False)
class JudgedWindow:
    """Samples (n,) ``inside`` the judged part of a run, and its unknown rest.

    ``start`` and ``end`` [s] span the recorded part. A ``closed`` window is complete; otherwise up
    to ``remaining`` seconds may follow. ``absent`` says why the window is empty, if it is.
    """

    inside: SampleMask
    start: float
    end: float
    closed: bool
    remaining: float
    absent: str = ""

    @property
    def cut(self) -> str:
        """A note that more is to come, empty if the window is closed."""
        return "" if self.closed else f"the trace ends at {self.end:.2f} s, before the run"


@dataclass(frozen=True, slots=True, eq=False)
class JudgedSamples:
    """Samples to judge (n,), the ``reason`` if there are none, and a note when they begin."""

    allowed: SampleMask
    reason: str
    note: str


def window_of(oracle: Oracle, sampler: SignalSampler) -> JudgedWindow:
    """Return the part of the run that ``oracle`` judges."""
    time_base = sampler.time_base
    if oracle.leg is None:
        everything = np.full(len(time_base.time), True)
        return JudgedWindow(
            everything, time_base.start, time_base.end, time_base.closed, time_base.remaining
        )
    return _leg_window(oracle.leg, sampler, time_base)


def _leg_window(leg: Leg, sampler: SignalSampler, time_base: TimeBase) -> JudgedWindow:
    """Return the first unbroken time in which the robot approaches the leg's waypoint.

    A later return does not count: otherwise a leg would never be over for certain.
    """
    number = leg_number(leg, sampler.trace.spec.mission)
    # The system under test decides when a waypoint is done, so its report counts, not a distance.
    on_leg = sampler.current == number - 1
    first = int(on_leg.argmax()) if on_leg.any() else len(on_leg)
    departures = np.flatnonzero(~on_leg[first:])
    last = first + int(departures[0]) if len(departures) else len(on_leg)
    inside = np.zeros(len(on_leg), dtype=np.bool_)
    inside[first:last] = True
    if last < len(on_leg):
        return JudgedWindow(
            inside, float(time_base.time[first]), float(time_base.time[last]), True, 0.0
        )
    start = float(time_base.time[first]) if first < len(on_leg) else time_base.end
    absent = "" if on_leg.any() else f"vacuous: {leg} was never begun"
    return JudgedWindow(inside, start, time_base.end, time_base.closed, time_base.remaining, absent)


def scope_of(
    oracle: Oracle, sampler: SignalSampler, window: JudgedWindow, values: Floats
) -> JudgedSamples:
    """Return the samples in ``window`` where the guard holds and ``values`` (n,) are known."""
    time = sampler.time_base.time
    is_known = window.inside & ~np.isnan(values)
    if not len(time):
        return JudgedSamples(is_known, "nothing was recorded", "")
    if window.absent:
        return JudgedSamples(is_known, window.absent, "")
    first = int(is_known.argmax())
    is_late = is_known.any() and first > int(window.inside.argmax())
    note = f"known from {time[first]:.2f} s on" if is_late else ""
    reason = "what it speaks of was not recorded"
    if oracle.guard is None:
        return JudgedSamples(is_known, reason, note)
    guard = evaluate_predicate(oracle.guard, sampler).margin
    holds = window.inside & (guard >= 0.0)
    return JudgedSamples(is_known & holds, reason if holds.any() else VACUOUS, note)
