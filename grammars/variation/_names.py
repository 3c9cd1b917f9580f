"""Names of a variation: draws, elements of the plan, their attributes and measures.

Unknown names are reported with suggestions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

from grammars.floorplan import Feature, FloorPlan, Opening, Space
from grammars.text.diagnostics import (
    Findings,
    SourceText,
    SyntaxNode,
    Where,
    closest,
    did_you_mean,
    rule_of,
    with_article,
)
from grammars.text.expression_check import MaybeKind, Unknown
from grammars.text.expressions import Name, render
from grammars.text.units import ANGLE, DIMENSIONS, LENGTH, RATIO, Dimension
from grammars.variation._syntax import FUNCTIONS
from grammars.variation.plan_text import PlanElement, PlanText, Slot

_AREA: Final = LENGTH * LENGTH
_OLD_SPELLINGS: Final = (
    ("location.transformation.", "location."),
    ("location.pose.", "location."),
    ("pose.", "location."),
    ("wall_", "defaults.wall."),
    ("wall.", "defaults.wall."),
    ("walls.", "defaults.wall."),
)
"""Spellings of older versions of the language, each with the current one."""


@dataclass(frozen=True, slots=True)
class PlanMeasure:
    """A measure of the compiled plan, and its dimension."""

    dimension: Dimension
    take: Callable[[FloorPlan], float]


Meaning: TypeAlias = str | Slot | PlanMeasure
"""A draw by its name, an attribute or variable of the plan, or a measure."""


@dataclass(frozen=True, slots=True)
class NameReader:
    """Looks up names and reports unknown ones.

    ``draws`` has the dimension of each named draw, ``meanings`` the meaning of each name in an
    expression.
    """

    plan: PlanText
    source: SourceText
    findings: Findings
    draws: dict[str, Dimension] = field(default_factory=dict)
    meanings: dict[Name, Meaning] = field(default_factory=dict)

    def element(self, address: str, place: SyntaxNode | Where) -> PlanElement | None:
        """Return the element of an address such as ``hall`` or ``hall.pillar``."""
        elements = self.plan.elements.get(address, [])
        if len(elements) == 1:
            return elements[0]
        if elements:
            kinds = " and ".join(with_article(e.kind) for e in elements)
            message = f'"{address}" is the name of {kinds}'
            self.findings.error(place, message, "rename one of them in the plan")
        else:
            self.findings.error(place, f'the plan has no "{address}"', self._suggest(address))
        return None

    def _suggest(self, address: str) -> str:
        if address in self.plan.variables:
            return f'it is a variable: write "{address}: uniform([…])"'
        if address == self.plan.name:
            return "the plan itself has no attributes to vary"
        inside = [name for name in self.plan.elements if name.endswith(f".{address}")]
        if inside:
            return f"write {' or '.join(inside)}: features are addressed by their space"
        return did_you_mean(address, self.plan.elements)

    def variable(self, name: str, place: SyntaxNode) -> Slot | None:
        """Return the variable of a statement such as ``ceiling: uniform(…)``."""
        slot = self.plan.variables.get(name)
        if slot is not None:
            return slot
        if name in self.plan.elements:
            paths = ", ".join(self.plan.elements[name][0].paths())
            hint = f'write its attributes: "{name}: {{ … }}" with {paths}'
            self.findings.error(place, f'"{name}" is not a variable of the plan', hint)
        else:
            hint = did_you_mean(name, self.plan.variables) or "the plan has no variables"
            self.findings.error(place, f'the plan has no variable "{name}"', hint)
        return None

    def attribute(
        self, element: PlanElement, path: str, place: SyntaxNode | Where, more: Sequence[str] = ()
    ) -> Slot | None:
        """Return the slot of an attribute; ``more`` has further words to suggest."""
        slot = self.plan.slot(element, path)
        if slot is None:
            label = f'{element.kind} "{element.address}"'
            hint = _suggested_path(path, element, more)
            self.findings.error(place, f'{label} has no "{path}"', hint)
        return slot

    def kind_of(self, name: Name, *, draws_only: bool = False) -> MaybeKind:
        """Return the dimension of a name in a requirement; with ``draws_only``, in a value."""
        place = self.source.where(name.column)
        # There may be blanks around dots.
        text = ".".join(part.strip() for part in name.name.split("."))
        if name.arguments and text != "distance":
            hint = did_you_mean(text, FUNCTIONS)
            self.findings.error(place, f'there is no function "{text}"', hint)
            return Unknown.UNKNOWN
        meaning: Meaning | None = None
        if text in self.draws and not name.arguments:
            meaning = text
        elif draws_only:
            self._refuse(name, text, place)
        elif name.arguments:
            meaning = self._distance(name, place)
        elif "." in text:
            meaning = self._of_element(text, place)
        else:
            meaning = self._variable_or_nothing(text, place)
        if meaning is None:
            return Unknown.UNKNOWN
        self.meanings[name] = meaning
        match meaning:
            case str():
                return self.draws[meaning]
            case Slot():
                return DIMENSIONS[meaning.kind]
        return meaning.dimension

    def _refuse(self, name: Name, text: str, place: Where) -> None:
        """Report a name that is not a draw, in a value that allows only draws."""
        message = f'there is no draw "{text}"'
        if name.arguments:
            message = "values can use distributions and named draws, but no measures of the plan"
            hint = did_you_mean("", self.draws) or 'define one: "let wide = uniform(…)"'
        elif closest(text, self.draws):
            hint = did_you_mean(text, self.draws)
        elif "." in text:
            hint = "values can use distributions and draws defined by let"
        else:
            hint = f'define it first: "let {text} = uniform(…)"'
        self.findings.error(place, message, hint)

    def _distance(self, name: Name, place: Where) -> PlanMeasure | None:
        if len(name.arguments) != 2 or not all(
            isinstance(one, Name) and not one.arguments for one in name.arguments
        ):
            hint = "distance(hall.pillar, door)"
            self.findings.error(place, "distance takes two elements of the plan", hint)
            return None
        one, other = (
            self.element(render(argument), self.source.where(argument.column))
            for argument in name.arguments
        )
        if one is None or other is None:
            return None

        def take(plan: FloorPlan) -> float:
            import shapely

            a, b = (shapely.Polygon(_ring(_find_part(plan, part))) for part in (one, other))
            return float(shapely.distance(a, b))

        return PlanMeasure(LENGTH, take)

    def _variable_or_nothing(self, name: str, place: Where) -> Slot | None:
        slot = self.plan.variables.get(name)
        if slot is None and name in self.plan.elements:
            element = self.plan.elements[name][0]
            words = ", ".join([*_measures_of(element), *element.paths()])
            message = f'"{name}" is {with_article(element.kind)}'
            self.findings.error(place, message, f"it has: {words}")
        elif slot is None:
            hint = did_you_mean(name, [*self.draws, *self.plan.variables])
            self.findings.error(place, f'there is no draw or variable "{name}"', hint)
        return slot

    def _of_element(self, text: str, place: Where) -> Slot | PlanMeasure | None:
        """Return the meaning of a path such as ``hall.pillar.height``."""
        words = text.split(".")
        for count in (1, 2):
            address, path = ".".join(words[:count]), ".".join(words[count:])
            for element in self.plan.elements.get(address, []):
                is_feature = ".".join(words[: count + 1]) in self.plan.elements
                if path in element.paths() or not is_feature:
                    return self._attribute_or_measure(element, path, place)
        address = ".".join(words[:-1])
        self.findings.error(place, f'the plan has no "{address}"', self._suggest(address))
        return None

    def _attribute_or_measure(
        self, element: PlanElement, path: str, place: Where
    ) -> Slot | PlanMeasure | None:
        measures = _measures_of(element)
        if path not in measures:
            return self.attribute(element, path, place, tuple(measures))
        dimension, take = measures[path]
        return PlanMeasure(dimension, lambda plan: take(_find_part(plan, element)))


def _suggested_path(path: str, element: PlanElement, more: Sequence[str]) -> str:
    """Return ``did you mean …?`` if a path is close, followed by all paths."""
    paths = [*more, *element.paths()]
    close = _closest_path(path, paths)
    question = f'did you mean "{close}"? ' if close else ""
    points = rule_of(element.node.shape) == "Polygon" and path.startswith("shape")
    note = "; use variables of the plan to vary points" if points else ""
    return f"{question}it has: {', '.join(paths)}{note}"


def _closest_path(path: str, paths: Sequence[str]) -> str:
    for old, new in _OLD_SPELLINGS:
        if path.startswith(old) and new + path.removeprefix(old) in paths:
            return new + path.removeprefix(old)
    endings = [name for name in paths if name.endswith(f".{path}")]
    return endings[0] if len(endings) == 1 else closest(path, paths)


def dimension_name(dimension: Dimension) -> str:
    """Return ``a length``, ``an area``, or the unit of other dimensions."""
    names = {RATIO: "a plain number", LENGTH: "a length", _AREA: "an area", ANGLE: "an angle"}
    return names.get(dimension, dimension.unit)


_Part: TypeAlias = Space | Feature | Opening
_Measures: TypeAlias = Mapping[str, tuple[Dimension, Callable[[Any], float]]]


def _area(space: Space) -> float:
    import shapely

    return float(shapely.Polygon(space.outline).area)


# Measures by keyword, each with its dimension and a function of the part.
_OF_SPACES: Final[_Measures] = {
    "area": (_AREA, _area),
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


def _measures_of(element: PlanElement) -> _Measures:
    if element.is_opening:
        return _OF_OPENINGS
    return _OF_SPACES if element.kind == "space" else _OF_FEATURES


def _find_part(plan: FloorPlan, element: PlanElement) -> _Part:
    """Return the part of the compiled plan for an element of its text."""
    *space, name = element.address.split(".")
    if element.kind == "space":
        return next(part for part in plan.spaces if part.name == name)
    if element.is_opening:
        return next(part for part in plan.openings if part.name == name)
    owner = space[0] if space else ""
    return next(part for part in plan.features if (part.space, part.name) == (owner, name))


def _ring(part: _Part) -> tuple[tuple[float, float], ...]:
    return part.outline if isinstance(part, Space) else part.footprint
