"""Statistics of small samples: exact and t intervals, effect sizes, many tests at once.

Rates come from counts by the exact interval of Clopper and Pearson (Biometrika 26, 1934). Its
bounds are quantiles of beta distributions. It covers at least as often as it says, for any number
of runs, as a test of a robot with five repeats needs. The beta and t distributions come from scipy,
which is loaded when first needed: few commands ask for an interval.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeVar

Key = TypeVar("Key", bound=tuple[Any, ...])

CONFIDENCE: Final = 0.95
EACH_SIDE: Final = 0.5 * (1.0 + CONFIDENCE)
"""Confidence of each bound of a two-sided interval."""
_TOO_MANY: Final = 1_000_000
"""Upper limit of a realistic campaign [runs]: a rate that needs more is out of reach."""


def at_least(passed: int, n: int, confidence: float = CONFIDENCE) -> float:
    """Return the rate that ``passed`` of ``n`` runs show at least, one-sided.

    Raises ``ValueError`` for impossible counts.
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


def chance_correlation(n: int, groups: int = 2, confidence: float = CONFIDENCE) -> float:
    """Return the bound, 0 to 1, that correlations of ``n`` runs stay within by chance alone.

    With two groups this is the t bound of a correlation coefficient, such as Spearman's. With more
    it is the F bound of the correlation ratio of a choice among that many. With too few runs to
    tell it is 1.
    """
    between = max(groups, 2) - 1
    if n - between <= 1:
        return 1.0
    return math.sqrt(_beta_quantile(0.5 * between, 0.5 * (n - between - 1), confidence))


def runs_needed(passed: int, n: int, rate: float, confidence: float = CONFIDENCE) -> int | None:
    """Return the number of further passing runs that would show ``rate``; 0 if it is shown.

    ``None`` if no number of runs can: a rate of 1 cannot be shown.
    """
    _check(passed, n)
    if rate >= 1.0:
        return None

    def is_shown(more: int) -> bool:
        return at_least(passed + more, n + more, confidence) >= rate

    if is_shown(0):
        return 0
    high = 1
    while not is_shown(high):
        if high > _TOO_MANY:
            return None
        high *= 2
    low = high // 2
    # The bound grows with every passing run, so bisection finds the first sufficient number.
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_shown(middle) else (middle, high)
    return high


def cut_percentage(rate: float) -> str:
    """Return a lower bound such as ``54.9 %``, cut instead of rounded, so it never claims more."""
    # The 1e-9 undoes binary rounding: 0.549 * 1000 is 549.0 or a last bit less.
    return f"{int(rate * 1000 + 1e-9) / 10:g} %"


def _beta_quantile(a: float, b: float, q: float) -> float:
    from scipy.special import betaincinv

    return float(betaincinv(a, b, q))


def _t_quantile(q: float, freedom: float) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(freedom, q))


def _t_probability(t: float, freedom: float) -> float:
    """Return the probability of a value of at most ``t`` by Student's t distribution."""
    from scipy.special import stdtr

    return float(stdtr(freedom, t))


def _check(passed: int, n: int) -> None:
    if not 0 <= passed <= n:
        raise ValueError(f"{passed} of {n} runs cannot have passed")


@dataclass(frozen=True, slots=True)
class MeanInterval:
    """A mean of ``n`` values, their standard deviation, the two-sided t interval of the mean.

    A single value has neither deviation nor interval.
    """

    n: int
    mean: float
    std: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class MeanDifference:
    """Difference of the means of two samples, the first minus the second.

    ``low`` and ``high`` are separate one-sided bounds: the mean difference is shown to be at least
    ``low``, or at most ``high``. ``n`` counts pairs, or the smaller sample. ``error`` is the
    standard error and ``freedom`` the degrees of freedom of the t distribution.
    """

    n: int
    mean: float
    low: float
    high: float
    error: float
    freedom: float
    method: Literal["paired", "welch"]

    def p_above(self, limit: float) -> float:
        """Return the one-sided p value for "the mean difference is above ``limit``"."""
        if self.error == 0.0:
            return 0.0 if self.mean > limit else 1.0
        return _t_probability((limit - self.mean) / self.error, self.freedom)

    def p_below(self, limit: float) -> float:
        """Return the one-sided p value for "the mean difference is below ``limit``"."""
        if self.error == 0.0:
            return 0.0 if self.mean < limit else 1.0
        return _t_probability((self.mean - limit) / self.error, self.freedom)

    @property
    def p_different(self) -> float:
        """Return the two-sided p value for "there is a difference"."""
        if self.error == 0.0:
            return 1.0 if self.mean == 0.0 else 0.0
        return 2.0 * _t_probability(-abs(self.mean / self.error), self.freedom)


