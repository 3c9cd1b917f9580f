"""Checks of single oracles: known signals, and comparisons of equal dimensions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from grammars.model.movers import PLANAR_JOINTS
from grammars.oracle._model import (
    OPERATORS,
    RESPONSE_FORM,
    ROBOT,
    Amount,
    CustomCall,
    Limit,
    Oracle,
    Reached,
    Response,
    Signal,
    Statistic,
    Temporal,
    Until,
    thing_of,
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
from grammars.text.diagnostics import Findings, SourceText, closest, did_you_mean
from grammars.text.expression_check import DimensionCheck, Kind, MaybeKind, Unknown, with_unit
from grammars.text.expressions import Comparison, Expression, Logic, Name, Not, Number, render, walk
from grammars.text.units import LENGTH, RATIO, TIME, Dimension

_AMOUNTS: Final = "a share is a fraction(…), a time is a time(…) or longest(…), a number a count(…)"
_EQUALITY: Final = (
    "only counts can be equal, measured values never are exactly",
    "use <= or >=",
)


def check_types(oracle: Oracle) -> None:
    """Raise :class:`InputError` with all problems of units and signals of an oracle."""
    check = _OracleCheck(SourceText(oracle.text, oracle.where.file, within=oracle.where))
    check.judgement(oracle)
    if oracle.guard is not None:
        check.predicate(oracle.guard)
    check.findings.raise_errors()


def kind_of(expression: Expression) -> Kind:
    """Return the dimension of a checked expression, ``None`` for a predicate."""
    kind = _OracleCheck(SourceText("", "")).expressions.kind(expression)
    return None if kind is Unknown.UNKNOWN else kind


def margin_kind(predicate: Expression) -> Kind:
    """Return the dimension of the margin of a checked predicate.

    ``None`` if it has no single unit, due to Boolean signals or different dimensions.
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
    """Return the unit of the margin or measure of a checked oracle, empty if it has none.

    Raises ``ValueError`` for a plug-in that can no longer be used.
    """
    kind: Kind = RATIO
    match oracle.judgement:
        case Temporal() | Until() | Response() as judgement:
            kind = margin_kind(judgement.predicate)
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


