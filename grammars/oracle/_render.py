"""Expressions as text again, for messages that name one part of an oracle."""

from __future__ import annotations

from grammars.oracle._model import (
    Arithmetic,
    Comparison,
    Expression,
    Function,
    Logic,
    Not,
    Number,
    Signal,
)


def render(expression: Expression) -> str:
    """Return ``expression`` in the oracle language; compound parts in parentheses."""
    match expression:
        case Number():
            return expression.text
        case Signal(name=name, arguments=arguments):
            return f"{name}({', '.join(map(render, arguments))})" if arguments else name
        case Function(name="abs", operand=operand):
            return f"abs({render(operand)})"
        case Function(operand=operand):
            return f"-{_part(operand)}"
        case Not(operand=operand):
            return f"not {_part(operand)}"
        case Logic(operator=word, operands=operands):
            return f" {word} ".join(map(_part, operands))
        case Arithmetic(operator=sign, left=left, right=right):
            return f"{_part(left)} {sign} {_part(right)}"
        case Comparison(operator=sign, left=left, right=right):
            return f"{render(left)} {sign} {render(right)}"


def _part(expression: Expression) -> str:
    text = render(expression)
    return text if isinstance(expression, Number | Signal) else f"({text})"
