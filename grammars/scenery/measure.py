"""Quantities of a scenery: numbers with a unit, kept as they were written."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Final

from grammars.text.diagnostics import InputError, Where, with_article
from grammars.text.quantity import parse_quantity, unit_of
from grammars.text.words import enumerate_words

LARGEST: Final = 1e6
"""No quantity of a scenery is larger than this, in SI units."""
_NUMBER: Final = re.compile(r"\s*([-+]?[\d.,]+(?:[eE][-+]?\d+)?)")
_DEGREES: Final = {"angle": "deg", "angular speed": "deg/s"}
"""Units that people rather write than those of SI."""


@dataclass(frozen=True, slots=True)
class Measure:
    """``value`` in SI units and radians; ``text`` as it was written."""

    value: float
    dimension: str
    text: str
    where: Where = field(compare=False)

    def __str__(self) -> str:
        return self.text


def parse_measure(text: str, where: Where, *dimensions: str) -> Measure:
    """Read ``1.3 m``, of one of ``dimensions`` if any are given.

    Raises :class:`InputError` when it is no number with such a unit.
    """
    # A blank behind the number, whether one was written or not.
    spelled = " ".join(_NUMBER.sub(r"\1 ", text, count=1).split())
    number, _, unit = spelled.partition(" ")
    if "," in number:
        raise InputError.at(where, "decimals are written with a point", "1.5, not 1,5")
    if number and not unit and "ratio" not in dimensions:
        units = [_DEGREES.get(dimension, unit_of(dimension)) for dimension in dimensions]
        hint = f"write {number} m, {number} rad, {number} s, … as is meant"
        if units:
            hint = f"write {enumerate_words([f'{number} {unit}' for unit in units], 'or')}"
        raise InputError.at(where, f"a unit is missing after {number}", hint)
    quantity = parse_quantity(spelled, where)
    if abs(quantity.value) > LARGEST:
        message = f"{spelled} is more than anything in a building"
        raise InputError.at(where, message, "is the unit right?")
    measure = Measure(quantity.value, quantity.dimension, spelled, where)
    if dimensions:
        require_dimension(measure, *dimensions)
    return measure


def require_dimension(value: Measure, *dimensions: str) -> float:
    """Return the SI value if it has one of ``dimensions``; raises :class:`InputError` else."""
    if value.dimension in dimensions:
        return value.value
    needed = enumerate_words([_in_words(d) for d in dimensions], "or")
    is_ratio = dimensions[0] == "ratio"
    raise InputError.at(
        value.where,
        f"{needed} is needed here, {value.text} is {_in_words(value.dimension)}",
        "write it as 0.5 or 50 %" if is_ratio else f"write it in {unit_of(dimensions[0])}",
    )


def _in_words(dimension: str) -> str:
    """Return ``a length``, ``an angle``; stiffness and damping go without an article."""
    countless = dimension.endswith(("stiffness", "damping"))
    return dimension if countless else with_article(dimension)
