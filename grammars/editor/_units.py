"""How a quantity of one dimension looks, as a regular expression an editor can check.

The expressions accept what :func:`grammars.quantity.read_as` accepts in the usual spellings, and
refuse a missing unit and a unit of something else. They keep to what ECMA-262 with the ``u`` flag
and Python's ``re`` have in common.
"""

from __future__ import annotations

from typing import Final

_NUMBER: Final = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_PREFIX: Final = "(?:milli|centi|kilo|[mck])?"
_LENGTH: Final = rf"{_PREFIX}(?:metres?|meters?|m)"
_TIME: Final = rf"{_PREFIX}(?:seconds?|s|minutes?|mins?|hours?|h)"
_ANGLE: Final = rf"(?:{_PREFIX}(?:radians?|rads?|degrees?|degs?)|°)"
_MASS: Final = rf"{_PREFIX}(?:grams?|g)"
_FREQUENCY: Final = rf"{_PREFIX}(?:hertzs?|Hz)"
_FORCE: Final = rf"{_PREFIX}(?:newtons?|N)"
_ROOT: Final = r"\^0?\.5"
_PER: Final = r"\s*/\s*"
_TIMES: Final = r"(?:\s*\*\s*|\s+)"
_FACTOR: Final = r"[A-Za-z°]+(?:\^[0-9.]+)?"
_LONG_PRODUCT: Final = rf"{_FACTOR}(?:(?:{_PER}|{_TIMES}){_FACTOR}){{2,5}}"
"""Three factors or more: spelled out in base units, which only the reader can judge."""

_UNITS: Final = {
    "ratio": "(?:%|percents?|pcts?)?",
    "length": _LENGTH,
    "angle": _ANGLE,
    "time": _TIME,
    "mass": _MASS,
    "frequency": _FREQUENCY,
    "speed": f"{_LENGTH}{_PER}{_TIME}",
    "angular speed": f"{_ANGLE}{_PER}{_TIME}",
    "acceleration": rf"{_LENGTH}{_PER}{_TIME}\^2",
    "angular acceleration": rf"{_ANGLE}{_PER}{_TIME}\^2",
    "force": _FORCE,
    "torque": f"(?:{_FORCE}{_TIMES}{_LENGTH}|{_LENGTH}{_TIMES}{_FORCE})",
    "stiffness": f"{_FORCE}{_PER}{_LENGTH}",
    "noise per root length": f"{_LENGTH}(?:{_PER}{_LENGTH})?{_ROOT}",
    "noise per root angle": f"{_ANGLE}(?:{_PER}{_ANGLE})?{_ROOT}",
    "drift per root length": f"{_ANGLE}{_PER}{_LENGTH}{_ROOT}",
}
"""The unit of each dimension that YAML files use."""

_SIMPLE: Final = ("ratio", "length", "angle", "time", "mass", "frequency")

EXAMPLES: Final = {
    "ratio": "5 %",
    "length": "0.35 m",
    "angle": "90 deg",
    "time": "30 s",
    "mass": "30 kg",
    "frequency": "10 Hz",
    "speed": "0.8 m/s",
    "angular speed": "60 deg/s",
    "acceleration": "1.0 m/s^2",
    "angular acceleration": "2.0 rad/s^2",
    "force": "80 N",
    "torque": "20 N m",
    "stiffness": "100 N/m",
    "noise per root length": "0.01 m/m^0.5",
    "noise per root angle": "0.02 rad/rad^0.5",
    "drift per root length": "0.005 rad/m^0.5",
}
"""One usual value of each dimension."""


def quantity_pattern(dimension: str, *, signed: bool = True, nonzero: bool = False) -> str:
    """Return the expression a whole text must match to be a quantity of ``dimension``.

    ``signed`` allows a minus, ``nonzero`` wants a digit other than 0 before the unit.
    """
    unit = _UNITS[dimension]
    if dimension not in _SIMPLE:
        unit = f"(?:{unit}|{_LONG_PRODUCT})"
    sign = "[+-]?" if signed else r"\+?"
    some = "(?=[^A-Za-z]*[1-9])" if nonzero else ""
    return rf"^\s*{some}{sign}{_NUMBER}\s*{unit}\s*$"
