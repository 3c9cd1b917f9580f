"""Inequalities of a search as they are written: chains, and names of what is not searched."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Final

from daemon.campaign._search_values import number_of
from daemon.campaign._searchable import SearchLayer
from daemon.model.search import SearchParameter
from grammars.text.inequalities import Inequality

_NAME: Final = re.compile(
    r"(?:(?P<sign>[+-])\s*)?(?<![\w.])(?P<name>[A-Za-z_][\w-]*(?:[./][\w-]+)*\.[\w./-]*\w)"
)
_COMPARED: Final = re.compile(r"(<=|>=|<|>)")


def has_words(parameter: SearchParameter) -> bool:
    """Return whether a parameter is a list of names or quantities, not of numbers."""
    return any(isinstance(choice, str) for choice in parameter.choices)


def is_named(text: str, name: str) -> bool:
    """Return whether an inequality names a parameter."""
    return any(found["name"] == name for found in _NAME.finditer(text))


def unknown_names(
    text: str, parameters: Sequence[SearchParameter], layers: Sequence[SearchLayer]
) -> list[str]:
    """Return the names in an inequality that are those of no value of the scenario."""
    searched = {parameter.name for parameter in parameters}
    return [
        found["name"]
        for found in _NAME.finditer(text)
        if found["name"] not in searched
        and all(layer.value_of(found["name"]) is None for layer in layers)
    ]


def with_fixed_values(
    text: str, parameters: Sequence[SearchParameter], layers: Sequence[SearchLayer]
) -> str:
    """Return an inequality with what is written in place of names that are not searched."""
    searched = {parameter.name for parameter in parameters}

    def fixed(found: re.Match[str]) -> str:
        sign, name = found["sign"] or "", found["name"]
        meant = [value for layer in layers if (value := layer.value_of(name)) is not None]
        if name in searched or len(meant) != 1 or number_of(meant[0]) is None:
            return found[0]
        text = meant[0].text
        if meant[0].unit and not re.search(r"[A-Za-z°]", text):
            text = f"{number_of(meant[0]):.12g} {meant[0].unit}"
        if not text.startswith("-"):
            return f"{sign} {text}".lstrip()
        return f"{'+' if sign == '-' else '-'} {text[1:]}"

    return _NAME.sub(fixed, text)


def comparisons(text: str) -> Iterator[str]:
    """Yield the comparisons of a chain: ``a < b < c`` is ``a < b`` and ``b < c``."""
    parts = _COMPARED.split(text)
    if len(parts) < 5:
        yield text
        return
    for at in range(0, len(parts) - 2, 2):
        yield f"{parts[at].strip()} {parts[at + 1]} {parts[at + 2].strip()}"


def least_sum(inequality: Inequality, parameters: Sequence[SearchParameter]) -> float:
    """Return the smallest sum that any point of the ranges has; what is above 0 never holds."""
    named = {parameter.name: parameter for parameter in parameters}
    least = inequality.constant
    for name, factor in inequality.factors:
        parameter = named[name]
        values = parameter.choices or (parameter.low, parameter.high)
        least += min(factor * float(value) for value in values)
    slack = 1e-9 * max(1.0, abs(inequality.constant))
    return least + slack if inequality.strict and least >= -slack else least - slack
