"""Constants that oracles compare signals with: those to draw, and those no joint comes to."""

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
    """A constant ``value`` [SI] that ``signal``, as written, is compared with.

    ``against`` is the side on which the signal alone speaks against the oracle, empty where no
    single sample does.
    """

    signal: str
    value: float
    against: LimitSide


def compared_limits(oracle: Oracle) -> tuple[ComparedLimit, ...]:
    """Return the limits of an oracle in the order they are written.

    For drawing: nothing is judged by them.
    """
    return tuple(limit for judged, holds in oracle.judged() for limit in _compared(judged, holds))


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
        case Logic(operator=word, operands=operands):
            # Of alternatives one alone speaks against nothing.
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
"""A joint that is pushed may leave its limits by so much [rad or m]."""

_Range: TypeAlias = tuple[float, float]


def check_joint_limits(oracle: Oracle, scene: Scene) -> tuple[Finding, ...]:
    """Return a warning for each comparison of a joint with what it cannot come to in ``scene``.

    The usual one is the angle of a door that is hung as its mirror image: such a door opens to
    negative angles, whatever its model says.
    Names that are not in the scene are left out: :func:`check_references` speaks of them.
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


def _never_holds(compared: Comparison, joints: Mapping[str, JointReference]) -> bool:
    one, other = _range(compared.left, joints), _range(compared.right, joints)
    constants = isinstance(compared.left, Number) and isinstance(compared.right, Number)
    if one is None or other is None or constants:
        return False
    if compared.operator in (">=", ">"):
        return one[1] < other[0] - _YIELD
    # Measured values are never compared with == or !=.
    return compared.operator in ("<=", "<") and one[0] > other[1] + _YIELD


def _range(expression: Expression, joints: Mapping[str, JointReference]) -> _Range | None:
    """Return between what an expression of numbers and joints stays; ``None`` for all others."""
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


def _warning(oracle: Oracle, compared: Comparison, joints: Mapping[str, JointReference]) -> Finding:
    signal = next(part for part in walk(compared) if isinstance(part, Signal))
    reference = joints[signal.name]
    low, high, unit = reference.joint.lower + 0.0, reference.joint.upper + 0.0, "m"  # no -0
    if reference.joint.kind == "revolute":
        low, high, unit = math.degrees(low), math.degrees(high), "deg"
    reach = f"{signal.name} goes from {low:.4g} {unit} to {high:.4g} {unit}"
    message = f"{render(compared)} can never hold: {reach}"
    hint = "compare it with what the joint can come to"
    if reference.object.mirrored:
        hint = f"it is hung as its mirror image, which turns the sign: write abs({signal.name})"
    return Finding(oracle.place(signal.column), message, hint, Severity.WARNING)
