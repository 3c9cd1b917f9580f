"""Expressions and predicates over sampled signals.

A predicate becomes a margin per sample: >= 0 where it holds, < 0 where it does not, NaN where it
cannot be known. Negations are pushed down to the comparisons, so that ``<`` and ``<=`` keep their
exact meaning.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from daemon.oracles._sampler import Sampler
from daemon.oracles._series import Codes, Series
from grammars.oracle import (
    Arithmetic,
    Comparison,
    Expression,
    Function,
    Logic,
    Not,
    Number,
    Signal,
    kind_of,
    margin_kind,
    render,
)
from grammars.values import Floats

JUST_BELOW: Final = -float(np.finfo(np.float64).tiny)
"""Margin of a strict comparison whose sides are equal: it does not hold, by nothing."""

_NEGATED: Final = {"<=": ">", "<": ">=", ">=": "<", ">": "<=", "==": "!=", "!=": "=="}


@dataclass(frozen=True, slots=True, eq=False)
class Clause:
    """A comparison or a true-or-false signal inside a predicate, with its sampled sides."""

    text: str
    unit: str
    value: Series
    limit: Floats | None


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """A predicate on the time base: ``margin`` (n,), and which clause decided (n,)."""

    margin: Floats
    decided: Codes
    clauses: tuple[Clause, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """Where the signals come from, each said once."""
        return tuple(dict.fromkeys(c.value.note for c in self.clauses if c.value.note))


def unit_of_margin(predicate: Expression) -> str:
    """Return the unit of a predicate's margin; empty when it only holds or not."""
    kind = margin_kind(predicate)
    return "" if kind is None else kind.unit


def truth(predicate: Expression, sampler: Sampler, *, negated: bool = False) -> Truth:
    """Evaluate a checked predicate, or its negation, on the time base."""
    match predicate:
        case Not(operand=operand):
            return truth(operand, sampler, negated=not negated)
        case Logic(operator=word, operands=operands):
            parts = [truth(operand, sampler, negated=negated) for operand in operands]
            comparable = margin_kind(predicate) is not None
            return _join(parts, every=(word == "and") != negated, comparable=comparable)
        case Comparison():
            return _compare(predicate, sampler, negated)
        case _:
            return _flag(predicate, sampler, negated)


def series(expression: Expression, sampler: Sampler) -> Series:
    """Evaluate a checked quantity on the time base; division by zero is unknown (NaN)."""
    match expression:
        case Number(value=value):
            return Series(np.full(len(sampler.timeline.time), value))
        case Signal():
            return sampler.sample(expression)
        case Function(name=name, operand=operand):
            inner = series(operand, sampler)
            values = -inner.values if name == "-" else np.abs(inner.values)
            return Series(values, inner.objects, inner.names, inner.note)
        case Arithmetic():
            return _arithmetic(expression, sampler)
        case _:
            raise TypeError(f"{render(expression)} is not a quantity")


def _arithmetic(expression: Arithmetic, sampler: Sampler) -> Series:
    left, right = series(expression.left, sampler), series(expression.right, sampler)
    a, b = left.values, right.values
    match expression.operator:
        case "+":
            values = a + b
        case "-":
            values = a - b
        case "*":
            values = a * b
        case _:
            values = np.divide(a, b, out=np.full(len(a), np.nan), where=b != 0.0)
    about = left if left.objects is not None else right
    note = "; ".join(dict.fromkeys(n for n in (left.note, right.note) if n))
    return Series(values, about.objects, about.names, note)


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
    if operator in ("<", ">", "!="):
        margin = np.where(margin == 0.0, JUST_BELOW, margin)
    return margin + 0.0


def _compare(comparison: Comparison, sampler: Sampler, negated: bool) -> Truth:
    left, right = series(comparison.left, sampler), series(comparison.right, sampler)
    operator = _NEGATED[comparison.operator] if negated else comparison.operator
    if left.objects is None and right.objects is not None:
        left = Series(left.values, right.objects, right.names, left.note)
    margin = margin_of(operator, left.values, right.values)
    kind = kind_of(comparison.left)
    clause = Clause(render(comparison), kind.unit if kind else "", left, right.values)
    return Truth(margin, np.zeros(len(margin), dtype=np.int32), (clause,))


def _flag(signal: Expression, sampler: Sampler, negated: bool) -> Truth:
    if not isinstance(signal, Signal):
        raise TypeError(f"{render(signal)} is not true or false")
    sampled = sampler.sample(signal)
    margin = 2.0 * sampled.values - 1.0
    clause = Clause(render(signal), "", sampled, None)
    decided = np.zeros(len(margin), dtype=np.int32)
    return Truth(-margin if negated else margin, decided, (clause,))


def _join(parts: list[Truth], *, every: bool, comparable: bool) -> Truth:
    """Join predicates by ``and`` (``every``) or ``or``, in Kleene's three-valued logic.

    Margins in unlike units only keep their sign.
    """
    margins = np.stack([p.margin if comparable else _sign(p.margin) for p in parts])
    unknown = np.isnan(margins)
    known = np.where(unknown, np.inf if every else -np.inf, margins)
    winner = known.argmin(axis=0) if every else known.argmax(axis=0)
    columns = np.arange(margins.shape[1])
    margin = known[winner, columns]
    settled = (margin < 0.0) if every else (margin >= 0.0)
    margin = np.where(unknown.any(axis=0) & ~settled, np.nan, margin)
    shifts = np.cumsum([0, *(len(p.clauses) for p in parts[:-1])])
    decided = np.stack([p.decided + shift for p, shift in zip(parts, shifts, strict=True)])
    clauses = tuple(clause for part in parts for clause in part.clauses)
    return Truth(margin, decided[winner, columns].astype(np.int32), clauses)


def _sign(margin: Floats) -> Floats:
    return np.where(np.isnan(margin), np.nan, np.where(margin >= 0.0, 1.0, -1.0))
