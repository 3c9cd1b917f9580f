"""Units of all languages: unit words, their products, and conversion to SI.

Words exist for length, angle, time, mass, frequency and force, with the prefixes milli, centi and
kilo. Products such as ``N m s/rad`` combine them.
"""

from __future__ import annotations

import functools
import math
import re
from dataclasses import dataclass
from typing import Final

from grammars.text.diagnostics import did_you_mean


@dataclass(frozen=True, slots=True)
class Dimension:
    """Exponents of metre, radian, second and kilogram."""

    exponents: tuple[float, float, float, float]

    @property
    def unit(self) -> str:
        """The SI unit: ``m``, ``m/s``, ``1`` for a plain number."""
        name = NAMES.get(self)
        if name is not None:
            return SI_UNITS[name]
        above, below = self.factors(1), self.factors(-1)
        return f"{' '.join(above) or '1'}/{'/'.join(below)}" if below else " ".join(above)

    def factors(self, sign: int = 1) -> list[str]:
        """Return the powers of base units (``m``, ``s^2``) whose exponents have this sign."""
        powers = zip(("m", "rad", "s", "kg"), self.exponents, strict=True)
        signed = ((unit, power * sign) for unit, power in powers if power * sign > 0)
        return [unit if power == 1 else f"{unit}^{power:g}" for unit, power in signed]

    def __mul__(self, other: Dimension) -> Dimension:
        return self._plus(other, 1.0)

    def __truediv__(self, other: Dimension) -> Dimension:
        return self._plus(other, -1.0)

    def __pow__(self, power: float) -> Dimension:
        return RATIO._plus(self, power)

    def _plus(self, other: Dimension, times: float) -> Dimension:
        m, rad, s, kg = (
            a + times * b for a, b in zip(self.exponents, other.exponents, strict=True)
        )
        return Dimension((m, rad, s, kg))


RATIO: Final = Dimension((0.0, 0.0, 0.0, 0.0))
LENGTH: Final = Dimension((1.0, 0.0, 0.0, 0.0))
ANGLE: Final = Dimension((0.0, 1.0, 0.0, 0.0))
TIME: Final = Dimension((0.0, 0.0, 1.0, 0.0))
MASS: Final = Dimension((0.0, 0.0, 0.0, 1.0))
SPEED: Final = LENGTH / TIME
ANGULAR_SPEED: Final = ANGLE / TIME
FORCE: Final = MASS * SPEED / TIME

SI_UNITS: Final = {
    "ratio": "1",
    "length": "m",
    "area": "m^2",
    "angle": "rad",
    "time": "s",
    "mass": "kg",
    "frequency": "Hz",
    "speed": "m/s",
    "angular speed": "rad/s",
    "acceleration": "m/s^2",
    "angular acceleration": "rad/s^2",
    "force": "N",
    "torque": "N m",
    "stiffness": "N/m",
    "torsional stiffness": "N m/rad",
    "damping": "N s/m",
    "torsional damping": "N m s/rad",
    "noise per root length": "m/m^0.5",
    "noise per root angle": "rad/rad^0.5",
    "drift per root length": "rad/m^0.5",
}
"""SI unit of each named dimension."""

_PREFIXES: Final = (("milli", "m", 1e-3), ("centi", "c", 1e-2), ("kilo", "k", 1e3))
_DEGREE: Final = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class _BaseUnit:
    """Names and symbols of one unit, its factor to SI, and whether prefixes are allowed."""

    names: tuple[str, ...]
    symbols: tuple[str, ...]
    factor: float
    dimension: Dimension
    prefixed: bool


_BASES: Final = (
    _BaseUnit(("metre", "metres", "meter", "meters"), ("m",), 1.0, LENGTH, True),
    _BaseUnit(("radian", "radians"), ("rad",), 1.0, ANGLE, True),
    _BaseUnit(("degree", "degrees"), ("deg",), _DEGREE, ANGLE, True),
    _BaseUnit((), ("°",), _DEGREE, ANGLE, False),
    _BaseUnit(("second", "seconds"), ("s",), 1.0, TIME, True),
    _BaseUnit(("minute", "minutes"), ("min",), 60.0, TIME, False),
    _BaseUnit(("hour", "hours"), ("h",), 3600.0, TIME, False),
    _BaseUnit(("gram", "grams"), ("g",), 1e-3, MASS, True),
    _BaseUnit(("hertz",), ("Hz",), 1.0, RATIO / TIME, True),
    _BaseUnit(("newton", "newtons"), ("N",), 1.0, FORCE, True),
    _BaseUnit(("percent",), ("pct", "%"), 0.01, RATIO, False),
)


