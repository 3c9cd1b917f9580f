"""Dimensions with algebra: what a product or quotient of signals is measured in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from grammars.quantity import unit_of

_BASE: Final = ("m", "rad", "s", "kg")
_NAMED: Final = {
    "ratio": (0, 0, 0, 0),
    "length": (1, 0, 0, 0),
    "angle": (0, 1, 0, 0),
    "time": (0, 0, 1, 0),
    "mass": (0, 0, 0, 1),
    "frequency": (0, 0, -1, 0),
    "speed": (1, 0, -1, 0),
    "angular speed": (0, 1, -1, 0),
    "acceleration": (1, 0, -2, 0),
    "angular acceleration": (0, 1, -2, 0),
    "force": (1, 0, -2, 1),
}
_NAMES: Final = {exponents: name for name, exponents in _NAMED.items()}


@dataclass(frozen=True, slots=True)
class Dimension:
    """Integer exponents of metre, radian, second and kilogram."""

    exponents: tuple[int, int, int, int]

    @property
    def unit(self) -> str:
        """The SI unit: ``m``, ``m/s``, ``1`` for a plain number."""
        name = _NAMES.get(self.exponents)
        if name is not None:
            return unit_of(name)
        above = " ".join(_power(u, e) for u, e in zip(_BASE, self.exponents, strict=True) if e > 0)
        below = "/".join(_power(u, -e) for u, e in zip(_BASE, self.exponents, strict=True) if e < 0)
        return f"{above or '1'}/{below}" if below else above

    def __mul__(self, other: Dimension) -> Dimension:
        return self._combine(other, 1)

    def __truediv__(self, other: Dimension) -> Dimension:
        return self._combine(other, -1)

    def _combine(self, other: Dimension, sign: int) -> Dimension:
        a, b = self.exponents, other.exponents
        return Dimension(
            (a[0] + sign * b[0], a[1] + sign * b[1], a[2] + sign * b[2], a[3] + sign * b[3])
        )


def dimension(name: str) -> Dimension:
    """Return a dimension by its name in :mod:`grammars.quantity`; ``ValueError`` if unused here."""
    exponents = _NAMED.get(name)
    if exponents is None:
        raise ValueError(f"a {name} is not something a signal can have")
    return Dimension(exponents)


RATIO: Final = dimension("ratio")
LENGTH: Final = dimension("length")
ANGLE: Final = dimension("angle")
TIME: Final = dimension("time")
SPEED: Final = dimension("speed")
ANGULAR_SPEED: Final = dimension("angular speed")


def _power(unit: str, exponent: int) -> str:
    return unit if exponent == 1 else f"{unit}^{exponent}"
