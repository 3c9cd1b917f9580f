"""Attributes of one element: quantities with units or variables, and its location."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from grammars.text.diagnostics import (
    Findings,
    SourceText,
    SyntaxNode,
    Where,
    did_you_mean,
    turn_of,
    with_article,
)
from grammars.text.expression_check import DimensionCheck, MaybeKind, Unknown
from grammars.text.expressions import Name, evaluate, read_expression, walk
from grammars.text.units import NAMES, RATIO, Dimension, read_unit, to_si

LARGEST: Final = 1e6
"""Largest number of metres or radians in a plan."""
_UNIT_ADVICE: Final = {
    "length": "write a length, in m, cm or mm",
    "angle": "write an angle, in deg or rad",
}
PlanDimension: TypeAlias = Literal["length", "angle"]


@dataclass(frozen=True, slots=True, eq=False)
class PlanVariable:
    """Variable of a plan: ``value`` [m or rad], ``text`` as written, and its place."""

    name: str
    value: float
    dimension: str
    text: str
    where: Where


class ElementReader(Findings):
    """Reader of the quantities of one plan: reports broken ones and reads them as NaN."""

    def __init__(self, source: SourceText) -> None:
        super().__init__(source)
        self._text = source
        self._nodes: dict[str, list[SyntaxNode]] = {}
        self._values: dict[str, tuple[Dimension, float]] = {}
        """Dimension and value [m or rad] of each variable read so far."""
        self._check = DimensionCheck(source, self, self._dimension_of)

    def define(
        self, variables: Sequence[SyntaxNode], values: Mapping[str, float]
    ) -> tuple[PlanVariable, ...]:
        """Define the variables of the plan; ``values`` [m or rad] replace the written ones."""
        for variable in variables:
            self._nodes.setdefault(variable.name, []).append(variable)
        defined = []
        for node in variables:
            dimension, value = self._value_of(node)
            if NAMES.get(dimension) not in _UNIT_ADVICE and not math.isnan(value):
                is_plain = dimension == RATIO
                problem = "has no unit" if is_plain else f"is in {node.unit or dimension.unit}"
                hint = "a plan has only lengths and angles"
                self.error(node, f'variable "{node.name}" {problem}', hint)
            self._values.setdefault(node.name, (dimension, values.get(node.name, value)))
            text = self._written(node.sum) if node.sum else f"{node.number} {node.unit}"
            name = NAMES.get(dimension, node.unit)
            defined.append(PlanVariable(node.name, value, name, text, self.where(node)))
        for name, nodes in self._nodes.items():
            for node in nodes[1:]:
                first = self.where(nodes[0]).line
                self.warning(node, f'variable "{name}" is already defined in line {first}')
        return tuple(defined)

    def length(self, node: SyntaxNode) -> float:
        """Return a length in metres."""
        return self._read(node, "length")

    def angle(self, node: SyntaxNode) -> float:
        """Return an angle in radians."""
        return self._read(node, "angle")

    def _value_of(self, node: SyntaxNode) -> tuple[Dimension, float]:
        """Return dimension and SI value of a number with a unit, or of a sum."""
        if not node.sum:
            return read_unit(node.unit)[1], to_si(float(node.number), node.unit)
        with self.collecting():
            expression = read_expression(node.sum, self._text)
            dimension = self._check.quantity(expression)
            if dimension is not None:
                value = evaluate(expression, lambda name: self._values[name.name][1])
                names = [part.name for part in walk(expression) if isinstance(part, Name)]
                if math.isnan(value) and not any(math.isnan(self._values[n][1]) for n in names):
                    self.error(node.sum, f"{self._written(node.sum)} divides by zero")
                return dimension, value
        return RATIO, math.nan

    def _written(self, node: SyntaxNode) -> str:
        return " ".join(self._text.text[node._tx_position : node._tx_position_end].split())

    def _dimension_of(self, name: Name) -> MaybeKind:
        place = self._text.where(name.column)
        if name.arguments:
            hint = "there are abs, min and max"
            self.error(place, f'there is no function "{name.name}"', hint)
        elif self._is_defined(name.name, place):
            return self._values[name.name][0]
        return Unknown.UNKNOWN

    def _is_defined(self, name: str, place: SyntaxNode | Where) -> bool:
        """Return whether a variable has one value at ``place``, and report one that has none."""
        nodes = self._nodes.get(name, [])
        if not nodes:
            counts = f" {name} = " in f" {turn_of(self.where(place))}"
            hint = did_you_mean(name, self._values) or f'define it: "var {name} = 1.0 m"'
            hint = f"write {{{name}}} for the number of the loop" if counts else hint
            self.error(place, f'unknown variable "{name}"', hint)
        elif len(nodes) > 1:
            lines = " and ".join(str(self.where(v).line) for v in nodes)
            self.error(place, f'variable "{name}" is not unique: defined in lines {lines}')
        elif name not in self._values:
            line = self.where(nodes[0]).line
            self.error(place, f'variable "{name}" is defined later, in line {line}')
        return len(nodes) == 1 and name in self._values

    def _read(self, node: SyntaxNode, kind: PlanDimension) -> float:
        text = node.number
        if node.variable:
            if not self._is_defined(node.variable, node):
                return math.nan
            dimension, value = self._values[node.variable]
            text = self._nodes[node.variable][0].number or node.variable
        elif node.sum:
            dimension, value = self._value_of(node)
            text = self._written(node)
        else:
            unit = node.unit or ("m" if kind == "length" else "rad")
            dimension, value = read_unit(unit)[1], to_si(float(node.number), unit)
        if math.isnan(value):
            return value
        if NAMES.get(dimension) != kind:
            self._report_kind(node, kind, dimension)
            return math.nan
        if abs(value) > LARGEST:
            self.error(node, f"{text} is too large", "the limit is 1000 km")
            return math.nan
        if kind == "angle" and node.number and not node.unit and abs(value) > math.tau:
            hint = f'write "{node.number} deg" for degrees'
            self.warning(node, f"{node.number} without a unit means radians", hint)
        return -value if node.negated else value

    def _report_kind(self, node: SyntaxNode, kind: PlanDimension, dimension: Dimension) -> None:
        wrong = f'not "{node.number} {node.unit}"'
        if node.variable:
            unit = self._nodes[node.variable][0].unit or dimension.unit
            wrong = f'but variable "{node.variable}" is in {unit}'
        elif node.sum:
            unit = "has no unit" if dimension == RATIO else f"is in {dimension.unit}"
            wrong = f'but "{self._written(node)}" {unit}'
        self.error(node, f"expected {with_article(kind)}, {wrong}", _UNIT_ADVICE[kind])


_ALLOWED: Final = {
    "space": {"wrt", "of", "translation", "rotation", "spaced", "not aligned"},
    "column": {"wrt", "translation", "rotation"},
    "divider": {"wrt", "translation", "rotation"},
    "entryway": {"in", "translation", "rotation"},
    "window": {"in", "translation", "rotation"},
}
_NEEDED: Final = {
    "space": ("wrt", "of"),
    "column": ("wrt",),
    "divider": ("wrt",),
    "entryway": ("in",),
    "window": ("in",),
}
_EXAMPLE: Final = {
    "wrt": 'say what it is placed against: "wrt: world", "wrt: hall" or "wrt: hall.walls[0]"',
    "of": 'say which own frame is placed: "of: this" or "of: this.walls[0]"',
    "in": 'say which walls it cuts: "in: hall.walls[0]" or "in: hall.walls[0] and room.walls[2]"',
}
# Things on the floor move along x and y and turn about z; openings move in the plane of their wall,
# x and z, and turn about y.
_IN_FLOOR: Final = {"translation": "xy", "rotation": "z"}
_IN_WALL: Final = {"translation": "xz", "rotation": "y"}


@dataclass(frozen=True, slots=True)
class Location:
    """Written parts of a location: syntax nodes by keyword, values by name in ``offset``.

    Names are ``translation.x`` and so on; components that are not written are 0.
    """

    parts: dict[str, SyntaxNode]
    offset: dict[str, float]

    def get(self, name: str) -> float:
        """Return a component such as ``translation.x`` [m or rad]."""
        return self.offset.get(name, 0.0)

    def __contains__(self, part: str) -> bool:
        return part in self.parts


def read_location(element: SyntaxNode, kind: str, reader: ElementReader) -> Location:
    """Return the location of an element; report wrong and missing parts."""
    parts: dict[str, SyntaxNode] = {}
    offset: dict[str, float] = {}
    for node in element.parts:
        key = " ".join(node.key.split())
        if key not in _ALLOWED[kind]:
            needed = " and ".join(_NEEDED[kind])
            reader.error(node, f'{with_article(kind)} has no "{key}"', f"it is placed by {needed}")
        elif key in parts:
            reader.error(node, f'"{key}" is given twice')
        else:
            parts[key] = node
            if key in ("translation", "rotation"):
                _read_vector(node, key, kind, offset, reader)
    for key in _NEEDED[kind]:
        if key not in parts:
            reader.error(
                element, f'{kind} "{element.name}" has no "{key}" in its location', _EXAMPLE[key]
            )
    return Location(parts, offset)


def _read_vector(
    node: SyntaxNode,
    key: str,
    kind: str,
    offset: dict[str, float],
    reader: ElementReader,
) -> None:
    """Read the components of a translation or rotation; those out of its plane must be 0."""
    free = (_IN_WALL if kind in ("entryway", "window") else _IN_FLOOR)[key]
    for component in node.components:
        name = f"{key}.{component.axis}"
        read = reader.length if key == "translation" else reader.angle
        value = read(component.value)
        if name in offset:
            reader.error(component, f'"{component.axis}" is given twice in this {key}')
        elif abs(value) > 0.0 and component.axis not in free:
            allowed = " and ".join(free)
            reader.error(
                component,
                f"the {key} of {with_article(kind)} about {component.axis} must be 0"
                if key == "rotation"
                else f"the {key} of {with_article(kind)} along {component.axis} must be 0",
                f"only {allowed} can be given",
            )
        # "-0 m" becomes 0.
        offset[name] = value or 0.0
