"""Sums, comparisons and logic of named values, as every language reads them.

The grammar is ``expressions.tx``; what a name means is the business of the language. Every
expression carries ``column``, the offset of its first character in the text it was read from;
equal expressions mean the same, wherever and however they were written.
Nothing here recurses through an expression: a sum of a thousand terms is nested a thousand deep.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias, TypeVar

from grammars.text.diagnostics import (
    InputError,
    SourceText,
    SyntaxNode,
)
from grammars.text.parsing import Language, SyntaxFault
from grammars.text.units import Dimension, read_unit, to_si

T = TypeVar("T")

ComparisonOperator: TypeAlias = Literal["<=", "<", ">=", ">", "==", "!="]
_TOLERANCE: Final = 1e-9
"""Values that differ by no more are equal, by this share where they are larger than 1."""


@dataclass(frozen=True, slots=True)
class Number:
    """A constant: SI ``value`` of ``dimension``, and how it was written."""

    value: float
    dimension: Dimension
    text: str = field(compare=False)
    column: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Name:
    """A named value, some with arguments: ``clearance(0.35 m, 0.2 m)``."""

    name: str
    arguments: tuple[Expression, ...] = ()
    column: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """``left operator right``."""

    operator: Literal["+", "-", "*", "/"]
    left: Expression
    right: Expression
    column: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Function:
    """A function of expressions: sign change and magnitude of one, ``min`` and ``max`` of any."""

    name: Literal["-", "abs", "min", "max"]
    operands: tuple[Expression, ...]
    column: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Comparison:
    """``left operator right``: true or false."""

    operator: ComparisonOperator
    left: Expression
    right: Expression
    column: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Not:
    """True where the operand is false."""

    operand: Expression
    column: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Logic:
    """``and`` or ``or`` of at least two predicates."""

    operator: Literal["and", "or"]
    operands: tuple[Expression, ...]
    column: int = field(default=0, compare=False)


Expression: TypeAlias = Number | Name | Arithmetic | Function | Comparison | Not | Logic

_PLAIN_NAME: Final = re.compile(r"(?!(and|or|not|when|within)$)[^\W\d][\w-]*(\.\w[\w-]*)*")


def read_expression(node: SyntaxNode, source: SourceText) -> Expression:
    """Return the expression that a node of the syntax tree of ``source`` means.

    Raises :class:`InputError` for a number in a unit that nobody knows.
    """
    column = node._tx_position
    match type(node).__name__:
        case "Or" | "And" as rule:
            operands = tuple(read_expression(operand, source) for operand in node.operands)
            if len(operands) == 1:
                return operands[0]
            return Logic("or" if rule == "Or" else "and", operands, column)
        case "Negation":
            return Not(read_expression(node.operand, source), column)
        case "Comparison":
            left = read_expression(node.left, source)
            if not node.right:
                return left
            return Comparison(node.operator, left, read_expression(node.right, source), column)
        case "Sum" | "Product":
            result = read_expression(node.first, source)
            for tail in node.rest:
                operand = read_expression(tail.operand, source)
                result = Arithmetic(tail.operator, result, operand, column)
            return result
        case "Minus":
            return Function("-", (read_expression(node.operand, source),), column)
        case "Group":
            return read_expression(node.expression, source)
        case "Quantity":
            return read_number(node, source)
    arguments = tuple(read_expression(argument, source) for argument in node.arguments)
    if node.name in ("abs", "min", "max") and arguments:
        return Function(node.name, arguments, column)
    return Name(read_name(node.name), arguments, column)


def read_name(text: str) -> str:
    """Return a name without the quotes around it."""
    return text[1:-1] if text[0] in "\"'" else text


def read_number(node: SyntaxNode, source: SourceText) -> Number:
    """Return a number in SI units; raises :class:`InputError` for a unit that nobody knows."""
    text = source.text[node._tx_position : node._tx_position_end]
    unit = " ".join((node.unit or "").split())
    try:
        # Fifteen digits are what people write, binary fractions have more.
        dimension, value = read_unit(unit)[1], float(f"{to_si(float(node.number), unit):.15g}")
    except ValueError as error:
        raise InputError.at(source.at(node), str(error)) from error
    if not math.isfinite(value):
        raise InputError.at(source.at(node), f"{text} is too large")
    return Number(value, dimension, text, node._tx_position)


def parts_of(expression: Expression) -> tuple[Expression, ...]:
    """Return the expressions that one is put together from; arguments of names are no parts."""
    match expression:
        case Arithmetic(left=left, right=right) | Comparison(left=left, right=right):
            return (left, right)
        case Function(operands=operands) | Logic(operands=operands):
            return operands
        case Not(operand=operand):
            return (operand,)
    return ()


def walk(expression: Expression) -> Sequence[Expression]:
    """Return an expression and everything in it, in the order written."""
    parts: list[Expression] = []
    pending = [expression]
    while pending:
        parts.append(pending.pop())
        pending += reversed(parts_of(parts[-1]))
    return parts


def fold(expression: Expression, visit: Callable[[Expression, Sequence[T]], T]) -> T:
    """Return ``visit(expression, results)``, with the results of its parts, from the inside out."""
    results: list[T] = []
    for part in reversed(walk(expression)):
        results.append(visit(part, [results.pop() for _ in parts_of(part)]))
    return results.pop()


def render(expression: Expression) -> str:
    """Return ``expression`` as text again; compound parts in parentheses."""
    return fold(expression, _render)


def _render(expression: Expression, texts: Sequence[str]) -> str:
    pairs = zip(parts_of(expression), texts, strict=True)
    inner = [text if isinstance(part, Number | Name) else f"({text})" for part, text in pairs]
    match expression:
        case Number():
            return expression.text
        case Name(name=name, arguments=arguments):
            name = name if _PLAIN_NAME.fullmatch(name) else f'"{name}"'
            return f"{name}({', '.join(map(render, arguments))})" if arguments else name
        case Function(name="-"):
            return f"-{inner[0]}"
        case Function(name=name):
            return f"{name}({', '.join(texts)})"
        case Not():
            return f"not {inner[0]}"
        case Logic(operator=word):
            return f" {word} ".join(inner)
        case Arithmetic(operator=sign):
            return f" {sign} ".join(inner)
        case Comparison(operator=sign):
            return f" {sign} ".join(texts)


def evaluate(expression: Expression, value_of: Callable[[Name], float]) -> float:
    """Return the value [SI] of an expression: of a predicate 1 where it holds, 0 where it does not.

    Dividing by zero gives NaN, which is unknown; 0.1 + 0.2 equals 0.3.
    """

    def visit(part: Expression, values: Sequence[float]) -> float:
        match part:
            case Number(value=value):
                return value
            case Name():
                return value_of(part)
            case Arithmetic(operator=operator):
                return _calculate(operator, *values)
            case Function(name="-"):
                return -values[0]
            case Function(name="abs"):
                return abs(values[0])
            case Function(name=name):
                # Python's own minimum depends on where among its arguments NaN stands.
                extreme = min(values) if name == "min" else max(values)
                return math.nan if any(map(math.isnan, values)) else extreme
            case Comparison(operator=operator):
                return _compare(operator, *values)
            case Not():
                return 1.0 - values[0]
            case Logic(operator=operator):
                decisive = 0.0 if operator == "and" else 1.0
                # Otherwise all are alike, or some are unknown and with them the whole.
                return decisive if decisive in values else math.fsum(values) / len(values)

    return fold(expression, visit)


def _calculate(operator: str, left: float, right: float) -> float:
    match operator:
        case "+":
            return left + right
        case "-":
            return left - right
        case "*":
            return left * right
    return left / right if right else math.nan


def _compare(operator: ComparisonOperator, left: float, right: float) -> float:
    if math.isnan(left - right):
        return math.nan
    equal = math.isclose(left, right, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE)
    if operator in ("==", "!="):
        return float(equal is (operator == "=="))
    differs = left < right if operator in ("<", "<=") else left > right
    return float((differs and not equal) or (equal and operator in ("<=", ">=")))


class ExpressionLanguage(Language):
    """Expressions alone, or with words of a language around them on the same line."""

    def message(self, fault: SyntaxFault) -> str:
        """Return what is wrong with the word that stands there."""
        if not fault.word:
            return "the text ends too early: a parenthesis, a name or a quantity is missing"
        if fault.word in "<>=!" and re.search(r"[<>=]", fault.done):
            return 'comparisons cannot be chained: join two of them with "and"'
        return f'cannot read on at "{fault.rest.split()[0]}"'
