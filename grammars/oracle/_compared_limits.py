"""Constants that oracles compare signals with, and the side of them that speaks against a run.

For drawing: nothing is judged by this.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

from grammars.oracle._model import (
    Amount,
    Comparison,
    ComparisonOperator,
    Expression,
    Function,
    Logic,
    Not,
    Number,
    Oracle,
    Signal,
    Statistic,
    Temporal,
    Until,
    render,
)

LimitSide: TypeAlias = Literal["above", "below", ""]


@dataclass(frozen=True, slots=True)
class ComparedLimit:
    """A constant ``value`` [SI] that ``signal``, as written, is compared with.

    ``against`` is the side on which the signal alone speaks against the oracle, empty where no
    single sample does.
    """

    signal: str
    value: float
    against: LimitSide


def compared_limits(oracle: Oracle) -> tuple[ComparedLimit, ...]:
    """Return the limits of an oracle in the order they are written."""
    return tuple(_limits(oracle))


def _limits(oracle: Oracle) -> Iterator[ComparedLimit]:
    match oracle.judgement:
        case Statistic(operator=operator, signal=Signal() as signal, limit=limit):
            if limit is not None:
                holds = True if operator in ("max", "min") else None
                yield ComparedLimit(
                    render(signal), limit.number.value, _side(limit.operator, holds)
                )
        case Temporal(operator=operator, predicate=predicate):
            # What must hold once is not spoken against by any one sample.
            yield from _compared(
                predicate, None if operator == "eventually" else operator != "never"
            )
        case Amount(predicate=predicate, limit=limit):
            wanted = None if limit is None else limit.operator in (">=", ">")
            yield from _compared(predicate, wanted)
        case Until(operator=operator, predicate=predicate, release=release):
            yield from _compared(predicate, operator != "never")
            yield from _compared(release, None)


def _compared(expression: Expression, holds: bool | None) -> Iterator[ComparedLimit]:
    """Yield the limits of a predicate that is to hold, not to hold, or neither (``None``)."""
    match expression:
        case Comparison(operator=operator, left=left, right=right):
            for signal, number, side in (
                (left, right, _side(operator, holds)),
                (right, left, _side(operator, None if holds is None else not holds)),
            ):
                value = _constant(number)
                if isinstance(signal, Signal) and value is not None:
                    yield ComparedLimit(render(signal), value, side)
        case Not(operand=operand):
            yield from _compared(operand, None if holds is None else not holds)
        case Logic(operator=operator, operands=operands):
            # Of alternatives one alone speaks against nothing.
            decides = holds is not None and (operator == "and") is holds
            for operand in operands:
                yield from _compared(operand, holds if decides else None)


def _side(operator: ComparisonOperator, holds: bool | None) -> LimitSide:
    if holds is None:
        return ""
    most = operator in ("<", "<=")
    if not most and operator not in (">", ">="):
        return ""
    return "above" if most is holds else "below"


def _constant(expression: Expression) -> float | None:
    if isinstance(expression, Number):
        return expression.value
    if isinstance(expression, Function) and expression.name == "-":
        inner = expression.operand
        return -inner.value if isinstance(inner, Number) else None
    return None