def _words() -> dict[str, tuple[float, Dimension]]:
    words: dict[str, tuple[float, Dimension]] = {}
    for base in _BASES:
        words |= dict.fromkeys((*base.names, *base.symbols), (base.factor, base.dimension))
        for long, short, times in _PREFIXES if base.prefixed else ():
            spelled = [long + name for name in base.names] + [short + name for name in base.symbols]
            words |= dict.fromkeys(spelled, (times * base.factor, base.dimension))
    return words


UNIT_WORDS: Final = _words()
"""Factor to SI and dimension of every unit word."""
_COMMON: Final = ("m", "cm", "s", "min", "rad", "deg", "kg", "N", "N m", "Hz", "m/s", "rad/s")


def words_of(*dimensions: Dimension) -> str:
    """Return a regular expression for the unit words of the given dimensions, or of all."""
    bases = [base for base in _BASES if not dimensions or base.dimension in dimensions]
    forms = []
    for prefixed, long, short in ((True, "(?:milli|centi|kilo)?", "[mck]?"), (False, "", "")):
        names = [name for base in bases if base.prefixed is prefixed for name in base.names]
        symbols = [name for base in bases if base.prefixed is prefixed for name in base.symbols]
        forms += [f"{long}(?:{'|'.join(names)})"] if names else []
        forms += [f"{short}(?:{'|'.join(symbols)})"] if symbols else []
    return f"(?:{'|'.join(forms)})"


# Powers and the number of factors are bounded, since files may come from untrusted sources.
_POWER: Final = r"(?:\^(?:[1-4](?:\.\d)?|0?\.5)|[²³])?"
FACTOR: Final = rf"{words_of()}(?![^\W²³]){_POWER}"
"""Regular expression for a unit word and its power."""
UNIT: Final = rf"{FACTOR}(?:(?:[ \t]*[*/][ \t]*|[ \t]+){FACTOR}){{0,5}}"
"""Regular expression for a product of units; the match ends before the next word of a sentence."""
_WRITTEN: Final = r"(?:[A-Za-z°]+|%)(?:\^[\d.]+|[²³])?"
WRITTEN_UNIT: Final = rf"{_WRITTEN}(?:(?:\s*[*/]\s*|\s+){_WRITTEN}){{0,5}}"
"""Regular expression for anything that looks like a unit, known or unknown."""
_PART: Final = re.compile(
    rf"(?P<by>[ \t]*[*/][ \t]*|[ \t]+|^)(?P<word>[A-Za-z°]+|%)(?P<power>{_POWER})"
)
_POWERS: Final = {"": 1.0, "²": 2.0, "³": 3.0}
_MOST_FACTORS: Final = 6


@functools.cache
def read_unit(text: str) -> tuple[float, Dimension]:
    """Return the factor to SI and the dimension of a product of units; no text is a plain number.

    Raises :class:`ValueError` with a message for people.
    """
    parts = list(_PART.finditer(text))
    whole = "".join(part[0] for part in parts) == text and len(parts) <= _MOST_FACTORS
    starts_well = not parts or not parts[0]["by"]
    if not (whole and starts_well) or any(part["word"] not in UNIT_WORDS for part in parts):
        singular = text.removesuffix("s")
        hint = did_you_mean(text, [singular] if singular in UNIT_WORDS else _COMMON)
        raise ValueError(f'"{text}" is not a unit: {hint}')
    powers: dict[str, float] = {}
    for part in parts:
        power = _POWERS.get(part["power"]) or float(part["power"][1:])
        signed = -power if "/" in part["by"] else power
        powers[part["word"]] = powers.get(part["word"], 0.0) + signed
    factor, dimension = 1.0, RATIO
    for word, power in powers.items():
        size, of = UNIT_WORDS[word]
        factor = factor * size**power if power > 0.0 else factor / size**-power
        dimension *= of**power
    return factor, dimension


def to_si(number: float, unit: str) -> float:
    """Return the SI value of a number in a unit."""
    factor, _ = read_unit(unit)
    inverse = round(1.0 / factor)
    # Division is exact where multiplication is not: 95 % is 0.95, not 0.9500000000000001.
    return number / inverse if _is_inverse(inverse, factor) else number * factor


def from_si(value: float, unit: str) -> float:
    """Return an SI value as a number of ``unit``."""
    factor, _ = read_unit(unit)
    inverse = round(1.0 / factor)
    return value * inverse if _is_inverse(inverse, factor) else value / factor


def _is_inverse(inverse: int, factor: float) -> bool:
    return math.isclose(inverse * factor, 1.0, rel_tol=1e-12)


DIMENSIONS: Final = {
    name: RATIO if unit == "1" else read_unit(unit)[1] for name, unit in SI_UNITS.items()
}
"""Dimensions by name."""
NAMES: Final = {dimension: name for name, dimension in DIMENSIONS.items()}
"""Names of dimensions."""
