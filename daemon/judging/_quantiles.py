"""The beta and t distributions: what intervals and tests of small samples are made of.

All of it is the regularised incomplete beta function I_x(a, b), by its continued fraction
(Abramowitz and Stegun, 26.5.8), evaluated by Lentz's method in the form of Thompson and Barnett
(J. Comput. Phys. 64, 1986). Tests hold it to scipy, whose 140 MB are too much for these numbers.
"""

from __future__ import annotations

import functools
import math
from typing import Final

_TINY: Final = 1e-300
_EPSILON: Final = 1e-16
_MOST_TERMS: Final = 20_000
_MOST_STEPS: Final = 200


def incomplete_beta(a: float, b: float, x: float, y: float) -> float:
    """Return I_x(a, b) for positive ``a``, ``b``; ``y`` is 1 - x, given for where x is nearly 1."""
    if x <= 0.0:
        return 0.0
    if y <= 0.0:
        return 1.0
    front = math.exp(_log_front(a, b, x, y))
    # The fraction converges fast on this side of the mean, the other is its complement.
    if x < (a + 1.0) / (a + b + 2.0):
        return front * _fraction(a, b, x) / a
    return 1.0 - front * _fraction(b, a, y) / b


def _log_front(a: float, b: float, x: float, y: float) -> float:
    # The logarithm of whichever is near 1 from the other: it keeps digits the near one has lost.
    log_x = math.log(x) if x < 0.5 else math.log1p(-y)
    log_y = math.log(y) if y < 0.5 else math.log1p(-x)
    return math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * log_x + b * log_y


def _fraction(a: float, b: float, x: float) -> float:
    c, d = 1.0, 1.0 / _nonzero(1.0 - (a + b) * x / (a + 1.0))
    value = d
    for m in range(1, _MOST_TERMS):
        even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m))
        d = 1.0 / _nonzero(1.0 + even * d)
        c = _nonzero(1.0 + even / c)
        value *= d * c
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0))
        d = 1.0 / _nonzero(1.0 + odd * d)
        c = _nonzero(1.0 + odd / c)
        step = d * c
        value *= step
        if abs(step - 1.0) <= _EPSILON:
            break
    return value


def _nonzero(value: float) -> float:
    return value if abs(value) > _TINY else _TINY


@functools.lru_cache(4096)
def beta_quantile(a: float, b: float, q: float) -> float:
    """Return the x with I_x(a, b) = ``q``: the ``q`` quantile of a beta distribution."""
    low, high = 0.0, 1.0
    x = a / (a + b)
    for _ in range(_MOST_STEPS):
        error = incomplete_beta(a, b, x, 1.0 - x) - q
        if error == 0.0:
            return x
        low, high = (low, x) if error > 0.0 else (x, high)
        # Newton's step, halving instead where that would leave what is known to hold the answer.
        density = math.exp(_log_front(a, b, x, 1.0 - x)) / (x * (1.0 - x))
        nearer = x - error / density if density > 0.0 else low
        if not low < nearer < high:
            nearer = 0.5 * (low + high)
        if abs(nearer - x) <= _EPSILON * x or nearer in (low, high):
            return nearer
        x = nearer
    return x


def t_probability(t: float, freedom: float) -> float:
    """Return how probable a value of at most ``t`` is, by Student's t distribution."""
    square = t * t
    x, y = freedom / (freedom + square), square / (freedom + square)
    tail = 0.5 * incomplete_beta(0.5 * freedom, 0.5, x, y)
    return tail if t <= 0.0 else 1.0 - tail


def t_quantile(q: float, freedom: float) -> float:
    """Return the t that a value is at most with probability ``q``, 0 < q < 1."""
    if q < 0.5:
        return -t_quantile(1.0 - q, freedom)
    # t as a ratio of x and 1 - x: from whichever of them is small, for its digits.
    if q < 0.75:
        y = beta_quantile(0.5, 0.5 * freedom, 2.0 * q - 1.0)
        return math.sqrt(freedom * y / (1.0 - y))
    x = beta_quantile(0.5 * freedom, 0.5, 2.0 * (1.0 - q))
    return math.sqrt(freedom * (1.0 - x) / x)
