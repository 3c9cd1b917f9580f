"""Inequalities between the parameters of a search: ``doors.closes + 1 s <= doors.opens``.

A text is one comparison or a chain of them (``a < b < c``) of sums of parameters and quantities, a
parameter with a plain factor if need be (``2 * a``). It is read here, never evaluated.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from daemon.model.search import Point, PointValue, SearchParameter
from grammars.text.diagnostics import InputError, Where, did_you_mean
from grammars.text.quantity import read_quantity, unit_of

PARAMETER_NAME: Final = r"[A-Za-z_]\w*(?:[-./:]\w+)*"
"""How a parameter is called in ``over`` and in inequalities: the layer, a dot, its key there."""
_LONGEST: Final = 500
_MOST_TERMS: Final = 40
_TOLERANCE: Final = 1e-9
"""Sums of rounded values are held to be equal within this, relative to their size."""
_EXAMPLE: Final = "such as: doors.closes + 1 s <= doors.opens"

_OPERATOR: Final = re.compile(r"(<=|>=|<|>)")
_NUMBER: Final = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_UNIT: Final = r"[A-Za-z%°]+(?:\^[0-9.]+)?(?:[*/][A-Za-z%°]+(?:\^[0-9.]+)?)*"
_TERM: Final = re.compile(
    rf"\s*(?P<sign>[+-])?\s*(?:(?P<number>{_NUMBER})\s*(?:\*\s*(?P<scaled>{PARAMETER_NAME})"
    rf"|(?P<unit>{_UNIT}))?|(?P<name>{PARAMETER_NAME}))\s*"
)


@dataclass(frozen=True, slots=True)
class SearchConstraint:
    """``sum of factor * value + constant < 0`` (``<= 0`` if not ``strict``), in SI units.

    ``terms`` are pairs of the number of a parameter and its factor. ``text`` is as written.
    """

    text: str
    terms: tuple[tuple[int, float], ...]
    constant: float
    strict: bool
    units: tuple[float, ...]
    """By what values of each parameter are multiplied to be in SI units."""

    def excess(self, point: Point) -> float:
        """Return the left side [SI] for a point: how far it is from holding, where positive."""
        return self.constant + sum(f * self._si(i, point[i]) for i, f in self.terms)

    def holds(self, point: Point) -> bool:
        """Return whether a point keeps to it."""
        sizes = (abs(f * self._si(i, point[i])) for i, f in self.terms)
        slack = _TOLERANCE * max(1.0, abs(self.constant), *sizes)
        excess = self.excess(point)
        return excess < -slack if self.strict else excess <= slack

    def least(self, parameters: Sequence[SearchParameter]) -> float:
        """Return the smallest :meth:`excess` that any point of the ranges has."""
        return self.constant + sum(
            min(f * self._si(i, value) for value in bounds_of(parameters[i])) for i, f in self.terms
        )

    def _si(self, index: int, value: PointValue) -> float:
        return read_quantity(value).value if isinstance(value, str) else value * self.units[index]


def bounds_of(parameter: SearchParameter) -> tuple[PointValue, ...]:
    """Return both ends of a range, or all choices."""
    return parameter.choices or (parameter.low, parameter.high)


def parse_constraint(
    text: str, parameters: Sequence[SearchParameter], where: Where | None = None
) -> tuple[SearchConstraint, ...]:
    """Read an inequality, or a chain of them, of these parameters.

    Raises :class:`InputError` for what is none, names that are no parameters, and sums of unlike
    quantities; ``where`` is the place of the text, for messages.
    """
    place = where or Where("such that")
    parts = _OPERATOR.split(text)
    if len(text) > _LONGEST:
        raise InputError.at(place, f"is longer than {_LONGEST} characters")
    if len(parts) < 3:
        message = f'"{text}" is no inequality: it compares two sums by <, <=, > or >='
        raise InputError.at(place, message, _EXAMPLE)
    reader = _SumReader(tuple(parameters), text, place)
    sides = [reader.side(part) for part in parts[::2]]
    reader.require_one_dimension(sides)
    units = tuple(unit_factor(parameter) for parameter in parameters)
    found = []
    for operator, (left, right) in zip(parts[1::2], pairwise(sides), strict=True):
        small, large = (left, right) if operator[0] == "<" else (right, left)
        factors = dict.fromkeys((*small.factors, *large.factors), 0.0)
        for index in factors:
            factors[index] = small.factors.get(index, 0.0) - large.factors.get(index, 0.0)
        terms = tuple((index, factor) for index, factor in factors.items() if factor != 0.0)
        constant = small.constant - large.constant
        found.append(SearchConstraint(text, terms, constant, len(operator) == 1, units))
    return tuple(found)


def parse_constraints(
    texts: Sequence[str], parameters: Sequence[SearchParameter]
) -> tuple[SearchConstraint, ...]:
    """Read the inequalities of a search; raises :class:`InputError`."""
    return tuple(one for text in texts for one in parse_constraint(text, parameters))


def names_in_constraint(text: str) -> Iterator[tuple[str, int, int]]:
    """Yield the names in an inequality with the offsets of their beginnings and ends.

    Of a text that is none, yields those before the first thing that cannot be read.
    """
    start = 0
    for part in _OPERATOR.split(text):
        for found in () if _OPERATOR.fullmatch(part) else _terms(part):
            group = "scaled" if found["scaled"] else "name"
            if found[group]:
                yield found[group], start + found.start(group), start + found.end(group)
        start += len(part)


def _terms(text: str) -> Iterator[re.Match[str]]:
    at = 0
    while at < len(text):
        found = _TERM.match(text, at)
        if found is None or (at > 0 and not found["sign"]):
            return
        yield found
        at = found.end()


def unit_factor(parameter: SearchParameter) -> float:
    """Return by what values of a parameter are multiplied to be in SI units."""
    return read_quantity(f"1 {parameter.unit}").value if parameter.unit else 1.0


@dataclass(slots=True)
class _Sum:
    """A side of an inequality: factors by parameter and a constant [SI]."""

    factors: dict[int, float]
    constant: float
    dimensions: dict[str, str]
    """Dimensions of its terms, each with the term that has it; a plain 0 has any."""


@dataclass(frozen=True, slots=True)
class _SumReader:
    """Reads the sides of one inequality."""

    parameters: tuple[SearchParameter, ...]
    text: str
    where: Where

    def side(self, text: str) -> _Sum:
        """Return one side; raises :class:`InputError`."""
        side, at = _Sum({}, 0.0, {}), 0
        for count, found in enumerate(_terms(text)):
            if count >= _MOST_TERMS:
                raise InputError.at(self.where, f"has more than {_MOST_TERMS} terms")
            self._add(side, found)
            at = found.end()
        if at == 0 or at < len(text):
            rest = text[at:].strip()
            wrong = f'cannot read on at "{rest.split()[0]}"' if rest else "a sum is missing"
            raise InputError.at(self.where, f'"{self.text}": {wrong}', _EXAMPLE)
        return side

    def _add(self, side: _Sum, found: re.Match[str]) -> None:
        sign = -1.0 if found["sign"] == "-" else 1.0
        name = found["scaled"] or found["name"]
        if name is None:
            written = f"{found['number']} {found['unit'] or ''}".strip()
            try:
                given = read_quantity(written)
            except ValueError as error:
                raise InputError.at(self.where, str(error)) from error
            side.constant += sign * given.value
            if given.value != 0.0 or given.dimension != "ratio":
                side.dimensions.setdefault(given.dimension, written)
            return
        index = self._index(name)
        factor = sign * (float(found["number"]) if found["scaled"] else 1.0)
        side.factors[index] = side.factors.get(index, 0.0) + factor
        side.dimensions.setdefault(self._dimension(index), name)

    def _index(self, name: str) -> int:
        names = [parameter.name for parameter in self.parameters]
        if name not in names:
            message = f'"{self.text}": nothing called "{name}" is searched'
            raise InputError.at(self.where, message, did_you_mean(name, names))
        return names.index(name)

    def _dimension(self, index: int) -> str:
        parameter = self.parameters[index]
        words = [choice for choice in parameter.choices if isinstance(choice, str)]
        if not words:
            return read_quantity(f"1 {parameter.unit}").dimension if parameter.unit else "ratio"
        try:
            found = {read_quantity(word).dimension for word in words}
        except ValueError:
            found = set()
        if len(found) != 1 or len(words) < len(parameter.choices):
            message = f'"{self.text}": {parameter.name} is no number, it cannot be compared'
            raise InputError.at(self.where, message)
        return found.pop()

    def require_one_dimension(self, sides: Sequence[_Sum]) -> None:
        """Raise :class:`InputError` unless all terms are of one dimension."""
        terms: dict[str, str] = {}
        for side in sides:
            for dimension, term in side.dimensions.items():
                terms.setdefault(dimension, term)
        if len(terms) > 1:
            words = [
                f"{term} {'has no unit' if kind == 'ratio' else f'is in {unit_of(kind)}'}"
                for kind, term in terms.items()
            ]
            raise InputError.at(self.where, f'"{self.text}": {" and ".join(words[:2])}')
