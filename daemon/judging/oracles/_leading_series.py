"""Predicates as margins that lead, sample by sample: quantitative semantics over leading signals.

A clause has the sign that it has for the verdict, at every sample; ``and`` is the minimum and
``or`` the maximum. Where clauses are measured in different units, each is divided by its scale.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from daemon.judging.oracles._leading_kind import clause_scale, clauses_of, has_unlike_units
from daemon.judging.oracles._leading_signals import (
    has_leading_quantity,
    leading_flag,
    leading_quantity,
)
from daemon.judging.oracles._predicate import (
    NEGATED,
    PredicateSeries,
    combine_predicates,
    evaluate_predicate,
    evaluate_quantity,
    margin_of,
)
from daemon.judging.oracles._sampler import SignalSampler
from grammars.model.geometry import Floats
from grammars.oracle import Comparison, Expression, Logic, Not, Signal

LEAST: Final = 1e-6
"""The smallest leading margin [SI] that is not 0: a touch without depth is a failure by so much."""


def leading_series(
    predicate: Expression, sampler: SignalSampler, *, negated: bool = False
) -> PredicateSeries:
    """Evaluate a checked predicate, or its negation, as a margin that leads.

    At least 0 where it holds and at most -:data:`LEAST` where it does not, NaN where that is not
    known; infinite where there is nothing to be led by.
    """
    return _evaluate(predicate, sampler, negated, has_unlike_units(predicate))


def leads_further(predicate: Expression) -> bool:
    """Whether the leading margin of a predicate is another one than that of the verdict."""
    return has_unlike_units(predicate) or any(
        has_leading_quantity(clause.left) or has_leading_quantity(clause.right)
        if isinstance(clause, Comparison)
        else True
        for clause in clauses_of(predicate)
    )


def _evaluate(
    predicate: Expression, sampler: SignalSampler, negated: bool, shares: bool
) -> PredicateSeries:
    match predicate:
        case Not(operand=operand):
            return _evaluate(operand, sampler, not negated, shares)
        case Logic(operator=word, operands=operands):
            parts = [_evaluate(operand, sampler, negated, shares) for operand in operands]
            return combine_predicates(parts, every=(word == "and") != negated, comparable=True)
    found = _clause(predicate, sampler, negated)
    if not shares:
        return found
    scale = clause_scale(predicate, sampler.trace.spec.robot)
    # Divided by a large scale a failure must remain one.
    return replace(found, margin=_with_sign(found.margin / scale, found.margin))


def _clause(clause: Expression, sampler: SignalSampler, negated: bool) -> PredicateSeries:
    """Evaluate a comparison or a true-or-false signal."""
    judged = evaluate_predicate(clause, sampler, negated=negated)
    led, margin = judged.clauses[0].value, judged.margin
    if isinstance(clause, Comparison):
        left, right = (
            leading_quantity(clause.left, sampler),
            leading_quantity(clause.right, sampler),
        )
        if left is not None or right is not None:
            one = left or evaluate_quantity(clause.left, sampler)
            other = right or evaluate_quantity(clause.right, sampler)
            operator = NEGATED[clause.operator] if negated else clause.operator
            margin = margin_of(operator, one.values, other.values)
            led = one if one.objects is not None else other
    elif isinstance(clause, Signal):
        found = leading_flag(clause, sampler)
        if found is not None:
            led, margin = found, -found.values if negated else found.values
    (said,) = judged.clauses
    return PredicateSeries(
        _with_sign(margin, judged.margin), judged.decided, (replace(said, value=led),)
    )


def _with_sign(margin: Floats, judged: Floats) -> Floats:
    """Return ``margin`` with the sign of ``judged``, NaN where that is."""
    signed = np.where(judged >= 0.0, np.maximum(margin, 0.0), np.minimum(margin, -LEAST))
    return np.where(np.isnan(judged), np.nan, signed)
