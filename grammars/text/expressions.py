"""Sums, comparisons and logic of named values, shared by all languages.

The grammar is ``expressions.tx``; each language defines the meaning of names. ``column`` of an
expression is the offset of its first character in its source text. Equality ignores places and
spelling. No function recurses through an expression: a sum of a thousand terms is a thousand deep.
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
    rule_of,
)
from grammars.text.parsing import Language, SyntaxFault
from grammars.text.units import Dimension, read_unit, to_si

T = TypeVar("T")

ComparisonOperator: TypeAlias = Literal["<=", "<", ">=", ">", "==", "!="]
_TOLERANCE: Final = 1e-9
"""Tolerance of equality: absolute up to 1, relative above."""


@dataclass(frozen=True, slots=True)
class Number:
    """A constant: SI ``value`` of ``dimension``, and its source text."""

    value: float
    dimension: Dimension
    text: str = field(compare=False)
    column: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Name:
    """A named value, possibly with arguments: ``clearance(0.35 m, 0.2 m)``."""

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
    """A function of expressions: negation and ``abs`` of one, ``min`` and ``max`` of any number."""

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
    """Negation of a predicate."""

    operand: Expression
    column: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Logic:
    """``and`` or ``or`` of at least two predicates."""

    operator: Literal["and", "or"]
    operands: tuple[Expression, ...]
    column: int = field(default=0, compare=False)


Expression: TypeAlias = Number | Name | Arithmetic | Function | Comparison | Not | Logic

_PLAIN_NAME: Final = re.compile(r"(?!(and|or|not|when|within|then)$)[^\W\d][\w-]*(\.\w[\w-]*)*")


def read_expression(node: SyntaxNode, source: SourceText) -> Expression:
    """Return the expression for a node of the syntax tree of ``source``.

    Raises :class:`InputError` for an unknown unit.
    """
    column = node._tx_position
    match rule_of(node):
        case "Or" | "And" as rule:
            operands = tuple(read_expression(operand, source) for operand in node.operands)
            if len(operands) == 1:
                return operands[0]
            return Logic("or" if rule == "Or" else "and", operands, column)
        case "Negation":
            return Not(read_expression(node.operand, source), column)
        case "Comparison":
            operand = read_expression(node.left, source)
            if not node.right:
                return operand
            return Comparison(node.operator, operand, read_expression(node.right, source), column)
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
    """Return a number in SI units; raises :class:`InputError` for an unknown unit."""
    text = source.text[node._tx_position : node._tx_position_end]
    unit = " ".join((node.unit or "").split())
    try:
        # People write up to fifteen digits; binary fractions have more.
        dimension, value = read_unit(unit)[1], float(f"{to_si(float(node.number), unit):.15g}")
    except ValueError as error:
        raise InputError.at(source.at(node), str(error)) from error
    if not math.isfinite(value):
        raise InputError.at(source.at(node), f"{text} is too large")
    return Number(value, dimension, text, node._tx_position)


def parts_of(expression: Expression) -> tuple[Expression, ...]:
    """Return the operands of an expression; arguments of names are not operands."""
    match expression:
        case Arithmetic() | Comparison():
            return (expression.left, expression.right)
        case Function(operands=operands) | Logic(operands=operands):
            return operands
        case Not(operand=operand):
            return (operand,)
    return ()


def walk(expression: Expression) -> Sequence[Expression]:
    """Return an expression and all its parts, in source order."""
    parts: list[Expression] = []
    pending = [expression]
    while pending:
        parts.append(pending.pop())
        pending += reversed(parts_of(parts[-1]))
    return parts


def fold(expression: Expression, visit: Callable[[Expression, Sequence[T]], T]) -> T:
    """Return ``visit(expression, results of its parts)``, evaluated from the inside out."""
    results: list[T] = []
    for part in reversed(walk(expression)):
        results.append(visit(part, [results.pop() for _ in parts_of(part)]))
    return results.pop()


def render(expression: Expression) -> str:
    """Return ``expression`` as text, with compound parts in parentheses."""
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
    """Return the SI value of an expression; a predicate is 1 if true and 0 if false.

    Division by zero gives NaN (unknown); 0.1 + 0.2 equals 0.3.
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
                # Python's min and max depend on the position of NaN among the arguments.
                extreme = min(values) if name == "min" else max(values)
                return math.nan if any(map(math.isnan, values)) else extreme
            case Comparison(operator=operator):
                return _compare(operator, *values)
            case Not():
                return 1.0 - values[0]
            case Logic(operator=operator):
                decisive = 0.0 if operator == "and" else 1.0
                # Otherwise all values are equal, or some are NaN and so is the result.
                return decisive if decisive in values else math.fsum(values) / len(values)

    return fold(expression, visit)


def _calculate(operator: str, a: float, b: float) -> float:
    match operator:
        case "+":
            return a + b
        case "-":
            return a - b
        case "*":
            return a * b
    return a / b if b else math.nan


def _compare(operator: ComparisonOperator, a: float, b: float) -> float:
    if math.isnan(a - b):
        return math.nan
    equal = math.isclose(a, b, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE)
    if operator in ("==", "!="):
        return float(equal is (operator == "=="))
    differs = a < b if operator in ("<", "<=") else a > b
    return float((differs and not equal) or (equal and operator in ("<=", ">=")))


class ExpressionLanguage(Language):
    """Language of expressions, also with words of another language around them."""

    def message(self, fault: SyntaxFault) -> str:
        """Return the message about an unexpected word."""
        if not fault.word:
            return "the text ends too early: a parenthesis, a name or a quantity is missing"
        if fault.word in "<>=!" and re.search(r"[<>=]", fault.done):
            return 'comparisons cannot be chained: join two of them with "and"'
        return f'cannot read on at "{fault.rest.split()[0]}"'
