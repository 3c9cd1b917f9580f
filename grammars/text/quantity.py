"""Numbers with units: ``0.35 m``, ``20 min``, ``80 %``, read into SI values with a dimension.

Angles are a dimension of their own here (a plain number is never an angle), so comparing radians
with metres or with a bare number is an error and not a surprise.
"""

from __future__ import annotations

import functools
import math
import re
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

from grammars.text.diagnostics import InputError, Where, did_you_mean, with_article
from grammars.text.unit_table import SI_UNITS, UNITS

PlanDimension: TypeAlias = Literal["length", "angle"]
PLAN_UNITS: Final[dict[str, tuple[float, PlanDimension]]] = {
    "m": (1.0, "length"),
    "rad": (1.0, "angle"),
    "deg": (math.pi / 180.0, "angle"),
}
"""The units of floor plans and their variations: factor to SI and dimension.

A table of its own because plans are read a thousand at a time, and mostly without need for pint.
"""

_DEFINITIONS: Final = """\
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
metre = [length] = m = meter = metres = meters
second = [time] = s = seconds
gram = [mass] = g
radian = [angle] = rad = radians
degree = 0.017453292519943295 * radian = deg = degrees
minute = 60 * second = min = minutes
hour = 3600 * second = h = hours
hertz = 1 / second = Hz
newton = kilogram * metre / second ** 2 = N
percent = 0.01 = pct
"""

_PATTERN: Final = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[A-Za-z%°][^\n]*?)?\s*"
)
# What pint is handed is bounded: it evaluates what it takes for a unit, and a long product or a
# large power in a file from elsewhere would take it minutes.
_UNIT: Final = re.compile(r"(?:[A-Za-z%°]+|1)(?:\^[1-4](?:\.\d)?|\^0?\.5)?")
_UNIT_PRODUCT: Final = re.compile(rf"{_UNIT.pattern}(?:(?:\s*[*/]\s*|\s+){_UNIT.pattern}){{0,5}}")
_COMMON_UNITS: Final = ("m", "cm", "mm", "s", "min", "rad", "deg", "kg", "N", "Hz", "m/s", "rad/s")


@dataclass(frozen=True, slots=True)
class Quantity:
    """A value in SI units and its dimension (a key of the table of SI units)."""

    value: float
    dimension: str

    @property
    def unit(self) -> str:
        """The SI unit of ``value``: ``m``, ``rad/s``, ``1`` for ratios."""
        return SI_UNITS[self.dimension]


@dataclass(frozen=True, slots=True)
class Dimension:
    """Integer exponents of metre, radian, second and kilogram."""

    exponents: tuple[int, int, int, int]

    @property
    def unit(self) -> str:
        """The SI unit: ``m``, ``m/s``, ``1`` for a plain number."""
        name = _NAMES.get(self)
        if name is not None:
            return SI_UNITS[name]
        above, below = self.factors(1), self.factors(-1)
        return f"{' '.join(above) or '1'}/{'/'.join(below)}" if below else " ".join(above)

    def factors(self, sign: int = 1) -> list[str]:
        """Return the powers of base units, ``m``, ``s^2``, whose exponents have this sign."""
        powers = zip(("m", "rad", "s", "kg"), self.exponents, strict=True)
        found = ((unit, power * sign) for unit, power in powers if power * sign > 0)
        return [unit if power == 1 else f"{unit}^{power}" for unit, power in found]

    def __mul__(self, other: Dimension) -> Dimension:
        return self._combine(other, 1)

    def __truediv__(self, other: Dimension) -> Dimension:
        return self._combine(other, -1)

    def _combine(self, other: Dimension, sign: int) -> Dimension:
        a, b = self.exponents, other.exponents
        return Dimension(
            (a[0] + sign * b[0], a[1] + sign * b[1], a[2] + sign * b[2], a[3] + sign * b[3])
        )


RATIO: Final = Dimension((0, 0, 0, 0))
LENGTH: Final = Dimension((1, 0, 0, 0))
ANGLE: Final = Dimension((0, 1, 0, 0))
TIME: Final = Dimension((0, 0, 1, 0))
MASS: Final = Dimension((0, 0, 0, 1))
SPEED: Final = LENGTH / TIME
ANGULAR_SPEED: Final = ANGLE / TIME

DIMENSIONS: Final = {
    "ratio": RATIO,
    "length": LENGTH,
    "angle": ANGLE,
    "time": TIME,
    "mass": MASS,
    "frequency": RATIO / TIME,
    "speed": SPEED,
    "angular speed": ANGULAR_SPEED,
    "acceleration": SPEED / TIME,
    "angular acceleration": ANGULAR_SPEED / TIME,
    "force": MASS * SPEED / TIME,
}
"""The dimensions that are calculated with, by name."""
_NAMES: Final = {dimension: name for name, dimension in DIMENSIONS.items()}


