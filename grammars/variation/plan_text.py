"""The text of a plan: its elements by address, and its attributes as slots for values.

New values replace existing ones in the text, so comments, order and layout stay.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

from grammars.floorplan import parse_syntax, variables_of
from grammars.text.diagnostics import SourceText, SyntaxNode, rule_of
from grammars.text.expressions import Expression, Function, Name, read_expression
from grammars.text.loops import repeated
from grammars.text.parsing import without_comments
from grammars.text.units import to_si

Span: TypeAlias = tuple[int, int]

_REAL: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_DEFAULT_UNIT: Final = {"length": "m", "angle": "rad"}
_WALL: Final = {"defaults.wall.thickness": "thickness", "defaults.wall.height": "height"}
_AXES: Final = {
    "floor": {"translation": "xy", "rotation": "z"},
    "wall": {"translation": "xz", "rotation": "y"},
}


@dataclass(frozen=True, slots=True)
class Slot:
    """An attribute or variable as a place in the text of the plan.

    ``number`` is the span of the number (or of the variable or sum in its place), ``unit_at`` that
    of its unit. An attribute missing in the text has neither: it has a value but cannot vary;
    ``remedy`` is the text to add. ``unit`` applies to numbers without a unit. ``value`` is the
    current value in metres or radians, or an expression of variables.
    """

    name: str
    kind: str
    unit: str
    value: float | Expression
    number: Span | None = None
    unit_at: Span | None = None
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class PlanElement:
    """A space, feature or opening: ``address`` as in variations, ``kind`` in lower case."""

    address: str
    kind: str
    node: SyntaxNode

    @property
    def is_opening(self) -> bool:
        """True for entryways and windows, which are in a wall."""
        return self.kind in ("entryway", "window")

    def paths(self) -> list[str]:
        """Return the paths of all attributes that can vary."""
        axes = _AXES["wall" if self.is_opening else "floor"]
        location = [f"location.{part}.{axis}" for part in axes for axis in axes[part]]
        shape = [f"shape.{size}" for size in _sizes(self.node.shape)]
        if self.kind == "space":
            return [*shape, *location, *_WALL]
        return [*shape, *location] if self.is_opening else ["height", *shape, *location]


def _sizes(shape: SyntaxNode) -> dict[str, SyntaxNode]:
    sizes = {"Circle": ("radius",), "Rectangle": ("width", "length", "height")}
    names = sizes.get(rule_of(shape), ())
    return {name: node for name in names if (node := getattr(shape, name)) is not None}


class PlanText:
    """A plan as text; raises :class:`InputError` for syntax errors.

    ``elements`` maps addresses to their elements (a space and an opening may share a name),
    ``variables`` maps names to slots.
    """

    def __init__(self, text: str, file: str) -> None:
        self.source = repeated(SourceText(text, file))
        self.text = self.source.text
        self.bare = without_comments(self.text)
        self.newline = "\r\n" if "\r\n" in text else "\n"
        self.tree = parse_syntax(self.source)
        self.elements: dict[str, list[PlanElement]] = {}
        self.variables: dict[str, Slot] = {}
        tree = self.tree
        self._defaults: SyntaxNode = tree.defaults[-1] if tree.defaults else None
        for node, variable in zip(tree.variables, variables_of(tree, self.source), strict=True):
            self.variables[node.name] = self._variable(node, variable.dimension)
        for node in tree.spaces:
            self._add(node.name, "space", node)
            for feature in node.features:
                self._add(f"{node.name}.{feature.name}", feature.kind.lower(), feature)
        for node in (*tree.features, *tree.openings):
            self._add(node.name, node.kind.lower(), node)

    @property
    def name(self) -> str:
        """Name of the plan."""
        return str(self.tree.name)

    @property
    def name_at(self) -> Span:
        """Span of the name of the plan in the text."""
        colon = self.bare.index(":", self.tree._tx_position)
        start = self.bare.index(self.name, colon)
        return start, start + len(self.name)

    def _add(self, address: str, kind: str, node: SyntaxNode) -> None:
        elements = self.elements.setdefault(address, [])
        elements.append(PlanElement(address, kind, node))
        elements.sort(key=lambda element: element.node._tx_position)

    def _variable(self, node: SyntaxNode, kind: str) -> Slot:
        if node.sum:
            return self._sum(node.name, node.sum, kind)
        sign = self.bare.index("=", node._tx_position)
        number = _REAL.search(self.bare, sign)
        assert number is not None
        end = node._tx_position_end
        value = to_si(float(node.number), node.unit)
        unit_at = (end - len(node.unit), end)
        return Slot(node.name, kind, node.unit, value, number.span(), unit_at)

    def slot(self, element: PlanElement, path: str) -> Slot | None:
        """Return the slot of an attribute, or ``None`` for an unknown path."""
        if path not in element.paths():
            return None
        name = f"{element.address}.{path}"
        if path in _WALL:
            return self._wall_slot(element, name, _WALL[path])
        if path.startswith("location."):
            _, part, axis = path.split(".")
            return self._component_slot(element, name, part, axis)
        node = element.node.height if path == "height" else _sizes(element.node.shape)[path[6:]]
        return self._quantity(name, node, "length")

    def _sum(self, name: str, node: SyntaxNode, kind: str) -> Slot:
        span = (node._tx_position, node._tx_position_end)
        return Slot(name, kind, _DEFAULT_UNIT[kind], read_expression(node, self.source), span)

    def _quantity(self, name: str, node: SyntaxNode, kind: str) -> Slot:
        start, end = node._tx_position, node._tx_position_end
        if node.sum:
            return self._sum(name, node.sum, kind)
        if node.variable:
            unit = self.variables[node.variable].unit
            variable = Name(node.variable)
            value = Function("-", (variable,)) if node.negated else variable
            return Slot(name, kind, unit, value, (start, end))
        number = _REAL.match(self.bare, start)
        assert number is not None
        unit = node.unit or _DEFAULT_UNIT[kind]
        unit_at = (end - len(node.unit), end) if node.unit else None
        return Slot(name, kind, unit, to_si(float(node.number), unit), number.span(), unit_at)

    def _component_slot(self, element: PlanElement, name: str, part: str, axis: str) -> Slot:
        kind = "length" if part == "translation" else "angle"
        parts = {node.key: node for node in element.node.parts}
        vector = parts.get(part)
        for component in vector.components if vector else ():
            if component.axis == axis:
                return self._quantity(name, component.value, kind)
        remedy = f"{part}: {axis}: {'0 m' if kind == 'length' else '0 deg'}"
        return Slot(name, kind, _DEFAULT_UNIT[kind], 0.0, remedy=remedy)

    def _wall_slot(self, element: PlanElement, name: str, key: str) -> Slot:
        own = {d.key: d.value for d in element.node.dimensions}
        if key in own:
            return self._quantity(name, own[key], "length")
        shared = {d.key: d.value for d in self._defaults.dimensions}
        inherited = self._quantity(name, shared[key], "length")
        default = self.text[shared[key]._tx_position : shared[key]._tx_position_end]
        remedy = f"walls: {key}: {default}"
        return Slot(name, "length", "m", inherited.value, remedy=remedy)


@dataclass(frozen=True, slots=True)
class SlotValue:
    """A number for a slot; without a ``unit`` it is in the unit of the slot."""

    slot: Slot
    number: float
    unit: str = ""


def rewrite(plan: PlanText, settings: Iterable[SlotValue], *, name: str = "") -> str:
    """Return the text of ``plan`` with all settings and, if given, a new name."""
    replacements = [one for setting in settings for one in _replacements(setting)]
    if name:
        replacements.append((plan.name_at, name))
    pieces: list[str] = []
    at = 0
    for (start, end), new in sorted(replacements):
        pieces += (plan.text[at:start], new)
        at = end
    return "".join((*pieces, plan.text[at:]))


def _replacements(setting: SlotValue) -> list[tuple[Span, str]]:
    slot = setting.slot
    assert slot.number is not None
    if not isinstance(slot.value, float):
        return [(slot.number, f"{_text(setting)} {setting.unit or slot.unit}")]
    if not setting.unit:
        return [(slot.number, _text(setting))]
    if slot.unit_at is None:
        return [(slot.number, f"{_text(setting)} {setting.unit}")]
    return [(slot.number, _text(setting)), (slot.unit_at, setting.unit)]


def _text(setting: SlotValue) -> str:
    # The shortest text that reads back as the same number; + 0.0 turns -0.0 into 0.0.
    return repr(setting.number + 0.0)
