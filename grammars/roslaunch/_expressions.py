"""Values of ``$(eval …)``: Python expressions in launch files.

simpleeval evaluates them without the interpreter. They may contain literals, names of args,
functions of roslaunch and :mod:`math`, comparisons, arithmetic, texts, ``and``, ``or``, ``not`` and
``if … else``. Unbounded growth is refused. Source: roslaunch.substitution_args (ROS Noetic).
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeAlias

import simpleeval

from grammars.text.diagnostics import did_you_mean

Value: TypeAlias = Any
"""A truth value, number, text, None, or a list or tuple of them."""
_LONGEST: Final = 2_000
"""Largest length of expressions, texts and lists; a product of two lengths fits into memory."""
_LARGEST: Final = 2**64
_LARGEST_POWER: Final = 64
_NODES: Final = (
    ast.Attribute, ast.BinOp, ast.BoolOp, ast.Call, ast.Compare, ast.Constant, ast.IfExp,
    ast.List, ast.Name, ast.Slice, ast.Subscript, ast.Tuple, ast.UnaryOp,
)  # fmt: skip
_VALUES: Final = (bool, int, float, str, list, tuple, type(None))
_CONSTANTS: Final = {
    "true": True, "false": False, "pi": math.pi, "e": math.e, "tau": math.tau, "inf": math.inf,
}  # fmt: skip
_TEXT_METHODS: Final = {
    "capitalize", "count", "endswith", "find", "isdigit", "lower", "lstrip", "replace", "rstrip",
    "split", "startswith", "strip", "title", "upper",
}  # fmt: skip


class ExpressionError(ValueError):
    """An expression without a value or with an unsupported part; the text is the reason."""


def _power(base: Value, exponent: Value) -> Value:
    if abs(exponent) > _LARGEST_POWER or abs(base) > _LARGEST:
        raise ExpressionError("has a power that is too large")
    return base**exponent


def _product(one: Value, other: Value) -> Value:
    """Multiply numbers and texts; a repeated list of lists would grow without bound."""
    if isinstance(one, list | tuple) or isinstance(other, list | tuple):
        raise ExpressionError("repeats a list, which is not supported here")
    return simpleeval.safe_mult(one, other)


def _remainder(one: Value, other: Value) -> Value:
    if isinstance(one, str) and re.search(r"\d{4}|\*", one):
        raise ExpressionError("has a text that is too long")
    return one % other


def _rounded(number: float, digits: int = 0) -> Value:
    """Round as Python does, with a limit: rounding to a thousand digits takes forever."""
    if abs(digits) > 20:
        raise ExpressionError("rounds to too many digits")
    return round(number, digits) if digits else round(number)


_OPERATORS: Final = {
    **simpleeval.DEFAULT_OPERATORS, ast.Mult: _product, ast.Pow: _power, ast.Mod: _remainder,
}  # fmt: skip
_FUNCTIONS: Final[dict[str, Callable[..., Value]]] = {
    **{name: getattr(math, name) for name in (
        "acos", "asin", "atan", "atan2", "ceil", "cos", "degrees", "exp", "fabs", "floor",
        "hypot", "isclose", "log", "log10", "radians", "sin", "sqrt", "tan", "trunc",
    )},
    "abs": abs, "bool": bool, "float": float, "int": int, "len": len, "max": max, "min": min,
    "pow": math.pow, "round": _rounded, "str": str,
}  # fmt: skip


def evaluate(
    text: str, args: Callable[[str], Value | None], functions: Mapping[str, Callable[..., Value]]
) -> Value:
    """Return the value of an expression.

    ``args`` returns the value of an arg by its name, or ``None``. ``functions`` override others of
    the same name. Raises :class:`ExpressionError`, and the errors of ``args`` and ``functions``.
    """
    if "__" in text:
        raise ExpressionError("double underscores are not allowed, as in roslaunch")
    if len(text) > _LONGEST:
        raise ExpressionError(f"is longer than {_LONGEST} characters")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(text.strip(), mode="eval")
        return _value(text, tree.body, args, {**_FUNCTIONS, **functions})
    except SyntaxError as error:
        raise ExpressionError(f"is not an expression: {error.msg}") from error
    except ExpressionError:
        raise
    except simpleeval.FunctionNotDefined as error:
        hint = did_you_mean(error.func_name, (*functions, *_FUNCTIONS))
        message = f'there is no function "{error.func_name}" here; {hint}'
        raise ExpressionError(message) from error
    except simpleeval.NameNotDefined as error:
        raise ExpressionError(f'there is no arg "{error.name}"') from error
    except simpleeval.IterableTooLong as error:
        raise ExpressionError("has a text that is too long") from error
    except simpleeval.InvalidExpression as error:
        raise ExpressionError("is not supported here") from error
    except (RecursionError, MemoryError) as error:
        raise ExpressionError("is nested too deeply") from error
    except (TypeError, ValueError, ArithmeticError, LookupError) as error:
        raise ExpressionError(str(error)) from error


def _value(
    text: str,
    tree: ast.expr,
    args: Callable[[str], Value | None],
    functions: Mapping[str, Callable[..., Value]],
) -> Value:
    """Return the value of a tree; raises :class:`ExpressionError` for unsupported parts."""

    methods = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            is_known = node.attr in _TEXT_METHODS and id(node) in methods
        else:
            is_known = type(node) in _NODES or not isinstance(node, ast.expr | ast.keyword)
        if not is_known:
            raise ExpressionError(f'"{ast.unparse(node)}" is not supported here')

    def value_of(node: ast.Name) -> Value:
        value = _CONSTANTS[node.id] if node.id in _CONSTANTS else args(node.id)
        if value is None:
            raise simpleeval.NameNotDefined(node.id, text)
        return value

    evaluator = simpleeval.EvalWithCompoundTypes(
        _OPERATORS, functions, value_of, {str: _TEXT_METHODS}
    )
    evaluator.nodes = {kind: _bounded(evaluator.nodes[kind]) for kind in _NODES}
    return evaluator.eval(text, tree)


def _bounded(handler: Callable[[Any], Value]) -> Callable[[Any], Value]:
    """Return a handler of a kind of node that refuses values that are too large."""

    def bounded(node: Any) -> Value:
        value = handler(node)
        if isinstance(value, complex):
            raise ExpressionError("has the root of a negative number")
        if not isinstance(node, ast.Attribute | ast.Slice) and not isinstance(value, _VALUES):
            raise ExpressionError(f'"{ast.unparse(node)}" is not a value in launch files')
        is_number = isinstance(value, int) and not isinstance(value, bool)
        if is_number and abs(value) >= _LARGEST:
            raise ExpressionError("has a number that is too large")
        if isinstance(value, str | list | tuple) and len(value) > _LONGEST:
            raise ExpressionError("has a text that is too long")
        return value

    return bounded