@functools.cache
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry(None)
    registry.load_definitions(_DEFINITIONS.splitlines())
    return registry


@functools.cache
def _dimensions() -> dict[Any, str]:
    return {_dimensionality(unit): name for name, unit in SI_UNITS.items()}


def _parse_unit(text: str) -> Any:
    """Return the pint unit written in ``text``; blanks multiply (``N m``)."""
    spelled = text.replace("%", "percent").replace("°", "degree").replace("^", "**")
    spelled = re.sub(r"(?<=[A-Za-z])\s+(?=[A-Za-z])", "*", spelled.strip())
    return _registry().parse_units("" if spelled == "1" else spelled)


def _dimensionality(text: str) -> Any:
    dimensionality = _registry().get_dimensionality(_parse_unit(text))
    # Powers of roots, m/m^0.5, come back with the noise of floating point.
    return tuple(sorted((name, round(power, 9)) for name, power in dimensionality.items()))


def read_quantity(text: str) -> Quantity:
    """Read ``text`` such as ``1.3 m``; a number without a unit is a ratio.

    Raises :class:`ValueError` with a message for people.
    """
    match = _PATTERN.fullmatch(text)
    if match is None:
        raise ValueError(f'"{text}" is not a number with a unit, such as "0.35 m"')
    number, unit_text = float(match["number"]), match["unit"] or "1"
    if not _UNIT_PRODUCT.fullmatch(unit_text) or not math.isfinite(number):
        raise ValueError(f'"{text}" is not a number with a unit, such as "0.35 m"')
    return _convert(number, unit_text)


@functools.cache
def _unit(unit_text: str) -> tuple[float, str]:
    """Return (factor to SI, dimension) of a unit; raises ``ValueError``."""
    if unit_text in UNITS:
        return UNITS[unit_text]
    return calculate_unit(unit_text)


def calculate_unit(unit_text: str) -> tuple[float, str]:
    """Return (factor to SI, dimension) of a unit, calculated by pint; raises ``ValueError``."""
    import pint

    try:
        unit = _parse_unit(unit_text)
        dimension = _dimensions().get(_dimensionality(unit_text))
    except (pint.PintError, pint.UndefinedUnitError, TypeError, ValueError) as error:
        hint = did_you_mean(unit_text, _COMMON_UNITS)
        raise ValueError(f'"{unit_text}" is not a unit: {hint}') from error
    if dimension is None:
        raise ValueError(f'"{unit_text}" is a unit of nothing that is measured here')
    factor = _registry().Quantity(1.0, unit).to(_parse_unit(SI_UNITS[dimension])).magnitude
    return float(factor), dimension


def _convert(number: float, unit_text: str) -> Quantity:
    factor, dimension = _unit(" ".join(unit_text.split()))
    inverse = round(1.0 / factor)
    if math.isclose(inverse * factor, 1.0, rel_tol=1e-12):
        # Dividing is exact where multiplying is not: 95 % is 0.95, not 0.9500000000000001.
        return Quantity(number / inverse, dimension)
    return Quantity(number * factor, dimension)


def read_as(text: str | float | int, dimension: str) -> float:
    """Read a quantity of ``dimension`` and return its SI value; raises ``ValueError``.

    The unit is required unless ``dimension`` is ``ratio``.
    """
    if isinstance(text, bool) or not isinstance(text, str | float | int):
        raise ValueError(f"expected {with_article(dimension)} such as {_example(dimension)}")
    quantity = read_quantity(text) if isinstance(text, str) else Quantity(float(text), "ratio")
    if quantity.dimension != dimension:
        given = f'"{text}"' if isinstance(text, str) else str(text)
        has = "has no unit" if quantity.dimension == "ratio" else f"is in {quantity.unit}"
        raise ValueError(
            f"{given} {has}, expected {with_article(dimension)} such as {_example(dimension)}"
        )
    return quantity.value


def parse_quantity(text: str, where: Where) -> Quantity:
    """Like :func:`read_quantity`, raising :class:`InputError` with the place."""
    try:
        return read_quantity(text)
    except ValueError as error:
        raise InputError.at(where, str(error)) from error


def parse_in(text: str, unit: str, subject: str, where: Where) -> float:
    """Return the SI value of a quantity that must be in ``unit``, as ``subject`` is.

    Raises :class:`InputError` with the place.
    """
    found = parse_quantity(text, where)
    if found.unit != unit:
        given = "has no unit" if found.unit == "1" else f"is in {found.unit}"
        wanted = "a plain number" if unit == "1" else f"in {unit}"
        raise InputError.at(where, f'"{text}" {given}, {subject} is {wanted}')
    return found.value


def unit_of(dimension: str) -> str:
    """Return the SI unit values of ``dimension`` are kept in."""
    return SI_UNITS[dimension]


def _example(dimension: str) -> str:
    unit = SI_UNITS[dimension]
    return '"0.5"' if unit == "1" else f'"0.5 {unit}"'
