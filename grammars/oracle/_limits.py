"""Constants that oracles compare signals with: limits to draw, and limits out of reach."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from grammars.model.scene import Scene
from grammars.oracle._model import Oracle, Signal
from grammars.oracle._references import JointReference, object_signals
from grammars.text.diagnostics import Finding, Severity
from grammars.text.expressions import (
    Comparison,
    ComparisonOperator,
    Expression,
    Function,
    Logic,
    Not,
    Number,
    render,
    walk,
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


_YIELD: Final = 0.05
"""Distance by which a pushed joint may exceed its limits [rad or m]."""

_Range: TypeAlias = tuple[float, float]


def check_joint_limits(oracle: Oracle, scene: Scene) -> tuple[Finding, ...]:
    """Return a warning for each comparison of a joint with a value out of its reach in ``scene``.

    The usual case is the angle of a mirrored door, which opens to negative angles.
    :func:`check_references` reports unknown names.
    """
    joints = object_signals(scene)
    guard = () if oracle.guard is None else (oracle.guard,)
    expressions = (*(judged for judged, _ in oracle.judged()), *guard)
    comparisons = (
        part
        for expression in expressions
        for part in walk(expression)
        if isinstance(part, Comparison)
    )
    return tuple(_warning(oracle, one, joints) for one in comparisons if _never_holds(one, joints))


def _never_holds(comparison: Comparison, joints: Mapping[str, JointReference]) -> bool:
    one, other = _range(comparison.left, joints), _range(comparison.right, joints)
    constants = isinstance(comparison.left, Number) and isinstance(comparison.right, Number)
    if one is None or other is None or constants:
        return False
    if comparison.operator in (">=", ">"):
        return one[1] < other[0] - _YIELD
    # Measured values are never compared with == or !=.
    return comparison.operator in ("<=", "<") and one[0] > other[1] + _YIELD


def _range(expression: Expression, joints: Mapping[str, JointReference]) -> _Range | None:
    """Return the range of an expression of numbers and joints; ``None`` for other expressions."""
    match expression:
        case Number(value=value):
            return value, value
        case Signal(name=name) if name in joints and not name.endswith(".distance"):
            return joints[name].joint.lower, joints[name].joint.upper
        case Function(name="-" | "abs" as function, operands=(operand,)):
            inner = _range(operand, joints)
            if inner is None:
                return None
            if function == "-":
                return -inner[1], -inner[0]
            least = 0.0 if inner[0] <= 0.0 <= inner[1] else min(map(abs, inner))
            return least, max(map(abs, inner))
    return None


def _warning(
    oracle: Oracle, comparison: Comparison, joints: Mapping[str, JointReference]
) -> Finding:
    signal = next(part for part in walk(comparison) if isinstance(part, Signal))
    reference = joints[signal.name]
    low, high, unit = reference.joint.lower + 0.0, reference.joint.upper + 0.0, "m"  # no -0
    if reference.joint.kind == "revolute":
        low, high, unit = math.degrees(low), math.degrees(high), "deg"
    reach = f"{signal.name} goes from {low:.4g} {unit} to {high:.4g} {unit}"
    message = f"{render(comparison)} can never hold: {reach}"
    hint = "use a limit within the range of the joint"
    if reference.object.mirrored:
        hint = f"the object is mirrored, which reverses the sign: write abs({signal.name})"
    return Finding(oracle.place(signal.column), message, hint, Severity.WARNING)