class _OracleCheck:
    """Checks the parts of one oracle and collects findings."""

    def __init__(self, source: SourceText) -> None:
        self.findings = Findings()
        self.expressions = DimensionCheck(source, self.findings, self._signal)
        self._error = self.expressions.error

    def judgement(self, oracle: Oracle) -> None:
        """Check the judgement of an oracle."""
        match oracle.judgement:
            case Statistic(signal=signal) if self.expressions.kind(signal) is None:
                text = render(signal)
                hint = f"use fraction({text}) or count({text})"
                self._error(signal, "this is true or false, not a quantity", hint)
            case Statistic(signal=signal, limit=None):
                self.expressions.quantity(signal)
            case Reached(tolerance=tolerance):
                self._require(tolerance, LENGTH, '"reached" takes a distance')
                if tolerance.value <= 0.0:
                    self._error(tolerance, "the tolerance must be greater than 0 m")
                if oracle.leg is not None:
                    self._error(oracle.leg, '"reached" is about the whole mission')
            case CustomCall() as call:
                self._custom(oracle, call)
            case _:
                for judged, _ in oracle.judged():
                    self.predicate(judged)
        match oracle.judgement:
            case Temporal() | Until() | Response() as judgement if judgement.within is not None:
                self._require(judgement.within, TIME, '"within" takes a time')
            case Amount(operator=operator, limit=Limit(number=number) as limit):
                kind = TIME if operator in ("time", "longest") else RATIO
                if operator == "count" and "%" in number.text:
                    self._error(number, f'"{number.text}" is a share, not a count', _AMOUNTS)
                elif number.dimension != kind:
                    self.expressions.compare(kind, number, number.dimension, _AMOUNTS)
                elif limit.operator in ("==", "!=") and operator != "count":
                    self._error(number, *_EQUALITY)
            case Statistic(limit=Limit(operator="==" | "!=", number=number)):
                self._error(number, *_EQUALITY)

    def predicate(self, predicate: Expression) -> None:
        """Check a predicate: only counts may be compared with ``==``."""
        self.expressions.predicate(predicate)
        for part in walk(predicate):
            # Counts and leg numbers are plain numbers. Shares cannot be distinguished from them.
            if not isinstance(part, Comparison) or part.operator not in ("==", "!="):
                continue
            if self.expressions.kind(part.left) not in (RATIO, Unknown.UNKNOWN):
                self._error(part, *_EQUALITY)

    def _custom(self, oracle: Oracle, call: CustomCall) -> None:
        """Check a call against the declaration of its plug-in."""
        name = Name(call.name)
        try:
            declared = custom_oracle(call.name)
        except ValueError as error:
            self._error(name, str(error))
            return
        assert declared is not None  # the parser knows the name
        self._arguments(name, call.arguments, tuple(map(dimension_of, declared.arguments)))
        scope = oracle.leg or oracle.guard
        if scope is not None:
            message = f"{call.name} always judges the whole run"
            self._error(scope, message, "pass details as arguments")

    def _require(self, number: Number, kind: Dimension, message: str) -> None:
        if number.dimension != kind:
            message = f'{message}, but "{number.text}" {_has_unit(number)}'
            self._error(number, message, with_unit(number, kind))

    def _signal(self, signal: Signal) -> MaybeKind:
        """Check the arguments of a signal and return its declared dimension."""
        try:
            declared = signal_declaration(signal.name)
        except ValueError as error:
            self._error(signal, str(error))
            return Unknown.UNKNOWN
        if declared is None:
            self._error(signal, f'unknown signal "{signal.name}"', _signal_hint(signal.name))
            return Unknown.UNKNOWN
        arguments = signal.arguments
        if declared.relates:
            self._relation(signal, declared)
        elif declared.takes_node:
            if len(arguments) != 1 or thing_of(signal) is None:
                message = f"{signal.name} takes the name of a node of the behaviour tree"
                self._error(signal, message, f"such as: {signal.name}(FollowPath)")
        else:
            thing = thing_of(signal) if declared.takes_object else None
            if thing is not None:
                if thing is not arguments[0]:
                    hint = f"write {signal.name}({thing.name})"
                    self._error(signal, f"{signal.name} is always that of the robot", hint)
                    return declared.dimension
                arguments = arguments[1:]
            if arguments or declared.required:
                self._arguments(signal, arguments, declared.arguments)
        return declared.dimension

    def _arguments(
        self, name: Name, arguments: Sequence[Expression], kinds: Sequence[Kind]
    ) -> None:
        if len(arguments) != len(kinds):
            message = f"{name.name} takes {len(kinds) or 'no'} arguments, not {len(arguments)}"
            self._error(name, message)
            return
        for argument, kind in zip(arguments, kinds, strict=True):
            if not isinstance(argument, Number):
                self._error(argument, f"arguments of {name.name} must be constants")
            elif kind is not None and argument.dimension != kind:
                problem = f'"{argument.text}" {_has_unit(argument)}'
                self._error(argument, f"{name.name} takes {kind.unit}, but {problem}")

    def _relation(self, signal: Signal, declared: SignalDeclaration) -> None:
        """Report arguments other than the robot and one thing, in this order."""
        names = [a.name for a in signal.arguments if isinstance(a, Signal) and not a.arguments]
        if len(names) == len(signal.arguments) == 2 and names[0] == ROBOT != names[1]:
            return
        things = [name for name in names if name != ROBOT]
        usual = "kitchen_door" if "object" in declared.relates else "kitchen"
        message = f"{signal.name} takes the robot and one other thing"
        example = f"{signal.name}({ROBOT}, {things[0] if things else usual})"
        self._error(signal, message, f"such as: {example}")


def _signal_hint(name: str) -> str:
    if name in OPERATORS:
        return f"operators stand first: {RESPONSE_FORM}"
    if name.endswith((".open", ".closed")):
        return f"compare its joint: abs({name.rpartition('.')[0]}.angle) >= 80 deg"
    parts = name.split("-")
    if len(parts) > 1 and all(part in signal_names() for part in parts):
        return f"to subtract, put blanks around the sign: {' - '.join(parts)}"
    # For door_17.angel, suggest endings: only a scene knows whether the object exists.
    owner, _, last = name.rpartition(".")
    names = set(signal_names())
    if owner and last in PLANAR_JOINTS and not closest(name, names):
        return mover_hint(owner)
    if owner and not any(signal.startswith(f"{owner}.") for signal in SIGNALS):
        names |= {f"{owner}.{ending}" for ending in OBJECT_SIGNALS}
    return did_you_mean(name, names) if last else ""


def _has_unit(number: Number) -> str:
    return "has no unit" if number.dimension == RATIO else f"is in {number.dimension.unit}"
