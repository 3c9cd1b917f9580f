"""The space of a search: points as people write them, and the unit cube that methods draw from.

The unit interval of a range has an equal cell for each multiple of the step (with ``log`` for each
equal factor); choices have equal cells too. So all values are equally likely, including the ends,
and near-duplicates are one point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from daemon.model.search import Point, PointValue, SearchParameter, SearchTask
from daemon.search.points import written_point
from grammars.model.geometry import Floats
from grammars.text.diagnostics import Where
from grammars.text.expression_check import read_predicate
from grammars.text.expressions import Name, evaluate
from grammars.text.units import to_si


@dataclass(frozen=True, slots=True)
class Axis:
    """The values of one parameter, by their place in the unit interval.

    ``low`` and ``high`` are the outer ends of its cells, logarithms with ``log``. For a range with
    a ``step``, ``first`` and ``last`` are its ends in steps.
    """

    parameter: SearchParameter
    low: float = 0.0
    high: float = 1.0
    step: float = 0.0
    first: int = 0
    last: int = 0

    @property
    def levels(self) -> float:
        """The number of values of a range, infinite without a step."""
        return self.last - self.first + 1 if self.step else math.inf

    def at(self, share: float) -> PointValue:
        """Return the value at a place in [0, 1]."""
        p = self.parameter
        if p.choices:
            return p.choices[min(int(share * len(p.choices)), len(p.choices) - 1)]
        value = self.low + share * (self.high - self.low)
        if p.log:
            value = math.exp(value)
        if self.step:
            value = min(max(round(value / self.step), self.first), self.last) * self.step
        else:
            value = min(max(value, p.low), p.high)
        # Cut digits that files do not contain, and the sign of a negative zero.
        return float(f"{value:.10g}") + 0.0


class SearchSpace:
    """The values that the parameters of a search may take.

    ``written`` is the scenario as written; ``None`` if a parameter has no written value. Raises
    ``ValueError`` with a message for people for an invalid range, and ``InputError`` for an invalid
    constraint; a checked search has neither.
    """

    def __init__(self, task: SearchTask) -> None:
        self.axes: Final = tuple(map(_axis, task.parameters))
        # Only ranges and lists of numbers can be compared.
        units = {
            p.name: p.unit
            for p in task.parameters
            if not any(isinstance(choice, str) for choice in p.choices)
        }
        self.constraints: Final = tuple(
            read_predicate(text, units, Where(task.name)) for text in task.constraints
        )
        self._columns: Final = {axis.parameter.name: k for k, axis in enumerate(self.axes)}
        self.written: Final = written_point(task)

    @property
    def dimensions(self) -> int:
        """The number of parameters."""
        return len(self.axes)

    def at(self, place: Sequence[float] | Floats) -> Point:
        """Return the point at a place of the unit cube, (d,)."""
        return tuple(axis.at(float(share)) for axis, share in zip(self.axes, place, strict=True))

    def allowed(self, point: Point) -> bool:
        """Return whether every constraint holds."""

        def value_of(name: Name) -> float:
            column = self._columns[name.name]
            return to_si(float(point[column]), self.axes[column].parameter.unit)

        return all(evaluate(constraint, value_of) == 1.0 for constraint in self.constraints)


def _axis(parameter: SearchParameter) -> Axis:
    p = parameter
    if p.choices:
        return Axis(p)
    if not (math.isfinite(p.low) and math.isfinite(p.high) and p.low <= p.high):
        raise ValueError(f"{p.name}: {p.low:g} .. {p.high:g} is not a range")
    if p.log and p.low <= 0.0:
        raise ValueError(f"{p.name}: a logarithmic range begins above 0")
    scale = math.log if p.log else float
    if p.step > 0.0:
        # 0.3 / 0.1 is 2.9999999999999996: a bound that is a multiple of the step is a value.
        first = max(math.ceil(p.low / p.step - 1e-9), 1 if p.log else -math.inf)
        last = math.floor(p.high / p.step + 1e-9)
        if first <= last:
            low, high = scale((first - 0.5) * p.step), scale((last + 0.5) * p.step)
            return Axis(p, low, high, p.step, int(first), last)
    return Axis(p, scale(p.low), scale(p.high))
