"""Means and differences of means from few values: t intervals, paired and after Welch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from daemon.statistics._proportion import CONFIDENCE


@dataclass(frozen=True, slots=True)
class Interval:
    """A mean of ``n`` values, their standard deviation, the two-sided t interval of the mean.

    With one value there is neither deviation nor interval.
    """

    n: int
    mean: float
    std: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class Difference:
    """How much larger the first of two samples is.

    ``low`` and ``high`` are one-sided bounds, each of its own: the mean difference is shown to be
    at least ``low``, or at most ``high``. ``n`` counts pairs, or the smaller sample; ``error`` is
    the standard error and ``freedom`` the degrees of freedom of the t distribution.
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
        return _t_cdf((limit - self.mean) / self.error, self.freedom)

    @property
    def p_different(self) -> float:
        """Return the two-sided p value for "there is a difference"."""
        if self.error == 0.0:
            return 1.0 if self.mean == 0.0 else 0.0
        return 2.0 * _t_cdf(-abs(self.mean / self.error), self.freedom)


def mean_interval(values: Sequence[float], confidence: float = CONFIDENCE) -> Interval:
    """Return mean, deviation and t interval of at least one value; raises ``ValueError``."""
    if not values:
        raise ValueError("the mean of no values is unknown")
    n, mean = len(values), math.fsum(values) / len(values)
    if n == 1:
        return Interval(1, mean, None, None, None)
    std = _deviation(values)
    half = _t_quantile(0.5 * (1.0 + confidence), n - 1) * std / math.sqrt(n)
    return Interval(n, mean, std, mean - half, mean + half)


def paired(
    left: Sequence[float], right: Sequence[float], confidence: float = CONFIDENCE
) -> Difference:
    """Return left minus right, pair by pair; raises ``ValueError`` for less than two pairs."""
    differences = [a - b for a, b in zip(left, right, strict=True)]
    n = len(differences)
    if n < 2:
        raise ValueError("less than two pairs say nothing about how they vary")
    error = _deviation(differences) / math.sqrt(n)
    return _difference(n, math.fsum(differences) / n, error, n - 1.0, confidence, "paired")


def welch(
    left: Sequence[float], right: Sequence[float], confidence: float = CONFIDENCE
) -> Difference:
    """Return the mean of left minus that of right, for samples that have no pairs.

    The degrees of freedom are those of Welch and Satterthwaite; the variances may differ. Raises
    ``ValueError`` for less than two values on a side.
    """
    if min(len(left), len(right)) < 2:
        raise ValueError("less than two values on a side say nothing about how they vary")
    a, b = (_deviation(side) ** 2 / len(side) for side in (left, right))
    spread = a + b
    freedom = 1.0
    if spread > 0.0:
        # As shares, because squares of tiny variances would underflow.
        p, q = a / spread, b / spread
        freedom = 1.0 / (p * p / (len(left) - 1) + q * q / (len(right) - 1))
    mean = math.fsum(left) / len(left) - math.fsum(right) / len(right)
    n = min(len(left), len(right))
    return _difference(n, mean, math.sqrt(spread), freedom, confidence, "welch")


def _difference(
    n: int,
    mean: float,
    error: float,
    freedom: float,
    confidence: float,
    method: Literal["paired", "welch"],
) -> Difference:
    half = _t_quantile(confidence, freedom) * error
    return Difference(n, mean, mean - half, mean + half, error, freedom, method)


def _deviation(values: Sequence[float]) -> float:
    """Return the sample's standard deviation; exactly 0 for equal values."""
    if min(values) == max(values):
        return 0.0
    import numpy as np

    return float(np.std(np.asarray(values, dtype=float), ddof=1))


def _t_quantile(q: float, freedom: float) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(freedom, q))


def _t_cdf(t: float, freedom: float) -> float:
    from scipy.special import stdtr

    return float(stdtr(freedom, t))
