"""Constants that oracles compare signals with, for drawing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

from grammars.oracle._model import Oracle, Signal
from grammars.text.expressions import (
    Comparison,
    ComparisonOperator,
    Expression,
    Function,
    Logic,
    Not,
    Number,
    render,
)

LimitSide: TypeAlias = Literal["above", "below", ""]


@dataclass(frozen=True, slots=True)
class ComparedLimit:
    """A constant ``value`` [SI] that is compared with ``signal``.

    ``against`` is the side on which a single sample violates the oracle, empty if no single sample
    can.
    """

    signal: str
    value: float
    against: LimitSide


def compared_limits(oracle: Oracle) -> tuple[ComparedLimit, ...]:
    """Return the limits of an oracle in source order, for drawing only."""
    return tuple(limit for judged, holds in oracle.judged() for limit in _compared(judged, holds))


def _compared(expression: Expression, holds: bool | None) -> Iterator[ComparedLimit]:
    """Yield the limits of a predicate that must hold, must not hold, or neither (``None``)."""
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
        case Logic(operator=word, operands=operands):
            # A single alternative cannot violate the oracle.
            decides = holds is not None and (word == "and") is holds
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
    match expression:
        case Number(value=value):
            return value
        case Function(name="-", operands=(Number(value=value),)):
            return -value
    return None
