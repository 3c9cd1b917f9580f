"""From text to :class:`Oracle`: syntax by textX, values by this module."""

from __future__ import annotations

import functools
import re
from pathlib import Path
from typing import Any, Final

from grammars.diagnostics import Diagnostic, InputError, Where, did_you_mean
from grammars.oracle._dimension import dimension
from grammars.oracle._model import (
    Amount,
    Arithmetic,
    Comparison,
    Custom,
    Expression,
    Function,
    Judgement,
    Leg,
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
    shift,
)
from grammars.oracle._plugins import custom_oracle_names
from grammars.oracle._types import check_types
from grammars.parsing import metamodel
from grammars.quantity import parse_quantity

_OPERATORS: Final = (
    *("always", "never", "eventually", "fraction", "time", "longest", "count"),
    *("max", "min", "mean", "final", "p95", "reached"),
)
_MAX_LENGTH: Final = 1000
_MAX_DEPTH: Final = 16
"""Longer or deeper oracles are refused: nobody could read them, and parsing recurses."""
_EXAMPLE: Final = "an oracle reads like: always(loc.error <= 0.35 m)"


def parse_oracle(name: str, text: str, where: Where) -> Oracle:
    """Read one oracle; ``where`` is the place of the first character of ``text``.

    Raises :class:`InputError` on syntax errors, unknown signals or units, and comparisons of
    unlike quantities. Names of scenery objects are checked by :func:`check_scene`.
    """
    tree = _parse_tree(text, where)
    builder = _Builder(text, where)
    guard = builder.expression(tree.guard) if tree.guard else None
    leg = builder.leg(tree.leg) if tree.leg else None
    oracle = Oracle(name, text, where, builder.judgement(tree.judgement), guard, leg)
    found = check_types(oracle)
    if found:
        raise InputError(found)
    return oracle


@functools.cache
def _metamodel() -> Any:
    return metamodel(Path(__file__).with_name("oracle.tx"), autokwd=True)


def _parse_tree(text: str, where: Where) -> Any:
    from textx import TextXSyntaxError

    _refuse_strangers(text, where)
    _refuse_monsters(text, where)
    try:
        return _metamodel().model_from_str(text)
    except RecursionError as error:
        raise InputError(Diagnostic(where, "is nested too deeply", _EXAMPLE)) from error
    except TextXSyntaxError as error:
        offset = sum(len(line) + 1 for line in text.split("\n")[: error.line - 1]) + error.col - 1
        raise InputError(
            Diagnostic(shift(where, text, offset), _complaint(text, offset), _EXAMPLE)
        ) from error


def _refuse_strangers(text: str, where: Where) -> None:
    word = re.match(r"\s*([A-Za-z_][\w.-]*)", text)
    if word is not None and word[1] in _OPERATORS:
        return
    known = (*_OPERATORS, *custom_oracle_names())
    if word is None or word[1] not in known:
        given = f'"{word[1]}"' if word else "this"
        hint = did_you_mean(word[1], known) if word else _EXAMPLE
        raise InputError(Diagnostic(where, f"{given} does not begin an oracle", hint))


def _refuse_monsters(text: str, where: Where) -> None:
    if len(text) > _MAX_LENGTH:
        raise InputError(Diagnostic(where, f"is longer than {_MAX_LENGTH} characters"))
    depth = 0
    for column, character in enumerate(text):
        depth += (character == "(") - (character == ")")
        if depth > _MAX_DEPTH:
            place = shift(where, text, column)
            raise InputError(Diagnostic(place, f"nests parentheses deeper than {_MAX_DEPTH}"))


def _complaint(text: str, offset: int) -> str:
    rest = text[offset:].strip()
    if not rest:
        return "the oracle ends too early: a parenthesis, a signal or a quantity is missing"
    if re.match(r"(<=|>=|==|!=|<|>)", rest) and re.search(r"[<>=]", text[:offset]):
        return 'comparisons cannot be chained: join two of them with "and"'
    return f'cannot read on at "{rest.split()[0]}"'


class _Builder:
    """Turns the parse tree of one text into values."""

    def __init__(self, text: str, where: Where) -> None:
        self._text = text
        self._where = where

    def judgement(self, node: Any) -> Judgement:
        match type(node).__name__:
            case "Temporal":
                return self._until(node) if node.until else self._temporal(node)
            case "Amount":
                return Amount(node.operator, self.expression(node.predicate), self.limit(node))
            case "Statistic":
                return Statistic(node.operator, self.expression(node.signal), self.limit(node))
            case "Reached":
                return Reached(self.number(node.tolerance))
            case _:
                return Custom(node.name, tuple(map(self.number, node.arguments)))

    def _temporal(self, node: Any) -> Temporal:
        within = self.number(node.within) if node.within else None
        return Temporal(node.operator, self.expression(node.predicate), within)

    def _until(self, node: Any) -> Until:
        part = node.until
        if node.operator == "eventually" or node.within:
            place = shift(self._where, self._text, part._tx_position)
            hint = "such as: never(contact) until within 60 s (mission.reached >= 1)"
            first = "eventually" if node.operator == "eventually" else f"{node.operator} within"
            raise InputError(Diagnostic(place, f'"{first}" takes no "until"', hint))
        within = self.number(part.within) if part.within else None
        predicate, release = self.expression(node.predicate), self.expression(part.release)
        return Until(node.operator, predicate, release, within)

    def leg(self, node: Any) -> Leg:
        return Leg(int(node.number or 0), node.waypoint or "", node._tx_position)

    def limit(self, node: Any) -> Limit | None:
        if not node.limit:
            return None
        number = self.number(node.limit.quantity)
        if node.limit.negative:
            number = Number(-number.value, number.dimension, f"-{number.text}", number.column)
        return Limit(node.limit.operator, number)

    def number(self, node: Any) -> Number:
        column = node._tx_position
        place = shift(self._where, self._text, column)
        quantity = parse_quantity(node.text, place)
        try:
            kind = dimension(quantity.dimension)
        except ValueError as error:
            raise InputError(Diagnostic(place, str(error))) from error
        # 95 % is 0.9500000000000001 in binary; fifteen digits are what people write.
        return Number(float(f"{quantity.value:.15g}"), kind, node.text, column)

    def expression(self, node: Any) -> Expression:
        column = node._tx_position
        match type(node).__name__:
            case "Or" | "And" as kind:
                operands = tuple(self.expression(operand) for operand in node.operands)
                if len(operands) == 1:
                    return operands[0]
                return Logic("or" if kind == "Or" else "and", operands, column)
            case "Negation":
                return Not(self.expression(node.operand), column)
            case "Comparison":
                left = self.expression(node.left)
                if not node.right:
                    return left
                return Comparison(node.operator, left, self.expression(node.right), column)
            case "Sum" | "Product":
                return self._chain(node)
            case "Minus":
                return Function("-", self.expression(node.operand), column)
            case "Absolute":
                return Function("abs", self.expression(node.operand), column)
            case "Group":
                return self.expression(node.expression)
            case "Quantity":
                return self.number(node)
            case _:
                arguments = tuple(self.expression(argument) for argument in node.arguments)
                return Signal(node.name, arguments, column)

    def _chain(self, node: Any) -> Expression:
        result = self.expression(node.first)
        for tail in node.rest:
            operand = self.expression(tail.operand)
            result = Arithmetic(tail.operator, result, operand, node._tx_position)
        return result
