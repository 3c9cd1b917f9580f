"""Arithmetic over named draws, attributes and measures of a sampled plan, with dimensions.

Values are in metres and radians. A number without a unit next to a length is in metres, as in the
plans themselves; next to an angle it is refused, because nobody can tell degrees from radians.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal, Protocol, TypeAlias

from grammars.diagnostics import Where
from grammars.floorplan import FloorPlan
from grammars.variation._plan import Slot

Dimension: TypeAlias = tuple[int, int]
"""Powers of metres and radians."""

PLAIN: Final = (0, 0)
LENGTH: Final = (1, 0)
AREA: Final = (2, 0)
ANGLE: Final = (0, 1)
UNITS: Final = {
    "m": (1.0, LENGTH),
    "m^2": (1.0, AREA),
    "m²": (1.0, AREA),
    "rad": (1.0, ANGLE),
    "deg": (math.pi / 180.0, ANGLE),
}
_TOLERANCE: Final = 1e-9


class Drawn(Protocol):
    """What an expression may ask about one sampled plan."""

    def shared(self, name: str) -> float:
        """Return a named draw [m, rad or plain]."""

    def attribute(self, slot: Slot) -> float:
        """Return what the sampled plan says at a place [m or rad]."""

    @property
    def plan(self) -> FloorPlan:
        """The sampled plan."""


@dataclass(frozen=True, slots=True)
class Number:
    """A literal."""

    value: float


@dataclass(frozen=True, slots=True)
class Shared:
    """A named draw."""

    name: str


@dataclass(frozen=True, slots=True)
class Attribute:
    """An attribute or variable of the plan."""

    slot: Slot


@dataclass(frozen=True, slots=True)
class Measure:
    """Something measured on the compiled plan; ``name`` is how it was written."""

    name: str
    take: Callable[[FloorPlan], float]


@dataclass(frozen=True, slots=True)
class Operation:
    """``+ - * /`` with two operands, ``neg`` and ``abs`` with one, ``min`` and ``max`` with any."""

    operator: Literal["+", "-", "*", "/", "neg", "abs", "min", "max"]
    operands: tuple[Expression, ...]


Expression: TypeAlias = Number | Shared | Attribute | Measure | Operation


@dataclass(frozen=True, slots=True)
class Requirement:
    """A comparison that every variant must fulfil; ``text`` is how it was written."""

    left: Expression
    comparison: Literal["<=", "<", ">=", ">", "==", "!="]
    right: Expression
    text: str
    where: Where

    @property
    def needs_plan(self) -> bool:
        """Whether something must be measured on the compiled plan."""
        return any(isinstance(node, Measure) for side in (self.left, self.right)
                   for node in parts(side))  # fmt: skip

    def holds(self, drawn: Drawn) -> bool:
        """Return whether the comparison holds; equal within 1e-9 counts as equal."""
        difference = evaluate(self.left, drawn) - evaluate(self.right, drawn)
        equal = abs(difference) <= _TOLERANCE
        match self.comparison:
            case "<=":
                return difference < 0.0 or equal
            case ">=":
                return difference > 0.0 or equal
            case "<":
                return difference < 0.0 and not equal
            case ">":
                return difference > 0.0 and not equal
            case "==":
                return equal
            case "!=":
                return not equal and not math.isnan(difference)


def parts(expression: Expression) -> list[Expression]:
    """Return the expression and everything in it."""
    inner = expression.operands if isinstance(expression, Operation) else ()
    return [expression, *(node for operand in inner for node in parts(operand))]


def evaluate(expression: Expression, drawn: Drawn) -> float:
    """Return the value of an expression; dividing by zero gives nan, which fulfils nothing."""
    match expression:
        case Number(value):
            return value
        case Shared(name):
            return drawn.shared(name)
        case Attribute(slot):
            return drawn.attribute(slot)
        case Measure(_, take):
            return take(drawn.plan)
        case Operation(operator, operands):
            return _combine(operator, [evaluate(operand, drawn) for operand in operands])


def _combine(operator: str, values: list[float]) -> float:
    match operator:
        case "+":
            return values[0] + values[1]
        case "-":
            return values[0] - values[1]
        case "*":
            return values[0] * values[1]
        case "/":
            return values[0] / values[1] if values[1] else math.nan
        case "neg":
            return -values[0]
        case "abs":
            return abs(values[0])
        case "min":
            return min(values)
        case _:
            return max(values)


def dimension_name(dimension: Dimension) -> str:
    """Return ``a length``, ``m^2 rad`` and so on."""
    known = {PLAIN: "a plain number", LENGTH: "a length", AREA: "an area", ANGLE: "an angle"}
    if dimension in known:
        return known[dimension]
    powers = zip(("m", "rad"), dimension, strict=True)
    return " ".join(u if p == 1 else f"{u}^{p}" for u, p in powers if p)