def mean_interval(values: Sequence[float], confidence: float = CONFIDENCE) -> MeanInterval:
    """Return mean, deviation and t interval of at least one value; raises ``ValueError``."""
    if not values:
        raise ValueError("the mean of no values is unknown")
    # fsum gives the same mean for any order of the runs.
    n, mean = len(values), math.fsum(values) / len(values)
    if n == 1:
        return MeanInterval(1, mean, None, None, None)
    std = _deviation(values)
    half = _t_quantile(0.5 * (1.0 + confidence), n - 1) * std / math.sqrt(n)
    return MeanInterval(n, mean, std, mean - half, mean + half)


def mean_difference(
    left: Mapping[Key, float], right: Mapping[Key, float], confidence: float = CONFIDENCE
) -> MeanDifference | None:
    """Return left minus right: by pairs if any keys are shared, otherwise between the means.

    ``None`` for fewer than two pairs or values, whose variation is unknown. A single pair still
    rules out the comparison of means. Without pairs the degrees of freedom are those of Welch and
    Satterthwaite; the variances may differ.
    """
    pairs = sorted(left.keys() & right.keys())
    n = len(pairs) if pairs else min(len(left), len(right))
    if n < 2:
        return None
    if pairs:
        differences = [left[key] - right[key] for key in pairs]
        mean, error = math.fsum(differences) / n, _deviation(differences) / math.sqrt(n)
        freedom = n - 1.0
    else:
        mean = math.fsum(left.values()) / len(left) - math.fsum(right.values()) / len(right)
        a, b = (_deviation((*side.values(),)) ** 2 / len(side) for side in (left, right))
        error, freedom = math.sqrt(a + b), 1.0
        if error > 0.0:
            # Shares, because squares of tiny variances would underflow.
            p, q = a / (a + b), b / (a + b)
            freedom = 1.0 / (p * p / (len(left) - 1) + q * q / (len(right) - 1))
    half = _t_quantile(confidence, freedom) * error
    method: Literal["paired", "welch"] = "paired" if pairs else "welch"
    return MeanDifference(n, mean, mean - half, mean + half, error, freedom, method)


def _deviation(values: Sequence[float]) -> float:
    """Return the sample's standard deviation; exactly 0 for equal values."""
    # numpy returns about 1e-17 for equal values, which would make every difference significant.
    if min(values) == max(values):
        return 0.0
    import numpy as np

    return float(np.std(np.asarray(values, dtype=float), ddof=1))


def cliffs_delta(left: Sequence[float], right: Sequence[float]) -> float:
    """Return how much more often a left value is larger than a right one than smaller, -1 to 1.

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


def effect_magnitude(delta: float) -> str:
    """Return the usual word for a delta (Romano et al. 2006): negligible, small, medium, large."""
    for word, limit in (("negligible", 0.147), ("small", 0.33), ("medium", 0.474)):
        if abs(delta) < limit:
            return word
    return "large"


def holm_adjusted(p_values: Sequence[float]) -> tuple[float, ...]:
    """Return p values adjusted for multiple tests, after Holm (Scand. J. Statistics 6, 1979)."""
    order = sorted(range(len(p_values)), key=lambda i: p_values[i])
    adjusted = [0.0] * len(p_values)
    largest = 0.0
    for rank, index in enumerate(order):
        largest = max(largest, min(1.0, (len(order) - rank) * p_values[index]))
        adjusted[index] = largest
    return tuple(adjusted)
