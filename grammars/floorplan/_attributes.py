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
    did_you_mean,
    with_article,
)
from grammars.text.units import NAMES, read_unit, to_si

LARGEST: Final = 1e6
"""Largest number of metres or radians in a plan."""
_UNIT_ADVICE: Final = {
    "length": "write a length, in m, cm or mm",
    "angle": "write an angle, in deg or rad",
}
PlanDimension: TypeAlias = Literal["length", "angle"]


class ElementReader(Findings):
    """Reader of the quantities of one plan: reports broken ones and reads them as NaN."""

    def __init__(self, source: SourceText) -> None:
        super().__init__(source)
        self._variables: dict[str, list[SyntaxNode]] = {}
        self._values: Mapping[str, float] = {}

    def define(self, variables: Sequence[SyntaxNode], values: Mapping[str, float]) -> None:
        """Define the variables of the plan; ``values`` [m or rad] replace the written ones."""
        self._values = values
        for variable in variables:
            self._variables.setdefault(variable.name, []).append(variable)
        for variable in variables:
            if kind_of(variable.unit) not in _UNIT_ADVICE:
                message = f'variable "{variable.name}" is in {variable.unit}'
                self.error(variable, message, "a plan has only lengths and angles")
        for name, nodes in self._variables.items():
            for node in nodes[1:]:
                first = self.where(nodes[0]).line
                self.warning(node, f'variable "{name}" is already defined in line {first}')

    def length(self, node: SyntaxNode) -> float:
        """Return a length in metres."""
        return self._read(node, "length")

    def angle(self, node: SyntaxNode) -> float:
        """Return an angle in radians."""
        return self._read(node, "angle")

    def _read(self, node: SyntaxNode, kind: PlanDimension) -> float:
        value = self._variable(node, kind) if node.variable else self._literal(node, node, kind)
        return -value if node.negated else value

    def _literal(self, node: SyntaxNode, place: SyntaxNode, kind: PlanDimension) -> float:
        unit = node.unit or ("m" if kind == "length" else "rad")
        if kind_of(unit) != kind:
            self.error(
                place,
                f'expected {with_article(kind)}, not "{node.number} {unit}"',
                _UNIT_ADVICE[kind],
            )
            return math.nan
        number, value = float(node.number), to_si(float(node.number), unit)
        if abs(value) > LARGEST:
            self.error(place, f"{node.number} is too large", "the limit is 1000 km")
            return math.nan
        if kind == "angle" and not node.unit and abs(number) > math.tau:
            self.warning(
                place,
                f"{node.number} without a unit means radians",
                f'write "{node.number} deg" for degrees',
            )
        return value

    def _variable(self, node: SyntaxNode, kind: PlanDimension) -> float:
        name = node.variable
        nodes = self._variables.get(name, [])
        if not nodes:
            hint = did_you_mean(name, self._variables) or f'define it: "var {name} = 1.0 m"'
            self.error(node, f'unknown variable "{name}"', hint)
            return math.nan
        if len(nodes) > 1:
            lines = " and ".join(str(self.where(v).line) for v in nodes)
            self.error(node, f'variable "{name}" is not unique: defined in lines {lines}')
            return math.nan
        variable = nodes[0]
        if kind_of(variable.unit) != kind:
            self.error(
                node,
                f'expected {with_article(kind)}, but variable "{name}" is in {variable.unit}',
                _UNIT_ADVICE[kind],
            )
            return math.nan
        return self._values[name] if name in self._values else self._literal(variable, node, kind)


def kind_of(unit: str) -> str:
    """Return the dimension of a unit, such as ``length``, or the unit itself if it has none."""
    return NAMES.get(read_unit(unit)[1], unit)


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
