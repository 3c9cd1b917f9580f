"""Arithmetic over named draws, attributes and measures of a sampled plan, with dimensions.

Values are in metres and radians. A number without a unit next to a length is in metres, as in the
plans themselves; next to an angle it is refused, because nobody can tell degrees from radians.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal, Protocol, TypeAlias

from grammars.floorplan import Feature, FloorPlan, Opening, Space
from grammars.text.diagnostics import Where
from grammars.text.units import ANGLE, LENGTH, RATIO, Dimension
from grammars.variation.plan_text import PlanElement, Slot

AREA: Final = LENGTH * LENGTH
_TOLERANCE: Final = 1e-9


class EvaluationContext(Protocol):
    """What an expression may ask about one sampled plan."""

    def shared(self, name: str) -> float:
        """Return a named draw [m, rad or plain]."""

    def attribute(self, slot: Slot) -> float:
        """Return what the sampled plan says at a place [m or rad]."""

    @property
    def plan(self) -> FloorPlan:
        """The sampled plan."""


@dataclass(frozen=True, slots=True)
class Constant:
    """A literal."""

    value: float


@dataclass(frozen=True, slots=True)
class NamedDraw:
    """A named draw."""

    name: str


@dataclass(frozen=True, slots=True)
class PlanAttribute:
    """An attribute or variable of the plan."""

    slot: Slot


@dataclass(frozen=True, slots=True)
class PlanMeasure:
    """Something measured on the compiled plan; ``name`` is how it was written."""

    name: str
    take: Callable[[FloorPlan], float]


@dataclass(frozen=True, slots=True)
class Operation:
    """``+ - * /`` with two operands, ``neg`` and ``abs`` with one, ``min`` and ``max`` with any."""

    operator: Literal["+", "-", "*", "/", "neg", "abs", "min", "max"]
    operands: tuple[Expression, ...]


Expression: TypeAlias = Constant | NamedDraw | PlanAttribute | PlanMeasure | Operation


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
        return any(isinstance(node, PlanMeasure) for side in (self.left, self.right)
                   for node in parts(side))  # fmt: skip

    def holds(self, drawn: EvaluationContext) -> bool:
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
    """Return the expression and everything in it, what is put together before its operands."""
    # Not by recursion: a sum of a thousand terms is nested a thousand deep.
    found: list[Expression] = []
    waiting = [expression]
    while waiting:
        found.append(waiting.pop())
        if isinstance(found[-1], Operation):
            waiting += reversed(found[-1].operands)
    return found


def evaluate(expression: Expression, drawn: EvaluationContext) -> float:
    """Return the value of an expression; dividing by zero gives nan, which fulfils nothing."""
    values: list[float] = []
    for part in reversed(parts(expression)):
        match part:
            case Constant(value):
                values.append(value)
            case NamedDraw(name):
                values.append(drawn.shared(name))
            case PlanAttribute(slot):
                values.append(drawn.attribute(slot))
            case PlanMeasure(_, take):
                values.append(take(drawn.plan))
            case Operation(operator, operands):
                values.append(_combine(operator, [values.pop() for _ in operands]))
    return values.pop()


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
    known = {RATIO: "a plain number", LENGTH: "a length", AREA: "an area", ANGLE: "an angle"}
    if dimension in known:
        return known[dimension]
    powers = zip(("m", "rad", "s", "kg"), dimension.exponents, strict=True)
    return " ".join(u if p == 1 else f"{u}^{p:g}" for u, p in powers if p)


Part: TypeAlias = Space | Feature | Opening
Measurement: TypeAlias = tuple[Dimension, Callable[[FloorPlan], float]]
_Measures: TypeAlias = Mapping[str, tuple[Dimension, Callable[[Any], float]]]


def _area(space: Space) -> float:
    import shapely

    return float(shapely.Polygon(space.outline).area)


# What is measured, by the word people write: its dimension and how to take it from the part.
_OF_SPACES: Final[_Measures] = {
    "area": (AREA, _area),
    "perimeter": (LENGTH, lambda space: sum(wall.length for wall in space.walls)),
    "thickness": (LENGTH, lambda space: space.walls[0].thickness),
    "height": (LENGTH, lambda space: space.walls[0].height),
}
_OF_OPENINGS: Final[_Measures] = {
    "width": (LENGTH, lambda opening: opening.width),
    "height": (LENGTH, lambda opening: opening.z_max - opening.z_min),
    "depth": (LENGTH, lambda opening: opening.depth),
    "sill": (LENGTH, lambda opening: opening.z_min),
}
_OF_FEATURES: Final[_Measures] = {"height": (LENGTH, lambda feature: feature.height)}


def measures_of(element: PlanElement) -> _Measures:
    """Return what can be measured on an element, by the word people write."""
    if element.is_opening:
        return _OF_OPENINGS
    return _OF_SPACES if element.kind == "space" else _OF_FEATURES


def measurement(element: PlanElement, word: str) -> Measurement:
    """Return the dimension of a measure and how to take it."""
    dimension, take = measures_of(element)[word]
    return dimension, lambda plan: take(find_part(plan, element))


def distance(one: PlanElement, other: PlanElement) -> Measurement:
    """Return how to measure the shortest distance between two elements, seen from above [m]."""

    def take(plan: FloorPlan) -> float:
        import shapely

        a, b = (shapely.Polygon(_ring(find_part(plan, e))) for e in (one, other))
        return float(shapely.distance(a, b))

    return LENGTH, take


def find_part(plan: FloorPlan, element: PlanElement) -> Part:
    """Return the part of the compiled plan that an element of its text became."""
    *space, name = element.address.split(".")
    if element.kind == "space":
        return next(part for part in plan.spaces if part.name == name)
    if element.is_opening:
        return next(part for part in plan.openings if part.name == name)
    owner = space[0] if space else ""
    return next(part for part in plan.features if (part.space, part.name) == (owner, name))


def _ring(part: Part) -> tuple[tuple[float, float], ...]:
    return part.outline if isinstance(part, Space) else part.footprint
