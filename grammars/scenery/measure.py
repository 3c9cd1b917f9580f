"""Quantities of a scenery: numbers with a unit, kept as they were written."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from grammars.text.diagnostics import InputError, Where, with_article
from grammars.text.quantity import parse_quantity, unit_of

NUMBER: Final = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
LARGEST: Final = 1e6
"""No quantity of a scenery is larger than this, in SI units."""


@dataclass(frozen=True, slots=True)
class Measure:
    """``value`` in SI units and radians; ``text`` as it was written."""

    value: float
    dimension: str
    text: str
    where: Where = field(compare=False)

    def __str__(self) -> str:
        return self.text


def parse_measure(text: str, where: Where) -> Measure:
    """Read ``1.3 m``; raises :class:`InputError` when it is no number with a unit."""
    spelled = " ".join(text.split())
    quantity = parse_quantity(spelled, where)
    if abs(quantity.value) > LARGEST:
        message = f"{spelled} is more than anything in a building"
        raise InputError.at(where, message, "is the unit right?")
    return Measure(quantity.value, quantity.dimension, spelled, where)


def require_dimension(value: Measure, *dimensions: str) -> float:
    """Return the SI value if it has one of ``dimensions``; raises :class:`InputError` else."""
    if value.dimension in dimensions:
        return value.value
    needed = " or ".join(_in_words(d) for d in dimensions)
    unit = unit_of(dimensions[0])
    raise InputError.at(
        value.where,
        f"{needed} is needed here, {value.text} is {_in_words(value.dimension)}",
        f"write it in {unit}",
    )


def _in_words(dimension: str) -> str:
    """Return ``a length``, ``an angle``; stiffness and damping go without an article."""
    countless = dimension.endswith(("stiffness", "damping"))
    return dimension if countless else with_article(dimension)
