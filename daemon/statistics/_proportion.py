"""Rates from counts: the exact interval of Clopper and Pearson (Biometrika 26, 1934).

Its bounds are quantiles of beta distributions; it covers at least as often as it says, for any
number of runs, which is what a test of a robot with five repeats needs.
"""

from __future__ import annotations

from typing import Final

CONFIDENCE: Final = 0.95
_TOO_MANY: Final = 1_000_000


def at_least(passed: int, n: int, confidence: float = CONFIDENCE) -> float:
    """Return the rate that ``passed`` of ``n`` runs show at least, one-sided.

    Raises ``ValueError`` for counts that cannot be.
    """
    _check(passed, n)
    if passed == 0:
        return 0.0
    return _beta_quantile(passed, n - passed + 1, 1.0 - confidence)


def at_most(passed: int, n: int, confidence: float = CONFIDENCE) -> float:
    """Return the rate that ``passed`` of ``n`` runs show at most, one-sided."""
    _check(passed, n)
    return 1.0 - at_least(n - passed, n, confidence)


def proportion_interval(passed: int, n: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Return the two-sided exact interval of a rate; (0, 1) without runs."""
    each = 0.5 * (1.0 + confidence)
    return at_least(passed, n, each), at_most(passed, n, each)


def runs_needed(passed: int, n: int, rate: float, confidence: float = CONFIDENCE) -> int | None:
    """Return how many more runs, all of them passing, would show ``rate``; 0 when it is shown.

    ``None`` when no number of runs does: nothing shows a rate of 1.
    """
    _check(passed, n)
    if rate >= 1.0:
        return None

    def shown(more: int) -> bool:
        return at_least(passed + more, n + more, confidence) >= rate

    if shown(0):
        return 0
    high = 1
    while not shown(high):
        if high > _TOO_MANY:
            return None
        high *= 2
    low = high // 2
    # The bound grows with every run that passes, so the first number that is enough is bisected.
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if shown(middle) else (middle, high)
    return high


def _check(passed: int, n: int) -> None:
    if not 0 <= passed <= n:
        raise ValueError(f"{passed} of {n} runs cannot have passed")


def _beta_quantile(a: float, b: float, q: float) -> float:
    from scipy.special import betaincinv

    return float(betaincinv(a, b, q))
