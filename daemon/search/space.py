"""The space of a search: points as people write them, and the unit cube that methods work in.

Along a range the unit interval is divided into equal cells, one for each value that is a multiple
of the step (with ``log`` the logarithm runs evenly); choices have equal cells too. So every value
is as likely as any other, those at the ends included, and near-duplicates are one point.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from daemon.model.search import Point, PointValue, SearchParameter, SearchTask
from daemon.search.points import written_point
from grammars.model.geometry import Floats
from grammars.text.diagnostics import Where
from grammars.text.expression_check import read_predicate
from grammars.text.expressions import Name, evaluate
from grammars.text.units import to_si

_FINEST: Final = 2**40
"""Values along a range beyond which a step makes no difference."""


@dataclass(frozen=True, slots=True)
class Axis:
    """The values of one parameter, by their place in the unit interval.

    ``levels`` counts them; 0 where there are too many to count. Of a range with a step, ``first``
    is the lowest multiple of the step in it, in steps.
    """

    parameter: SearchParameter
    levels: int
    first: int = 0

    @property
    def is_number(self) -> bool:
        """Whether it is a range, and no list of choices."""
        return not self.parameter.choices

    def at(self, share: float) -> PointValue:
        """Return the value at a place in [0, 1]."""
        p = self.parameter
        if p.choices:
            return p.choices[min(int(share * self.levels), self.levels - 1)]
        if self.levels and not p.log:
            return self.level(min(int(share * self.levels), self.levels - 1))
        if p.log:
            value = math.exp(math.log(p.low) + share * math.log(p.high / p.low))
        else:
            value = p.low + share * (p.high - p.low)
        if self.levels:
            level = round(value / p.step) - self.first
            return self.level(min(max(level, 0), self.levels - 1))
        return min(max(_as_written(value), p.low), p.high)

    def level(self, number: int) -> PointValue:
        """Return the value that has ``number`` others below it (of choices: before it)."""
        p = self.parameter
        return p.choices[number] if p.choices else _as_written((self.first + number) * p.step)

    def share(self, value: PointValue) -> float:
        """Return the middle of the cell of a value; one outside of the range is at its end.

        Raises ``ValueError`` for what is not among the choices, and for words in a range.
        """
        p = self.parameter
        if p.choices:
            return (p.choices.index(value) + 0.5) / self.levels
        number = float(value)
        if p.log:
            low, high = math.log(p.low), math.log(p.high)
            place = math.log(max(number, p.low)) - low
            share = place / (high - low) if high > low else 0.5
        elif self.levels:
            share = (round(number / p.step) - self.first + 0.5) / self.levels
        else:
            share = (number - p.low) / (p.high - p.low) if p.high > p.low else 0.5
        return min(max(share, 0.0), 1.0)

    def contains(self, value: PointValue) -> bool:
        """Return whether a value is one of the choices, or lies in the range."""
        p = self.parameter
        if p.choices:
            return value in p.choices
        return not isinstance(value, str) and p.low <= value <= p.high


class SearchSpace:
    """What the parameters of a search may be.

    ``written`` is the scenario as written; ``None`` where a parameter is written nowhere. Raises
    ``ValueError`` with a message for people where a range makes no sense, and ``InputError`` where
    a constraint does; a search that was checked has none of these.
    """

    def __init__(self, task: SearchTask) -> None:
        self.axes: Final = tuple(_axis(parameter) for parameter in task.parameters)
        units = {axis.parameter.name: axis.parameter.unit for axis in self.axes if _counts(axis)}
        self.constraints: Final = tuple(
            read_predicate(text, units, Where(task.name)) for text in task.constraints
        )
        self._columns: Final = {axis.parameter.name: k for k, axis in enumerate(self.axes)}
        self.written: Final = written_point(task)

    @property
    def dimensions(self) -> int:
        """The number of parameters."""
        return len(self.axes)

    @property
    def size(self) -> int:
        """The number of points, allowed or not; 0 when there are too many to count."""
        size = math.prod(axis.levels for axis in self.axes)
        return size if size < _FINEST else 0

    def at(self, u: Sequence[float] | Floats) -> Point:
        """Return the point at a place of the unit cube, (d,)."""
        return tuple(axis.at(float(share)) for axis, share in zip(self.axes, u, strict=True))

    def unit(self, point: Point) -> Floats:
        """Return the place of a point in the unit cube, (d,): the middle of its cell.

        What lies outside of its range is at its end. Raises ``ValueError`` for a value that is not
        among its choices.
        """
        return np.array([a.share(value) for a, value in zip(self.axes, point, strict=True)])

    def contains(self, point: Point) -> bool:
        """Return whether every value lies in its range or is among its choices."""
        return all(axis.contains(value) for axis, value in zip(self.axes, point, strict=True))

    def allowed(self, point: Point) -> bool:
        """Return whether every constraint holds."""

        def value_of(name: Name) -> float:
            column = self._columns[name.name]
            return to_si(float(point[column]), self.axes[column].parameter.unit)

        return all(evaluate(constraint, value_of) == 1.0 for constraint in self.constraints)

    def points(self) -> Iterator[Point]:
        """Return every point of a space that has a size, the last parameter changing fastest."""
        for index in np.ndindex(*(axis.levels for axis in self.axes)):
            yield tuple(axis.level(k) for axis, k in zip(self.axes, index, strict=True))


def _counts(axis: Axis) -> bool:
    """Whether its values can be summed: ranges, and lists of nothing but numbers."""
    return not any(isinstance(value, str) for value in axis.parameter.choices)


def _axis(parameter: SearchParameter) -> Axis:
    p = parameter
    if p.choices:
        return Axis(p, len(p.choices))
    if not (math.isfinite(p.low) and math.isfinite(p.high) and p.low <= p.high):
        raise ValueError(f"{p.name}: {p.low:g} .. {p.high:g} is no range")
    if p.log and p.low <= 0.0:
        raise ValueError(f"{p.name}: a logarithmic range begins above 0")
    if p.step <= 0.0:
        return Axis(p, 0)
    # 0.3 / 0.1 is 2.9999999999999996: a bound that is a multiple of the step belongs to the range.
    first, last = math.ceil(p.low / p.step - 1e-9), math.floor(p.high / p.step + 1e-9)
    fits = first <= last and last - first < _FINEST
    return Axis(p, last - first + 1, first) if fits else Axis(p, 0)


def _as_written(value: float) -> float:
    """Return a number without the digits that are not written in a file."""
    return float(f"{value:.10g}") + 0.0  # no negative zero
