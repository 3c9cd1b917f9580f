"""Reading distributions and their units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from grammars.diagnostics import did_you_mean
from grammars.floorplan._source import Findings, Node
from grammars.variation._distributions import Choice, Distribution, Normal, Range, numbers_of
from grammars.variation._expressions import ANGLE, LENGTH, UNITS

_LARGEST: Final = 1e6
_SUM: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Distributions:
    """Reads distributions; broken ones are reported and read as ``None``."""

    findings: Findings

    def read(self, node: Node) -> tuple[Distribution, str] | None:
        """Return a distribution and its unit (empty: none written)."""
        numbers = _numbers(node)
        units = list(dict.fromkeys(n.unit for n in numbers if n.unit))
        if len(units) > 1:
            message = f"{' and '.join(units)} in one distribution"
            self.findings.error(node, message, "write the unit once, it holds for every number")
            return None
        unit = units[0] if units else ""
        if unit and UNITS[unit][1] not in (LENGTH, ANGLE):
            self.findings.error(node, f"nothing in a plan is in {unit}", "m, rad or deg")
            return None
        found = self._one(node)
        if found is not None and any(abs(v) > _LARGEST for v in numbers_of(found)):
            self.findings.error(node, "a number is too large", "the limit is 1000 km")
            return None
        return None if found is None else (found, unit)

    def _one(self, node: Node) -> Distribution | None:
        match type(node).__name__:
            case "Uniform":
                return self._uniform(node)
            case "Discrete":
                return self._discrete(node)
        return self._normal(node)

    def _uniform(self, node: Node) -> Distribution | None:
        if node.low is not None:
            low, high = float(node.low.number), float(node.high.number)
            if not low < high:
                hint = "the smaller number comes first"
                self.findings.error(node, f"the range {low:g} .. {high:g} is empty", hint)
                return None
            return Range(low, high)
        if not node.values:
            self.findings.error(node, "there is nothing to choose from", "uniform([1.0, 2.0])")
            return None
        return Choice(tuple(float(value.number) for value in node.values))

    def _discrete(self, node: Node) -> Distribution | None:
        weights = [float(pair.weight.number) for pair in node.pairs]
        if not weights:
            hint = "discrete([(0.8, 5.0), (0.2, 2.0)])"
            self.findings.error(node, "there is nothing to choose from", hint)
            return None
        for pair, weight in zip(node.pairs, weights, strict=True):
            if weight < 0.0:
                hint = "pairs are (probability, value)"
                self.findings.error(pair, f"the probability {weight:g} is negative", hint)
            if pair.weight.unit:
                self.findings.error(pair, "a probability has no unit")
        total = math.fsum(weights)
        if abs(total - 1.0) > _SUM:
            hint = "pairs are (probability, value), and the probabilities sum to 1"
            self.findings.error(node, f"the probabilities sum to {total:.12g}", hint)
            return None
        if any(weight < 0.0 for weight in weights):
            return None
        scaled = weights if sum(weights) == 1.0 else [weight / total for weight in weights]
        return Choice(tuple(float(pair.value.number) for pair in node.pairs), tuple(scaled))

    def _normal(self, node: Node) -> Distribution | None:
        given: dict[str, float] = {}
        known = ("mean", "std", "min", "max")
        good = True
        for option in node.options:
            if option.key not in known:
                hint = did_you_mean(option.key, known)
                self.findings.error(option, f'normal has no "{option.key}"', hint)
                good = False
            elif option.key in given:
                self.findings.error(option, f'"{option.key}" is given twice')
                good = False
            given[option.key] = float(option.value.number)
        missing = [key for key in ("mean", "std") if key not in given]
        if missing and good:
            hint = "normal(mean=1.0, std=0.2)"
            self.findings.error(node, f"normal needs {' and '.join(missing)}", hint)
            return None
        return self._cut(node, given) if good else None

    def _cut(self, node: Node, given: Mapping[str, float]) -> Distribution | None:
        found = Normal(
            given["mean"], given["std"], given.get("min", -math.inf), given.get("max", math.inf)
        )
        if found.std < 0.0:
            self.findings.error(node, f"the standard deviation {found.std:g} is negative")
        elif found.std and found.std < 1e-9:
            self.findings.error(node, f"the standard deviation {found.std:g} is too small")
        elif found.low > found.high or (found.std and found.low == found.high):
            self.findings.error(node, "min must be less than max")
        elif not found.is_drawable:
            hint = "move the limits or the mean, or take uniform(a .. b)"
            self.findings.error(node, "next to nothing is drawn between min and max", hint)
        else:
            return found
        return None


def _numbers(node: Node) -> list[Node]:
    match type(node).__name__:
        case "Uniform":
            return [node.low, node.high] if node.low is not None else list(node.values)
        case "Discrete":
            return [pair.value for pair in node.pairs]
    return [option.value for option in node.options]
