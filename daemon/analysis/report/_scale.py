"""From values to points of the page, and the round values that stand beside axes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from grammars.model.geometry import Floats


@dataclass(frozen=True, slots=True)
class AxesTransform:
    """From values to points of the page: ``x * sx + ox``, ``y * sy + oy``."""

    sx: float
    ox: float
    sy: float
    oy: float

    def x(self, value: Any) -> Any:
        """Return where a value along x is."""
        return value * self.sx + self.ox

    def y(self, value: Any) -> Any:
        """Return where a value along y is."""
        return value * self.sy + self.oy

    def points(self, x: Any, y: Any) -> Floats:
        """Return where points are, (n, 2)."""
        return np.column_stack((self.x(np.asarray(x, float)), self.y(np.asarray(y, float))))


def tick_names(low: float, high: float, room: float) -> list[tuple[float, str]]:
    """Return round values between two limits, at most ``room`` of them or two, and their words.

    They are multiples of 1, 2, 2.5 or 5 times a power of ten.
    """
    least = (high - low) / max(room, 2.0)
    power = 10.0 ** math.floor(math.log10(least))
    step = next((m * power for m in (1.0, 2.0, 2.5, 5.0) if m * power >= least), 10.0 * power)
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    if round(step, digits) != step and not math.isclose(round(step, digits), step):
        digits += 1
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [
        (k * step, f"{k * step:.{digits}f}".replace("-", "\N{MINUS SIGN}"))
        for k in range(first, last + 1)
    ]
