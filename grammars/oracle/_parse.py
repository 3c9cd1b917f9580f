"""From text to :class:`Oracle`, one line or a whole layer: a YAML file of ``name: oracle`` lines.

The syntax is read by textX, values and units by this module.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

from grammars.oracle._checks import check_types
from grammars.oracle._model import (
    Amount,
    Arithmetic,
    Comparison,
    CustomCall,
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
    shift_place,
)
from grammars.oracle._signals import custom_oracle_names
from grammars.text.diagnostics import Diagnostic, InputError, SourceText, Where, did_you_mean
from grammars.text.documents import YamlDocument, load_yaml
from grammars.text.parsing import Language, SyntaxFault
from grammars.text.quantity import parse_quantity
from grammars.text.units import DIMENSIONS

_OPERATORS: Final = (
    *("always", "never", "eventually", "fraction", "time", "longest", "count"),
    *("max", "min", "mean", "final", "p95", "reached"),
)
_MAX_LENGTH: Final = 1000
_MAX_DEPTH: Final = 16
"""Longer or deeper oracles are refused: nobody could read them, and the parser recurses through a
dozen rules for every parenthesis."""
_EXAMPLE: Final = "an oracle reads like: always(loc.error <= 0.35 m)"


def parse_oracle(name: str, text: str, where: Where) -> Oracle:
    """Read one oracle; ``where`` is the place of the first character of ``text``.

    Raises :class:`InputError` on syntax errors, unknown signals or units, and comparisons of
    unlike quantities. Names of scenery objects are checked by :func:`check_scene`.
    """
    tree = _parse_tree(text, where)
    builder = _OracleBuilder(text, where)
    guard = builder.expression(tree.guard) if tree.guard else None
    leg = builder.leg(tree.leg) if tree.leg else None
    oracle = Oracle(name, text, where, builder.judgement(tree.judgement), guard, leg)
    found = check_types(oracle)
    if found:
        raise InputError(found)
    return oracle


class _OracleLanguage(Language):
    def message(self, fault: SyntaxFault) -> str:
        rest = fault.rest.strip()
        if not rest:
            return "the oracle ends too early: a parenthesis, a signal or a quantity is missing"
        read = fault.text[: fault.offset]
        if re.match(r"(<=|>=|==|!=|<|>)", rest) and re.search(r"[<>=]", read):
            return 'comparisons cannot be chained: join two of them with "and"'
        return f'cannot read on at "{rest.split()[0]}"'

    def hint(self, fault: SyntaxFault) -> str:
        return _EXAMPLE


_LANGUAGE: Final = _OracleLanguage(Path(__file__).with_name("oracle.tx"), autokwd=True)


def _parse_tree(text: str, where: Where) -> Any:
    # A misspelt operator would read as an oracle that plugs in, and be told as a missing plug-in.
    _refuse_unknown_operator(text, where)
    _refuse_oversized(text, where)
    return _LANGUAGE.parse(SourceText(text, where.file, within=where))


def _refuse_unknown_operator(text: str, where: Where) -> None:
    word = re.match(r"\s*([A-Za-z_][\w.-]*)", text)
    if word is not None and word[1] in _OPERATORS:
        return
    known = (*_OPERATORS, *custom_oracle_names())
    if word is None or word[1] not in known:
        given = f'"{word[1]}"' if word else "this"
        hint = did_you_mean(word[1], known) if word else _EXAMPLE
        raise InputError.at(where, f"{given} does not begin an oracle", hint)


def _refuse_oversized(text: str, where: Where) -> None:
    if len(text) > _MAX_LENGTH:
        raise InputError.at(where, f"is longer than {_MAX_LENGTH} characters")
    depth = 0
    for column, character in enumerate(text):
        depth += (character == "(") - (character == ")")
        if depth > _MAX_DEPTH:
            place = shift_place(where, text, column)
            raise InputError.at(place, f"nests parentheses deeper than {_MAX_DEPTH}")


class _OracleBuilder:
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
                return CustomCall(node.name, tuple(map(self.number, node.arguments)))

    def _temporal(self, node: Any) -> Temporal:
        within = self.number(node.within) if node.within else None
        return Temporal(node.operator, self.expression(node.predicate), within)

    def _until(self, node: Any) -> Until:
        part = node.until
        if node.operator == "eventually" or node.within:
            place = shift_place(self._where, self._text, part._tx_position)
            hint = "such as: never(contact) until within 60 s (mission.reached >= 1)"
            first = "eventually" if node.operator == "eventually" else f"{node.operator} within"
            raise InputError.at(place, f'"{first}" takes no "until"', hint)
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
        place = shift_place(self._where, self._text, column)
        quantity = parse_quantity(node.text, place)
        kind = DIMENSIONS[quantity.dimension]
        # Fifteen digits are what people write, binary fractions have more.
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


_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


def load_oracles(path: str | Path) -> dict[str, Oracle]:
    """Read an oracle layer; oracles by name, in file order.

    Raises :class:`InputError` with every problem of the file.
    """
    document = load_yaml(path)
    if not isinstance(document.data, dict) or not document.data:
        raise InputError.at(
            Where(document.file, 1),
            "expected lines of name: oracle",
            "such as: localised: always(loc.error <= 0.35 m)",
        )
    oracles: dict[str, Oracle] = {}
    found: list[Diagnostic] = []
    for name, text in document.data.items():
        try:
            oracles[name] = _read(document, name, text)
        except InputError as error:
            found.extend(error.diagnostics)
    if found:
        raise InputError(found)
    return oracles


def _read(document: YamlDocument, name: str, text: object) -> Oracle:
    key = document.where((name,))
    if not _NAME.fullmatch(name):
        raise InputError.at(
            key, f'"{name}" cannot name an oracle', "use letters, digits, - _ and ."
        )
    if not isinstance(text, str):
        raise InputError.at(key, f'oracle "{name}" is not a line of text')
    return parse_oracle(name, text, document.where_text(name))
