"""Effect sizes without assumptions, and p values of many tests at once."""

from __future__ import annotations

from collections.abc import Sequence


def cliffs_delta(left: Sequence[float], right: Sequence[float]) -> float:
    """Return how much more often a value of left is larger than one of right than smaller, -1 to 1.

    Cliff, "Dominance statistics", Psychological Bulletin 114 (1993). Raises ``ValueError`` for an
    empty side.
    """
    if not left or not right:
        raise ValueError("Cliff's delta needs values on both sides")
    import numpy as np

    ordered = np.sort(np.asarray(right, dtype=float))
    values = np.asarray(left, dtype=float)
    above = np.searchsorted(ordered, values, side="left").sum()
    below = (len(ordered) - np.searchsorted(ordered, values, side="right")).sum()
    return float(above - below) / (len(values) * len(ordered))


def magnitude(delta: float) -> str:
    """Return the usual word for a delta (Romano et al. 2006): negligible, small, medium, large."""
    for word, limit in (("negligible", 0.147), ("small", 0.33), ("medium", 0.474)):
        if abs(delta) < limit:
            return word
    return "large"


def holm(p_values: Sequence[float]) -> tuple[float, ...]:
    """Return p values adjusted for being many, after Holm (Scand. J. Statistics 6, 1979)."""
    order = sorted(range(len(p_values)), key=lambda i: p_values[i])
    adjusted = [0.0] * len(p_values)
    largest = 0.0
    for rank, index in enumerate(order):
        largest = max(largest, min(1.0, (len(order) - rank) * p_values[index]))
        adjusted[index] = largest
    return tuple(adjusted)
