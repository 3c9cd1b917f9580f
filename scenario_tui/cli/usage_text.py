"""What is said of a value that was typed wrongly: typer has a library's words for it.

Those are about inputs and types; people typed a number, or one of some words.
"""

from __future__ import annotations

from enum import Enum
from typing import Any, Final

import typer

from grammars.text.diagnostics import closest

_NUMBERS: Final = {int: "whole number", float: "number"}


def plain_words(error: typer.TyperException) -> None:
    """Put a message about a typed value into our words; other messages stay as they are."""
    cause, parameter = error.__cause__, getattr(error, "param", None)
    read = getattr(cause, "errors", None)
    if read is None or parameter is None:
        return
    first = read()[0]
    typed, kind = first.get("input"), _kind_of(parameter)
    if kind in _NUMBERS:
        error.message = f"{str(typed)!r} is no {_NUMBERS[kind]}{_bounds(parameter)}"
    elif isinstance(kind, type) and issubclass(kind, Enum):
        words = [str(one.value) for one in kind]
        meant = closest(str(typed), words)
        hint = f'did you mean "{meant}"?' if meant else f"there are {', '.join(words)}"
        error.message = f"{str(typed)!r} is none of them: {hint}"


def _kind_of(parameter: Any) -> Any:
    """Return the class of what is typed; of several values that of one."""
    kind = parameter.type_descriptor.annotation
    inner = [one for one in getattr(kind, "__args__", ()) if one is not type(None)]
    return inner[0] if inner else kind


def _bounds(parameter: Any) -> str:
    low, high = getattr(parameter, "min", None), getattr(parameter, "max", None)
    if low is not None and high is not None:
        return f" from {low:g} to {high:g}"
    if low is not None:
        return f" of at least {low:g}"
    return f" of at most {high:g}" if high is not None else ""
