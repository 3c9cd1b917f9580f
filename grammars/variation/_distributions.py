"""Distributions: one value from a random stream, at a quantile, or a few levels of a design.

Lists and plain normals draw what the published tool draws from the same
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
)
from grammars.text.units import ANGLE, LENGTH, read_unit

if TYPE_CHECKING:
    import numpy as np

_COARSE: Final = 4
"""Decimals of drawn lengths and angles, unless the distribution is narrower than 0.01."""
_TAIL: Final = 1e-9
"""Share of a normal distribution that its limits must at least leave."""


@dataclass(frozen=True, slots=True)
class Categorical:
    """One of ``values``; ``weights`` sum to 1, or are empty when all are equally likely."""

    values: tuple[float, ...]
    weights: tuple[float, ...] = ()

    def draw(self, stream: np.random.RandomState) -> float:
        """Return the value drawn next from ``stream``."""
        # The calls of the published tool: others take other numbers from the stream, and every
        # later draw of the plan would differ from what it writes.
        if self.weights:
            return float(stream.choice(self.values, 1, p=self.weights)[0])
        return self.values[stream.randint(0, len(self.values))]

    def at(self, quantile: float) -> float:
        """Return the value below which a share ``quantile`` in [0, 1) of the values lies."""
        if not self.weights:
            return self.values[min(int(quantile * len(self.values)), len(self.values) - 1)]
        reached = 0.0
        for value, weight in zip(self.values, self.weights, strict=True):
            reached += weight
            if quantile < reached:
                return value
        return self.values[-1]

    def levels(self, count: int) -> tuple[float, ...]:
        """Return every value that may be drawn, once each."""
        weights = self.weights or (1.0,) * len(self.values)
        drawn = [v for v, w in zip(self.values, weights, strict=True) if w > 0.0]
        return tuple(dict.fromkeys(drawn))


@dataclass(frozen=True, slots=True)
class Range:
    """Any value between ``low`` and ``high``, all equally likely."""

    low: float
    high: float

    def draw(self, stream: np.random.RandomState) -> float:
        """Return the value drawn next from ``stream``."""
        return self.at(float(stream.random_sample()))

    def at(self, quantile: float) -> float:
        """Return the value below which a share ``quantile`` of the values lies."""
        value = self.low + quantile * (self.high - self.low)
        rounded = round(value, _decimals(self.high - self.low))
        return min(max(rounded, self.low), self.high)

    def levels(self, count: int) -> tuple[float, ...]:
        """Return ``count`` values, evenly spaced from ``low`` to ``high``; one is the middle."""
        shares = _evenly(count)
        return tuple(dict.fromkeys(self.at(share) for share in shares))


@dataclass(frozen=True, slots=True)
class Normal:
    """A normal distribution, cut off below ``low`` and above ``high``."""

    mean: float
    std: float
    low: float = -math.inf
    high: float = math.inf

    def draw(self, stream: np.random.RandomState) -> float:
        """Return the value drawn next from ``stream``, rounded to 2 decimals when not cut off."""
        if self._is_cut:
            return self.at(float(stream.random_sample()))
        # Two decimals, as the published tool: centimetres, or 0.01 of the unit of the angle.
        return round(float(stream.normal(self.mean, self.std)), 2)

    def at(self, quantile: float) -> float:
        """Return the value below which a share ``quantile`` of the values lies."""
        if self.std == 0.0:
            return self.mean
        if not self._is_cut:
            return round(self._quantile(quantile, 0.0, 1.0), 2)
        # Above the mean shares are close to 1 and differ little: count them from the other end.
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
    def _is_cut(self) -> bool:
        return math.isfinite(self.low) or math.isfinite(self.high)

    def _shares(self) -> tuple[float, float]:
        """Return the shares of the values below both limits, mirrored when above the mean."""
        normal = NormalDist(self.mean, self.std)
        if self.low > self.mean:
            return normal.cdf(2 * self.mean - self.high), normal.cdf(2 * self.mean - self.low)
        return normal.cdf(self.low), normal.cdf(self.high)

    def _quantile(self, quantile: float, lower: float, upper: float) -> float:
        share = lower + quantile * (upper - lower)
        # The ends themselves are at infinity.
        inside = min(max(share, 1e-300), 1.0 - 2**-53)
        return NormalDist(self.mean, self.std).inv_cdf(inside)

    @property
    def share_left(self) -> float:
        """The share of the uncut distribution between the limits."""
        if self.std == 0.0:
            return float(self.low <= self.mean <= self.high)
        lower, upper = self._shares()
        return upper - lower


@dataclass(frozen=True, slots=True)
class Fixed:
    """One value in place of a distribution that is ``drawn`` from all the same.

    So the others take the numbers from the random stream that they would take without it.
    """

    value: float
    drawn: Categorical | Range | Normal

    def draw(self, stream: np.random.RandomState) -> float:
        """Return the value, after drawing the other one from ``stream``."""
        self.drawn.draw(stream)
        return self.value

    def at(self, quantile: float) -> float:
        """Return the value."""
        return self.value

    def levels(self, count: int) -> tuple[float, ...]:
        """Return the value alone."""
        return (self.value,)


Distribution: TypeAlias = Categorical | Range | Normal | Fixed


def numbers_of(distribution: Distribution) -> Sequence[float]:
    """Return every number written in a distribution but its weights."""
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
    """Return how many decimals leave a hundred different values within ``scale``."""
    return max(_COARSE, 2 - math.floor(math.log10(scale)))


def _evenly(count: int) -> list[float]:
    return [0.5] if count == 1 else [k / (count - 1) for k in range(count)]


_LARGEST: Final = 1e6
_SUM: Final = 1e-9


def read_distribution(node: SyntaxNode, source: SourceText) -> tuple[Distribution, str]:
    """Return a distribution and its unit (empty: none written).

    Raises :class:`InputError` with everything that is wrong with it.
    """
    where = source.at(node)
    units = list(dict.fromkeys(number.unit for number in _number_nodes(node) if number.unit))
    if len(units) > 1:
        hint = "write the unit once, it holds for every number"
        raise InputError.at(where, f"{' and '.join(units)} in one distribution", hint)
    unit = units[0] if units else ""
    if unit and read_unit(unit)[1] not in (LENGTH, ANGLE):
        raise InputError.at(where, f"nothing in a plan is in {unit}", "lengths and angles are")
    read = {"Uniform": _uniform, "Discrete": _discrete, "Normal": _normal}[type(node).__name__]
    distribution = read(node, source)
    if any(abs(number) > _LARGEST for number in numbers_of(distribution)):
        raise InputError.at(where, "a number is too large", "the limit is 1000 km")
    return distribution, unit


def _number_nodes(node: SyntaxNode) -> list[SyntaxNode]:
    match type(node).__name__:
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
            raise InputError.at(source.at(node), message, "the smaller number comes first")
        return Range(low, high)
    if not node.values:
        message = "there is nothing to choose from"
        raise InputError.at(source.at(node), message, "uniform([1.0, 2.0])")
    return Categorical(tuple(float(value.number) for value in node.values))


def _discrete(node: SyntaxNode, source: SourceText) -> Distribution:
    weights = [float(pair.weight.number) for pair in node.pairs]
    if not weights:
        message = "there is nothing to choose from"
        raise InputError.at(source.at(node), message, "discrete([(0.8, 5.0), (0.2, 2.0)])")
    findings = Findings(source)
    for pair, weight in zip(node.pairs, weights, strict=True):
        if weight < 0.0:
            hint = "pairs are (probability, value)"
            findings.error(pair, f"the probability {weight:g} is negative", hint)
        if pair.weight.unit:
            findings.error(pair, "a probability has no unit")
    # Of numbers that are too large fsum raises, before anybody was told.
    written = sum(weights)
    if abs(written - 1.0) > _SUM:
        hint = "pairs are (probability, value), and the probabilities sum to 1"
        findings.error(node, f"the probabilities sum to {written:.12g}", hint)
    findings.raise_errors()
    total = math.fsum(weights)
    # 0.7, 0.2, 0.1 sum to 0.9999999999999999; numpy wants 1 up to its own tolerance.
    scaled = weights if sum(weights) == 1.0 else [weight / total for weight in weights]
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
            findings.error(option, f'"{option.key}" is given twice')
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
    if normal.share_left <= _TAIL:
        hint = "move the limits or the mean, or take uniform(a .. b)"
        raise InputError.at(where, "next to nothing is drawn between min and max", hint)
    return normal
