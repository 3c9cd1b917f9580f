"""Checking oracles by themselves: signals are known, every comparison compares like with like."""

from __future__ import annotations

from typing import TypeAlias

from grammars.model.movers import PLANAR_JOINTS
from grammars.oracle._model import (
    ROBOT,
    Amount,
    Arithmetic,
    Comparison,
    CustomCall,
    Expression,
    Function,
    Limit,
    Logic,
    Not,
    Number,
    Oracle,
    Reached,
    Signal,
    Statistic,
    Temporal,
    Until,
)
from grammars.oracle._signals import (
    OBJECT_SIGNALS,
    SIGNALS,
    SignalDeclaration,
    custom_oracle,
    dimension_of,
    mover_hint,
    signal_declaration,
    signal_names,
)
from grammars.text.diagnostics import Diagnostic, closest, did_you_mean
from grammars.text.units import LENGTH, RATIO, TIME, Dimension

Kind: TypeAlias = Dimension | None
"""What an expression is measured in; ``None``: true or false."""


class _MismatchError(Exception):
    """A type error at an offset of the text."""

    def __init__(self, column: int, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.column, self.message, self.hint = column, message, hint


def check_types(oracle: Oracle) -> tuple[Diagnostic, ...]:
    """Return what is wrong with the units and signal names of ``oracle``, one finding per part."""
    found = []
    for check in (_check_judgement, _check_guard):
        try:
            check(oracle)
        except _MismatchError as error:
            place = oracle.place(error.column)
            found.append(Diagnostic(place, error.message, error.hint))
    return tuple(found)


def kind_of(expression: Expression) -> Kind:
    """Return what a checked expression is measured in (``None``: true or false)."""
    match expression:
        case Number():
            return expression.dimension
        case Signal():
            return _signal(expression)
        case Function():
            return _quantity(expression.operand)
        case Arithmetic():
            return _arithmetic(expression)
        case Comparison():
            _comparison(expression)
            return None
        case Not():
            _require_predicate(expression.operand)
            return None
        case Logic():
            for operand in expression.operands:
                _require_predicate(operand)
            return None


def margin_kind(predicate: Expression) -> Kind:
    """Return what the margin of a checked predicate is measured in.

    ``None`` when it has no single unit: a true-or-false signal takes part, or unlike quantities.
    """
    match predicate:
        case Comparison():
            return kind_of(predicate.left)
        case Not():
            return margin_kind(predicate.operand)
        case Logic():
            kinds = {margin_kind(operand) for operand in predicate.operands}
            return kinds.pop() if len(kinds) == 1 else None
        case _:
            return None


def unit_of(oracle: Oracle) -> str:
    """Return the unit of a checked oracle's margin, or of what it measures; empty without one.

    Raises ``ValueError`` when it names a plug-in that cannot be used any more.
    """
    kind: Kind = RATIO
    match oracle.judgement:
        case Temporal(predicate=predicate) | Until(predicate=predicate):
            kind = margin_kind(predicate)
        case Amount(operator="time" | "longest"):
            kind = TIME
        case Statistic(signal=signal):
            kind = kind_of(signal)
        case Reached():
            kind = LENGTH
        case CustomCall(name=name):
            declared = custom_oracle(name)
            return "" if declared is None or declared.unit == "bool" else declared.unit
    return "" if kind is None else kind.unit


def _check_judgement(oracle: Oracle) -> None:
    match oracle.judgement:
        case Temporal() | Until() as judgement:
            _require_predicate(judgement.predicate)
            if isinstance(judgement, Until):
                _require_predicate(judgement.release)
            within = judgement.within
            if within is not None:
                _require(within, TIME, '"within" takes a time')
        case Amount(operator=operator, predicate=predicate, limit=limit):
            _require_predicate(predicate)
            _check_limit(operator, TIME if operator in ("time", "longest") else RATIO, limit)
        case Statistic(operator=operator, signal=signal, limit=limit):
            _check_limit(f"{operator}(...)", _quantity(signal), limit)
        case Reached(tolerance=tolerance):
            _require(tolerance, LENGTH, '"reached" takes a distance')
            if tolerance.value <= 0.0:
                raise _MismatchError(tolerance.column, "the tolerance must be more than 0 m")
            if oracle.leg is not None:
                raise _MismatchError(oracle.leg.column, '"reached" is about the whole mission')
        case CustomCall():
            _check_custom(oracle, oracle.judgement)


def _check_custom(oracle: Oracle, judgement: CustomCall) -> None:
    """Hold a judgement against the declaration of the plug-in it names."""
    try:
        declared = custom_oracle(judgement.name)
    except ValueError as error:
        raise _MismatchError(0, str(error)) from error
    if declared is None:
        raise _MismatchError(0, f'no oracle "{judgement.name}" is installed')
    if len(judgement.arguments) != len(declared.arguments):
        raise _miscounted(0, judgement.name, len(declared.arguments), len(judgement.arguments))
    for argument, unit in zip(judgement.arguments, declared.arguments, strict=True):
        kind = dimension_of(unit)
        if argument.dimension != kind:
            message = f'{judgement.name} takes {unit}, but "{argument.text}" {_has_unit(argument)}'
            raise _MismatchError(argument.column, message)
    if oracle.leg is not None or oracle.guard is not None:
        column = oracle.leg.column if oracle.leg else oracle.guard.column if oracle.guard else 0
        hint = "give it what it needs to know as an argument"
        raise _MismatchError(column, f"{judgement.name} judges the whole run", hint)


def _miscounted(column: int, name: str, takes: int, given: int) -> _MismatchError:
    return _MismatchError(column, f"{name} takes {takes or 'no'} arguments, {given} given")


def _check_guard(oracle: Oracle) -> None:
    if oracle.guard is not None:
        _require_predicate(oracle.guard)


def _check_limit(what: str, kind: Dimension, limit: Limit | None) -> None:
    if limit is None:
        return
    number = limit.number
    if number.dimension != kind:
        raise _unlike(number, kind, number.dimension)
    if limit.operator in ("==", "!=") and what != "count":
        raise _equality(number.column)


def _require(number: Number, kind: Dimension, message: str) -> None:
    if number.dimension != kind:
        message = f'{message}, but "{number.text}" {_has_unit(number)}'
        raise _MismatchError(number.column, message, _with_unit(number, kind))


def _require_predicate(expression: Expression) -> None:
    kind = kind_of(expression)
    if kind is not None:
        raise _MismatchError(
            expression.column,
            f"this is a quantity [{kind.unit}], not something true or false",
            "compare it with a limit, such as: <= 1" + ("" if kind == RATIO else f" {kind.unit}"),
        )


def _quantity(expression: Expression) -> Dimension:
    kind = kind_of(expression)
    if kind is None:
        raise _MismatchError(
            expression.column,
            "this is true or false, not a quantity",
            "write it alone: fraction(loc.inside_2sigma) >= 95 %",
        )
    return kind


def _signal(signal: Signal) -> Kind:
    try:
        declared = signal_declaration(signal.name)
    except ValueError as error:
        raise _MismatchError(signal.column, str(error)) from error
    if declared is None:
        raise _MismatchError(
            signal.column, f'unknown signal "{signal.name}"', _signal_hint(signal.name)
        )
    _check_arguments(signal, declared)
    return declared.dimension


def _check_arguments(signal: Signal, declared: SignalDeclaration) -> None:
    given = signal.arguments
    if declared.relates:
        _check_relation(signal, declared)
        return
    if declared.takes_node:
        if len(given) != 1 or signal.object is None:
            message = f"{signal.name} takes the name of a node of the behaviour tree"
            hint = f"such as: {signal.name}(FollowPath)"
            raise _MismatchError(signal.column, message, hint)
        return
    if declared.takes_object and signal.object is not None:
        given = given[1:]
    if len(given) != len(declared.arguments) and (given or declared.required):
        raise _miscounted(signal.column, signal.name, len(declared.arguments), len(given))
    for argument, expected in zip(given, declared.arguments, strict=False):
        if not isinstance(argument, Number):
            raise _MismatchError(argument.column, f"arguments of {signal.name} are constants")
        if argument.dimension != expected:
            message = f'{signal.name} takes {expected.unit}, but "{argument.text}" '
            raise _MismatchError(argument.column, message + _has_unit(argument))


def _check_relation(signal: Signal, declared: SignalDeclaration) -> None:
    """Raise unless the robot and one thing are named, in this order."""
    names = [a.name for a in signal.arguments if isinstance(a, Signal) and not a.arguments]
    if len(names) == len(signal.arguments) == 2 and names[0] == ROBOT != names[1]:
        return
    things = [name for name in names if name != ROBOT]
    example = things[0] if things else "kitchen_door" if "object" in declared.relates else "kitchen"
    message = f"{signal.name} takes the robot and what it is related to"
    raise _MismatchError(signal.column, message, f"such as: {signal.name}({ROBOT}, {example})")


def _signal_hint(name: str) -> str:
    parts = name.split("-")
    if len(parts) > 1 and all(part in signal_names() for part in parts):
        return f"to subtract, put blanks around the sign: {' - '.join(parts)}"
    # door_17.angel: the object may be there, which only a scene can tell, so its endings are known.
    owner, _, last = name.rpartition(".")
    known = set(signal_names())
    if owner and last in PLANAR_JOINTS and not closest(name, known):
        return mover_hint(owner)
    if owner and not any(known_name.startswith(f"{owner}.") for known_name in SIGNALS):
        known |= {f"{owner}.{ending}" for ending in OBJECT_SIGNALS}
    return did_you_mean(name, known) if last else ""


def _arithmetic(expression: Arithmetic) -> Dimension:
    left, right = _quantity(expression.left), _quantity(expression.right)
    if expression.operator == "*":
        return left * right
    if expression.operator == "/":
        return left / right
    if left != right:
        verb = "adds" if expression.operator == "+" else "subtracts"
        raise _MismatchError(expression.column, f"{verb} {_name(left)} and {_name(right)}")
    return left


def _comparison(expression: Comparison) -> None:
    left, right = _quantity(expression.left), _quantity(expression.right)
    if left != right:
        raise _unlike(expression.right, left, right)
    # Counts and numbers of legs are plain numbers; so are shares, of which nothing else is known.
    if expression.operator in ("==", "!=") and left != RATIO:
        raise _equality(expression.column)


def _unlike(limit: Expression, left: Dimension, right: Dimension) -> _MismatchError:
    hint = f"write the limit in {left.unit}" if right == RATIO else ""
    if isinstance(limit, Number):
        hint = _with_unit(limit, left)
    return _MismatchError(limit.column, f"compares {_name(left)} with {_name(right)}", hint)


def _with_unit(number: Number, kind: Dimension) -> str:
    """Return how a number without a unit was probably meant."""
    return (
        f"write it in {kind.unit}: {number.text} {kind.unit}" if number.dimension == RATIO else ""
    )


def _equality(column: int) -> _MismatchError:
    return _MismatchError(
        column, "only counts can be equal; a measured value never is exactly", "use <= or >="
    )


def _name(kind: Dimension) -> str:
    return "a number without unit" if kind == RATIO else kind.unit


def _has_unit(number: Number) -> str:
    return "has no unit" if number.dimension == RATIO else f"is in {number.dimension.unit}"
