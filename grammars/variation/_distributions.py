"""Distributions: values from a random stream, at a quantile, or as levels of a design.

Lists and plain normals draw the same values as the published tool from the same
:class:`numpy.random.RandomState`; ranges and truncated normals are our additions and take one
number of the stream each. :func:`read_distribution` reads them from syntax trees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, Final, TypeAlias

from grammars.text.diagnostics import (
    Findings,
    InputError,
    SourceText,
    SyntaxNode,
    did_you_mean,
    rule_of,
)
from grammars.text.units import ANGLE, LENGTH, read_unit

if TYPE_CHECKING:
    import numpy as np

_COARSE: Final = 4
"""Decimals of drawn lengths and angles, unless the distribution is narrower than 0.01."""
_TAIL: Final = 1e-9
"""Smallest share of a normal distribution between its limits."""


@dataclass(frozen=True, slots=True)
class Categorical:
    """One of ``values``; ``weights`` sum to 1, or are empty for equal weights."""

    values: tuple[float, ...]
    weights: tuple[float, ...] = ()

    def draw(self, stream: np.random.RandomState) -> float:
        """Return the next value from ``stream``."""
        # The same calls as in the published tool: others would take other numbers from the stream
        # and change all later draws.
        if self.weights:
            return float(stream.choice(self.values, 1, p=self.weights)[0])
        return self.values[stream.randint(0, len(self.values))]

    def at(self, quantile: float) -> float:
        """Return the value at ``quantile`` in [0, 1)."""
        if not self.weights:
            return self.values[min(int(quantile * len(self.values)), len(self.values) - 1)]
        cumulative = 0.0
        for value, weight in zip(self.values, self.weights, strict=True):
            cumulative += weight
            if quantile < cumulative:
                return value
        return self.values[-1]

    def levels(self, count: int) -> tuple[float, ...]:
        """Return all possible values, once each."""
        weights = self.weights or (1.0,) * len(self.values)
        possible = [v for v, w in zip(self.values, weights, strict=True) if w > 0.0]
        return tuple(dict.fromkeys(possible))


@dataclass(frozen=True, slots=True)
class Range:
    """Uniform distribution between ``low`` and ``high``."""

    low: float
    high: float

    def draw(self, stream: np.random.RandomState) -> float:
        """Return the next value from ``stream``."""
        return self.at(float(stream.random_sample()))

    def at(self, quantile: float) -> float:
        """Return the value at ``quantile``."""
        value = self.low + quantile * (self.high - self.low)
        rounded = round(value, _decimals(self.high - self.low))
        return min(max(rounded, self.low), self.high)

    def levels(self, count: int) -> tuple[float, ...]:
        """Return ``count`` evenly spaced values; a single one is the middle."""
        shares = [k / (count - 1) for k in range(count)] if count > 1 else [0.5]
        return tuple(dict.fromkeys(self.at(share) for share in shares))


@dataclass(frozen=True, slots=True)
class Normal:
    """A normal distribution, truncated below ``low`` and above ``high``."""

    mean: float
    std: float
    low: float = -math.inf
    high: float = math.inf

    def draw(self, stream: np.random.RandomState) -> float:
        """Return the next value from ``stream``, rounded to 2 decimals if not truncated."""
        if self._is_truncated:
            return self.at(float(stream.random_sample()))
        # Two decimals, like the published tool: centimetres, or 0.01 of the unit of the angle.
        return round(float(stream.normal(self.mean, self.std)), 2)

    def at(self, quantile: float) -> float:
        """Return the value at ``quantile``."""
        if self.std == 0.0:
            return self.mean
        if not self._is_truncated:
            return round(self._quantile(quantile, 0.0, 1.0), 2)
        # Shares above the mean are close to 1 and lose precision: mirror the distribution.
        mirrored = self.low > self.mean
        ends = self._shares()
        share = 1.0 - quantile if mirrored else quantile
        value = self._quantile(share, *ends)
        value = 2 * self.mean - value if mirrored else value
        decimals = _decimals(min(self.std, self.high - self.low))
        return min(max(round(value, decimals), self.low), self.high)

    def levels(self, count: int) -> tuple[float, ...]:
        """Return the medians of ``count`` equally likely parts."""
        return tuple(dict.fromkeys(self.at((k + 0.5) / count) for k in range(count)))

    @property
    def _is_truncated(self) -> bool:
        return math.isfinite(self.low) or math.isfinite(self.high)

    def _shares(self) -> tuple[float, float]:
        """Return the shares of values below both limits, mirrored if ``low`` is above the mean."""
        normal = NormalDist(self.mean, self.std)
        if self.low > self.mean:
            return normal.cdf(2 * self.mean - self.high), normal.cdf(2 * self.mean - self.low)
        return normal.cdf(self.low), normal.cdf(self.high)

    def _quantile(self, quantile: float, lower: float, upper: float) -> float:
        share = lower + quantile * (upper - lower)
        # Shares of 0 and 1 are at infinity.
        inside = min(max(share, 1e-300), 1.0 - 2**-53)
        return NormalDist(self.mean, self.std).inv_cdf(inside)

    @property
    def share_between(self) -> float:
        """Share of the untruncated distribution between the limits."""
        if self.std == 0.0:
            return float(self.low <= self.mean <= self.high)
        lower, upper = self._shares()
        return upper - lower


@dataclass(frozen=True, slots=True)
class Fixed:
    """One value in place of a ``replaced`` distribution.

    Drawing also draws from the replaced one, so that later draws get the same random numbers.
    """

    value: float
    replaced: Categorical | Range | Normal

    def draw(self, stream: np.random.RandomState) -> float:
        """Return the value after a draw from the replaced distribution."""
        self.replaced.draw(stream)
        return self.value

    def at(self, quantile: float) -> float:
        """Return the value."""
        return self.value

    def levels(self, count: int) -> tuple[float, ...]:
        """Return the value as the only level."""
        return (self.value,)


Distribution: TypeAlias = Categorical | Range | Normal | Fixed


def numbers_of(distribution: Distribution) -> Sequence[float]:
    """Return all numbers of a distribution except its weights."""
    match distribution:
        case Categorical(values):
            return values
        case Range(low, high):
            return (low, high)
        case Normal(mean, std, low, high):
            return tuple(v for v in (mean, std, low, high) if math.isfinite(v))
        case Fixed(value):
            return (value,)


def _decimals(scale: float) -> int:
    """Return the number of decimals for at least a hundred different values within ``scale``."""
    return max(_COARSE, 2 - math.floor(math.log10(scale)))


_LARGEST: Final = 1e6
_SUM: Final = 1e-9


def read_distribution(node: SyntaxNode, source: SourceText) -> tuple[Distribution, str]:
    """Return a distribution and its unit (empty for none).

    Raises :class:`InputError` with all its problems.
    """
    where = source.at(node)
    units = list(dict.fromkeys(number.unit for number in _number_nodes(node) if number.unit))
    if len(units) > 1:
        hint = "write the unit once, it applies to all numbers"
        message = f"{' and '.join(units)} in one distribution"
        raise InputError.at(where, message, hint)
    unit = units[0] if units else ""
    if unit and read_unit(unit)[1] not in (LENGTH, ANGLE):
        message = f"a plan has no quantities in {unit}"
        raise InputError.at(where, message, "use a length or an angle")
    read = {"Uniform": _uniform, "Discrete": _discrete, "Normal": _normal}[rule_of(node)]
    distribution = read(node, source)
    if any(abs(number) > _LARGEST for number in numbers_of(distribution)):
        raise InputError.at(where, "a number is too large", "the limit is 1000 km")
    return distribution, unit


def _number_nodes(node: SyntaxNode) -> list[SyntaxNode]:
    match rule_of(node):
        case "Uniform":
            return node.values if node.low is None else [node.low, node.high]
        case "Discrete":
            return [pair.value for pair in node.pairs]
    return [option.value for option in node.options]


def _uniform(node: SyntaxNode, source: SourceText) -> Distribution:
    if node.low is not None:
        low, high = float(node.low.number), float(node.high.number)
        if not low < high:
            message = f"the range {low:g} .. {high:g} is empty"
            raise InputError.at(source.at(node), message, "write the smaller number first")
        return Range(low, high)
    if not node.values:
        raise InputError.at(source.at(node), "the list is empty", "uniform([1.0, 2.0])")
    return Categorical(tuple(float(value.number) for value in node.values))


def _discrete(node: SyntaxNode, source: SourceText) -> Distribution:
    weights = [float(pair.weight.number) for pair in node.pairs]
    if not weights:
        hint = "discrete([(0.8, 5.0), (0.2, 2.0)])"
        raise InputError.at(source.at(node), "the list is empty", hint)
    findings = Findings(source)
    for pair, weight in zip(node.pairs, weights, strict=True):
        if weight < 0.0:
            hint = "pairs are (probability, value)"
            findings.error(pair, f"the probability {weight:g} is negative", hint)
        if pair.weight.unit:
            findings.error(pair, "a probability has no unit")
    # fsum would raise for too large numbers.
    plain_sum = sum(weights)
    if abs(plain_sum - 1.0) > _SUM:
        hint = "pairs are (probability, value), and the probabilities must sum to 1"
        findings.error(node, f"the probabilities sum to {plain_sum:.12g}", hint)
    findings.raise_errors()
    total = math.fsum(weights)
    # 0.7, 0.2, 0.1 sum to 0.9999999999999999; numpy requires 1 within its own tolerance.
    scaled = weights if plain_sum == 1.0 else [weight / total for weight in weights]
    return Categorical(tuple(float(pair.value.number) for pair in node.pairs), tuple(scaled))


def _normal(node: SyntaxNode, source: SourceText) -> Distribution:
    findings = Findings(source)
    options: dict[str, float] = {}
    keys = ("mean", "std", "min", "max")
    for option in node.options:
        if option.key not in keys:
            hint = did_you_mean(option.key, keys)
            findings.error(option, f'normal has no "{option.key}"', hint)
        elif option.key in options:
            findings.error(option, f'"{option.key}" is written twice')
        options[option.key] = float(option.value.number)
    findings.raise_errors()
    where = source.at(node)
    missing = [key for key in ("mean", "std") if key not in options]
    if missing:
        message = f"normal needs {' and '.join(missing)}"
        raise InputError.at(where, message, "normal(mean=1.0, std=0.2)")
    low, high = options.get("min", -math.inf), options.get("max", math.inf)
    normal = Normal(options["mean"], options["std"], low, high)
    if normal.std < 0.0:
        raise InputError.at(where, f"the standard deviation {normal.std:g} is negative")
    if normal.std and normal.std < 1e-9:
        raise InputError.at(where, f"the standard deviation {normal.std:g} is too small")
    if low > high or (normal.std and low == high):
        raise InputError.at(where, "min must be less than max")
    if normal.share_between <= _TAIL:
        hint = "move the limits or the mean, or use uniform(a .. b)"
        raise InputError.at(where, "almost no values lie between min and max", hint)
    return normal
