"""How finely the values of a searched parameter are told apart.

Values are rounded before a run is made of them, so that near-duplicates are one run.
"""

from __future__ import annotations

import math
from typing import Final

from grammars.text.quantity import read_quantity

_PRECISION: Final = {"time": 0.01, "length": 0.001, "angle": math.radians(0.1)}
"""To what [SI] times, lengths and angles are said: nobody sets a door to the millisecond."""
_FEWEST: Final = 20
"""So many steps a range has at least."""


def step_of(low: float, high: float, unit: str, *, log: bool, whole: bool) -> float:
    """Return the step of a range from ``low`` to ``high``, a power of ten in its ``unit``.

    That is 0.01 s, 1 mm or 0.1 deg, in the decimals of the unit that is written; of other
    quantities, and of smaller ranges, a hundredth to a thousandth of the range; 1 of ``whole``
    numbers. A logarithmic range has finer ones, if need be, for its smallest values.
    """
    if whole:
        return 1.0
    step = _power_of_ten((high - low) / 1000.0)
    if unit:
        one = read_quantity(f"1 {unit}")
        precision = _PRECISION.get(one.dimension)
        if precision is not None:
            step = _power_of_ten(precision / one.value)
            if round((high - low) / step, 6) < _FEWEST:
                step = _power_of_ten((high - low) / 100.0)
    return min(step, _power_of_ten(low / 10.0)) if log else step


def _power_of_ten(number: float) -> float:
    """Return the power of ten that is not above ``number``."""
    # A logarithm of 0.1 may fall just below -1.
    return float(f"1e{math.floor(round(math.log10(number), 9))}")
