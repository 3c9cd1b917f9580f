"""Expressions of ``$(eval …)``: worked out from their syntax tree, never by the interpreter.

What launch files use is there: literals, names of args, the functions of roslaunch and of
:mod:`math`, comparisons, arithmetic, texts, ``and``, ``or``, ``not`` and ``if … else``. Whatever
could go on without end, or grow without bound, is refused.
Source of what means what: roslaunch.substitution_args (ROS Noetic).
"""

from __future__ import annotations

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeAlias

from grammars.text.diagnostics import did_you_mean

Value: TypeAlias = Any
"""A truth value, number, text, None, or a list or tuple of them."""
_LONGEST: Final = 2_000
_LARGEST: Final = 2**64
_MOST_CHARACTERS: Final = 10_000


def _round(number: float, digits: int = 0) -> Value:
    """Round as Python does; a thousand digits before the point would take for ever."""
    if abs(digits) > 20:
        raise ValueError("rounds to more digits than anybody means")
    return round(number, digits) if digits else round(number)


_BINARY: Final[dict[type[ast.operator], Callable[[Value, Value], Value]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
}
_UNARY: Final[dict[type[ast.unaryop], Callable[[Value], Value]]] = {
    ast.Not: operator.not_,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_COMPARED: Final[dict[type[ast.cmpop], Callable[[Value, Value], bool]]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda one, other: one in other,
    ast.NotIn: lambda one, other: one not in other,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
}
_CONSTANTS: Final = {
    "true": True, "false": False, "pi": math.pi, "e": math.e, "tau": math.tau, "inf": math.inf,
}  # fmt: skip
_FUNCTIONS: Final[dict[str, Callable[..., Value]]] = {
    **{name: getattr(math, name) for name in (
        "acos", "asin", "atan", "atan2", "ceil", "cos", "degrees", "exp", "fabs", "floor",
        "hypot", "isclose", "log", "log10", "radians", "sin", "sqrt", "tan", "trunc",
    )},
    "abs": abs, "bool": bool, "float": float, "int": int, "len": len, "max": max, "min": min,
    "pow": math.pow, "round": _round, "str": str,
}  # fmt: skip
_TEXT_METHODS: Final = frozenset(
    {"capitalize", "count", "endswith", "find", "isdigit", "lower", "lstrip", "replace", "rstrip",
     "split", "startswith", "strip", "title", "upper"}
)  # fmt: skip


class ExpressionError(ValueError):
    """An expression without a value, or one that is not worked out here; says why."""


def evaluate(
    text: str, args: Callable[[str], Value | None], functions: Mapping[str, Callable[..., Value]]
) -> Value:
    """Return the value of an expression.

    ``args`` gives the value of an arg by its name, None if there is none; ``functions`` come
    before all else of their name. Raises :class:`ExpressionError`, and what they raise.
    """
    if "__" in text:
        raise ExpressionError("double underscores are not allowed, by roslaunch either")
    if len(text) > _LONGEST:
        raise ExpressionError(f"is longer than {_LONGEST} characters")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(text.strip(), mode="eval")
        return _Evaluator(args, functions).value(tree.body)
    except SyntaxError as error:
        raise ExpressionError(f"is no expression: {error.msg}") from error
    except ExpressionError:
        raise
    except (RecursionError, MemoryError) as error:
        raise ExpressionError("is nested too deeply") from error
    except (TypeError, ValueError, ArithmeticError, LookupError) as error:
        raise ExpressionError(str(error)) from error


class _Evaluator:
    """Works out the nodes of one expression."""

    def __init__(
        self, args: Callable[[str], Value | None], functions: Mapping[str, Callable[..., Value]]
    ) -> None:
        self._args = args
        self._functions = {**_FUNCTIONS, **functions}

    def value(self, node: ast.AST) -> Value:
        """Return the value of a node, bounded."""
        found = self._value(node)
        number = isinstance(found, int) and not isinstance(found, bool)
        if number and abs(found) >= _LARGEST:
            raise ExpressionError("is a number too large to be meant")
        if isinstance(found, complex):
            raise ExpressionError("is the root of a negative number")
        if isinstance(found, str | list | tuple) and len(found) > _MOST_CHARACTERS:
            raise ExpressionError("is a text too long to be meant")
        return found

    def _value(self, node: ast.AST) -> Value:
        match node:
            case ast.Constant(bool() | int() | float() | str() | None as value):
                return value
            case ast.Name(name):
                return self._name(name)
            case ast.List(items):
                return [self.value(item) for item in items]
            case ast.Tuple(items):
                return tuple(self.value(item) for item in items)
            case ast.UnaryOp(sign, operand) if type(sign) in _UNARY:
                return _UNARY[type(sign)](self.value(operand))
            case ast.BinOp(left, sign, right) if type(sign) in _BINARY:
                return _combine(type(sign), self.value(left), self.value(right))
            case ast.BoolOp(sign, parts):
                return self._junction(isinstance(sign, ast.And), parts)
            case ast.Compare(left, signs, others):
                return self._comparison(left, signs, others)
            case ast.IfExp(test, then, otherwise):
                return self.value(then if self.value(test) else otherwise)
            case ast.Subscript(of, index):
                return self.value(of)[self._index(index)]
            case ast.Call(function, arguments, []):
                return self._call(function, [self.value(one) for one in arguments])
        raise ExpressionError(f'"{ast.unparse(node)}" is not worked out here')

    def _name(self, name: str) -> Value:
        if name in _CONSTANTS:
            return _CONSTANTS[name]
        found = self._args(name)
        if found is None:
            raise ExpressionError(f'no arg is called "{name}"')
        return found

    def _junction(self, every: bool, parts: list[ast.expr]) -> Value:
        """Return the first value that decides, or the last, as Python does."""
        found: Value = every
        for part in parts:
            found = self.value(part)
            if bool(found) is not every:
                return found
        return found

    def _comparison(self, left: ast.expr, signs: list[ast.cmpop], others: list[ast.expr]) -> bool:
        one = self.value(left)
        for sign, node in zip(signs, others, strict=True):
            other = self.value(node)
            if not _COMPARED[type(sign)](one, other):
                return False
            one = other
        return True

    def _index(self, node: ast.expr) -> Value:
        if isinstance(node, ast.Slice):
            parts = (node.lower, node.upper, node.step)
            return slice(*(None if part is None else self.value(part) for part in parts))
        return self.value(node)

    def _call(self, function: ast.expr, arguments: list[Value]) -> Value:
        if isinstance(function, ast.Name):
            if function.id not in self._functions:
                hint = did_you_mean(function.id, self._functions)
                raise ExpressionError(f'no function is called "{function.id}" here; {hint}')
            return self._functions[function.id](*arguments)
        if isinstance(function, ast.Attribute) and function.attr in _TEXT_METHODS:
            of = self.value(function.value)
            if isinstance(of, str):
                return _call_method(of, function.attr, arguments)
        raise ExpressionError(f'"{ast.unparse(function)}()" is not worked out here')


def _combine(sign: type[ast.operator], one: Value, other: Value) -> Value:
    """Return the outcome of an operator, unless it could be larger than anybody means."""
    if sign is ast.Pow and (abs(other) > 64 or abs(one) > _LARGEST):
        raise ExpressionError("is a power too large to be meant")
    if sign is ast.Mult:
        for text, times in ((one, other), (other, one)):
            long = isinstance(text, str | list | tuple) and isinstance(times, int)
            if long and len(text) * times > _MOST_CHARACTERS:
                raise ExpressionError("is a text too long to be meant")
    if sign is ast.Mod and isinstance(one, str) and re.search(r"\d{4}|\*", one):
        raise ExpressionError("is a text too long to be meant")
    return _BINARY[sign](one, other)


def _call_method(text: str, method: str, arguments: list[Value]) -> Value:
    longest = max((len(one) for one in arguments if isinstance(one, str)), default=0)
    if method == "replace" and (len(text) + 1) * longest > _MOST_CHARACTERS:
        raise ExpressionError("is a text too long to be meant")
    return getattr(text, method)(*arguments)
