"""Inequalities between sums of named quantities: ``closes + 1 s <= opens``.

They are read into one linear form in SI units, so that testing one is a few multiplications;
nothing of the text is evaluated.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

from grammars.text.diagnostics import did_you_mean
from grammars.text.quantity import Quantity, read_quantity, unit_of
from grammars.text.units import WRITTEN_UNIT

LONGEST: Final = 1000
"""Characters of an inequality."""
_COMPARISON: Final = re.compile(r"<=|>=|<|>")
_OPERATOR: Final = re.compile(r"\s*([+-])\s*")
_QUANTITY: Final = re.compile(rf"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?:\s*{WRITTEN_UNIT})?")
_NAME: Final = re.compile(r"[^\s+<>=-]+")
_TOLERANCE: Final = 1e-9
"""Relative to the largest of the summands: 0.1 + 0.2 is not more than 0.3."""
_Summand: TypeAlias = tuple[str, float, Quantity]


class InequalityError(ValueError):
    """An inequality that cannot be read: ``message`` says why, ``hint`` what was meant."""

    def __init__(self, message: str, hint: str = "") -> None:
        self.message, self.hint = message, hint
        super().__init__(f"{message}; {hint}" if hint else message)


@dataclass(frozen=True, slots=True)
class Inequality:
    """A sum that is at most zero, or less than zero where it is ``strict``.

    ``factors`` are (name, factor): a value as it is written, times its factor, is in ``unit``, as
    ``constant`` is. ``text`` is how it was written.
    """

    text: str
    factors: tuple[tuple[str, float], ...]
    constant: float
    strict: bool
    unit: str

    def holds(self, values: Mapping[str, float]) -> bool:
        """Return whether it holds for values in the units that the names were declared with.

        Equal within 1e-9 of the largest summand counts as equal. Raises ``KeyError`` for a name
        without a value.
        """
        summands = [self.constant, *(factor * values[name] for name, factor in self.factors)]
        slack = _TOLERANCE * max(map(abs, summands))
        total = sum(summands)
        return total < -slack if self.strict else total <= slack

    @property
    def names(self) -> tuple[str, ...]:
        """The names it is about, each once."""
        return tuple(name for name, _ in self.factors)


def read_inequality(text: str, units: Mapping[str, str]) -> Inequality:
    """Read an inequality between sums; ``units`` has the unit of each name, empty for none.

    A sum has names and quantities, ``opens + 1 s - delay``, all of one dimension. Raises
    ``ValueError`` with a message for people.
    """
    if len(text) > LONGEST:
        raise ValueError(f"an inequality has at most {LONGEST} characters")
    comparisons = _COMPARISON.findall(text)
    sides = _COMPARISON.split(text)
    if len(sides) > 2:
        pairs = zip(sides, comparisons, sides[1:], strict=False)
        single = ", ".join(f"{a.strip()} {sign} {b.strip()}" for a, sign, b in pairs)
        raise InequalityError(f'"{text}" compares more than two sums', f"write [{single}]")
    if len(sides) != 2:
        raise ValueError(f'"{text}" is no inequality, such as "closes + 1 s <= opens"')
    left, right = sides
    larger_first = comparisons[0].startswith(">")
    small, large = (right, left) if larger_first else (left, right)
    summands = [*_summands(text, small, 1.0, units), *_summands(text, large, -1.0, units)]
    dimension = _only_dimension(text, summands)
    factors: dict[str, float] = {}
    constant = 0.0
    for name, sign, quantity in summands:
        if name:
            factors[name] = factors.get(name, 0.0) + sign * quantity.value
        else:
            constant += sign * quantity.value
    if not factors:
        raise ValueError(f'"{text}" names nothing that is varied')
    strict = not comparisons[0].endswith("=")
    return Inequality(text, tuple(factors.items()), constant, strict, unit_of(dimension))


def _summands(text: str, side: str, sign: float, units: Mapping[str, str]) -> Iterator[_Summand]:
    """Return the summands of a side, each with a name or none, its sign and its size."""
    known = sorted(units, key=lambda name: (-len(name), name))
    rest, first = side.strip(), True
    while rest or first:
        operator = _OPERATOR.match(rest)
        if operator is None and not first:
            raise ValueError(f'"{text}": expected + or - before "{rest}"')
        direction = -sign if operator is not None and operator[1] == "-" else sign
        rest = rest[operator.end() :] if operator is not None else rest
        name = next((name for name in known if _starts_with(rest, name)), "")
        number = None if name else _QUANTITY.match(rest)
        if name:
            unit = units[name]
            yield name, direction, read_quantity(f"1 {unit}" if unit else "1")
            rest = rest[len(name) :]
        elif number is not None:
            yield "", direction, read_quantity(number[0])
            rest = rest[number.end() :]
        else:
            raise _not_a_summand(text, rest, units)
        rest, first = rest.lstrip(), False


def _starts_with(rest: str, name: str) -> bool:
    """Return whether a name stands at the beginning, and no longer word does."""
    after = rest[len(name) : len(name) + 1]
    return rest.startswith(name) and not (after.isalnum() or after in ("_", ".", "/"))


def _not_a_summand(text: str, rest: str, units: Mapping[str, str]) -> InequalityError:
    word = _NAME.match(rest)
    if word is None:
        return InequalityError(f'"{text}": a name or a quantity is missing')
    message = f'"{text}": "{word[0]}" is not varied here: vary it, or write its value'
    return InequalityError(message, did_you_mean(word[0], units))


def _only_dimension(text: str, summands: list[_Summand]) -> str:
    first = summands[0]
    for other in summands[1:]:
        if other[2].dimension != first[2].dimension:
            raise ValueError(f'"{text}": {_told(first)} and {_told(other)} do not go together')
    return first[2].dimension


def _told(summand: _Summand) -> str:
    name, _, quantity = summand
    unit = "without a unit" if quantity.unit == "1" else f"in {quantity.unit}"
    return f"{name or f'{quantity.value:g}'} {unit}"
