"""Numbers with units (``0.35 m``, ``20 min``, ``80 %``), read as SI values with a dimension.

Angle is a dimension of its own, so comparing radians with metres or with a plain number is an
error.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Annotated, Any, Final, TypeAlias

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import core_schema

from grammars.text.diagnostics import InputError, Where, with_article
from grammars.text.look_alikes import look_alike
from grammars.text.units import NAMES, SI_UNITS, WRITTEN_UNIT, read_unit, to_si

_PATTERN: Final = re.compile(
    rf"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>{WRITTEN_UNIT})?\s*"
)


_PARTS_OF_TIME: Final = re.compile(r"\s*\d+(?::\d+)+\s*|(?:\s*\d+\s*[a-z]+){2,}\s*")
"""A time in several parts: ``2:30``, ``2 min 30 s``."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A value in SI units and its dimension (a key of ``SI_UNITS``)."""

    value: float
    dimension: str

    @property
    def unit(self) -> str:
        """The SI unit of ``value``: ``m``, ``rad/s``, ``1`` for ratios."""
        return SI_UNITS[self.dimension]


def read_quantity(text: str, example: str = '"0.35 m"') -> Quantity:
    """Read ``text`` such as ``1.3 m``; a number without a unit is a ratio.

    Raises :class:`ValueError` with a message for people.
    """
    match = _PATTERN.fullmatch(text)
    if match is None or not math.isfinite(float(match["number"])):
        alike = look_alike(text)
        note = f"; {alike}" if alike else ""
        raise ValueError(f'"{text}" is not a number with a unit, such as {example}{note}')
    number = float(match["number"])
    if match["unit"] is None:
        return Quantity(number, "ratio")
    unit = " ".join(match["unit"].split())
    dimension = NAMES.get(read_unit(unit)[1])
    if dimension is None:
        raise ValueError(f'"{unit}" is not a unit of any quantity used here')
    return Quantity(to_si(number, unit), dimension)


def read_as(text: str | float | int, dimension: str) -> float:
    """Read a quantity of ``dimension`` and return its SI value; raises ``ValueError``.

    The unit is required unless ``dimension`` is ``ratio``.
    """
    if isinstance(text, bool) or not isinstance(text, str | float | int):
        raise ValueError(f"expected {with_article(dimension)} such as {_example(dimension)}")
    if isinstance(text, str) and dimension == "time" and _PARTS_OF_TIME.fullmatch(text):
        raise ValueError(f'"{text}" is no time here: write one number with a unit, such as "150 s"')
    example = _example(dimension)
    if isinstance(text, str):
        quantity = read_quantity(text, example)
    else:
        quantity = Quantity(float(text), "ratio")
    if quantity.dimension != dimension:
        value = f'"{text}"' if isinstance(text, str) else str(text)
        problem = "has no unit" if quantity.dimension == "ratio" else f"is in {quantity.unit}"
        raise ValueError(f"{value} {problem}, expected {with_article(dimension)} such as {example}")
    return quantity.value


@dataclass(frozen=True)
class QuantityField:
    """Marks a field that people write as a quantity of ``dimension``; JSON holds its SI value.

    With ``plain``, a number without a unit is an SI value. The JSON schema carries the mark as
    ``quantity``, so that editors can tell which texts are valid.
    """

    dimension: str
    plain: bool = False

    def read(self, value: Any) -> float:
        """Return the SI value; raises ``ValueError``."""
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return float(value) if self.plain and number else read_as(value, self.dimension)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        number = handler(source)
        text = core_schema.no_info_before_validator_function(self.read, number)
        return core_schema.json_or_python_schema(json_schema=number, python_schema=text)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> Any:
        return handler(schema) | {"quantity": {"dimension": self.dimension, "plain": self.plain}}


Length: TypeAlias = Annotated[float, QuantityField("length")]
Angle: TypeAlias = Annotated[float, QuantityField("angle")]
Duration: TypeAlias = Annotated[float, QuantityField("time")]
Mass: TypeAlias = Annotated[float, QuantityField("mass")]
Frequency: TypeAlias = Annotated[float, QuantityField("frequency")]
Speed: TypeAlias = Annotated[float, QuantityField("speed")]
AngularSpeed: TypeAlias = Annotated[float, QuantityField("angular speed")]
Acceleration: TypeAlias = Annotated[float, QuantityField("acceleration")]
AngularAcceleration: TypeAlias = Annotated[float, QuantityField("angular acceleration")]
Force: TypeAlias = Annotated[float, QuantityField("force")]
Torque: TypeAlias = Annotated[float, QuantityField("torque")]
Ratio: TypeAlias = Annotated[float, QuantityField("ratio")]


def parse_quantity(text: str, where: Where) -> Quantity:
    """Read like :func:`read_quantity`, but raise :class:`InputError` with the place."""
    try:
        return read_quantity(text)
    except ValueError as error:
        raise InputError.at(where, str(error)) from error


def parse_in(text: str, unit: str, subject: str, where: Where) -> float:
    """Return the SI value of a quantity that must be in ``unit``, the unit of ``subject``.

    Raises :class:`InputError` with the place.
    """
    quantity = parse_quantity(text, where)
    if quantity.unit != unit:
        problem = "has no unit" if quantity.unit == "1" else f"is in {quantity.unit}"
        expected = "a plain number" if unit == "1" else f"in {unit}"
        raise InputError.at(where, f'"{text}" {problem}, {subject} is {expected}')
    return quantity.value


def unit_of(dimension: str) -> str:
    """Return the SI unit of ``dimension``."""
    return SI_UNITS[dimension]


def _example(dimension: str) -> str:
    unit = SI_UNITS[dimension]
    return '"0.5"' if unit == "1" else f'"0.5 {unit}"'
