"""Comparisons that can never hold: joints of the scene that do not go so far.

The usual one is the angle of a door that is hung as its mirror image: such a door opens to negative
angles, whatever its model says.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Final, TypeAlias

from grammars.model.scene import Scene
from grammars.oracle._model import (
    Amount,
    Comparison,
    ComparisonOperator,
    Expression,
    Function,
    Number,
    Oracle,
    Signal,
    Statistic,
    Temporal,
    Until,
    render,
    walk,
)
from grammars.oracle._references import JointReference, object_signals
from grammars.text.diagnostics import Diagnostic, Severity

_YIELD: Final = 0.05
"""A joint that is pushed may leave its limits by so much [rad or m]."""

_Range: TypeAlias = tuple[float, float]
_Compared: TypeAlias = tuple[Expression, ComparisonOperator, Expression]


def check_joint_limits(oracle: Oracle, scene: Scene) -> tuple[Diagnostic, ...]:
    """Return a warning for each comparison of a joint with what it cannot come to in ``scene``.

    Names that are not in the scene are left out: :func:`check_references` speaks of them.
    """
    joints = object_signals(scene)
    return tuple(
        _warning(oracle, one, joints) for one in _comparisons(oracle) if _never_holds(one, joints)
    )


def _comparisons(oracle: Oracle) -> Iterator[_Compared]:
    judged: tuple[Expression, ...] = ()
    match oracle.judgement:
        case Temporal(predicate=predicate) | Amount(predicate=predicate):
            judged = (predicate,)
        case Until(predicate=predicate, release=release):
            judged = (predicate, release)
        case Statistic(signal=signal, limit=limit) if limit is not None:
            yield signal, limit.operator, limit.number
    for expression in (*judged, *(() if oracle.guard is None else (oracle.guard,))):
        for part in walk(expression):
            if isinstance(part, Comparison):
                yield part.left, part.operator, part.right


def _never_holds(compared: _Compared, joints: Mapping[str, JointReference]) -> bool:
    left, operator, right = compared
    one, other = _range(left, joints), _range(right, joints)
    if one is None or other is None or (isinstance(left, Number) and isinstance(right, Number)):
        return False
    if operator in (">=", ">"):
        return one[1] < other[0] - _YIELD
    # Measured values are never compared with == or !=.
    return operator in ("<=", "<") and one[0] > other[1] + _YIELD


def _range(expression: Expression, joints: Mapping[str, JointReference]) -> _Range | None:
    """Return between what an expression of numbers and joints stays; ``None`` for all others."""
    match expression:
        case Number(value=value):
            return value, value
        case Signal(name=name) if name in joints and not name.endswith(".distance"):
            return joints[name].joint.lower, joints[name].joint.upper
        case Function(name=function, operand=operand):
            inner = _range(operand, joints)
            if inner is None:
                return None
            if function == "-":
                return -inner[1], -inner[0]
            least = 0.0 if inner[0] <= 0.0 <= inner[1] else min(map(abs, inner))
            return least, max(map(abs, inner))
    return None


def _warning(
    oracle: Oracle, compared: _Compared, joints: Mapping[str, JointReference]
) -> Diagnostic:
    left, operator, right = compared
    parts = (part for side in (left, right) for part in walk(side))
    signal = next(part for part in parts if isinstance(part, Signal))
    reference = joints[signal.name]
    low, high, unit = reference.joint.lower + 0.0, reference.joint.upper + 0.0, "m"  # no -0
    if reference.joint.kind == "revolute":
        low, high, unit = math.degrees(low), math.degrees(high), "deg"
    said = f"{render(left)} {operator} {render(right)} can never hold"
    message = f"{said}: {signal.name} goes from {low:.4g} {unit} to {high:.4g} {unit}"
    hint = "compare it with what the joint can come to"
    if reference.object.mirrored:
        hint = f"it is hung as its mirror image, which turns the sign: write abs({signal.name})"
    return Diagnostic(oracle.place(signal.column), message, hint, Severity.WARNING)
