"""Locations: the parts a person wrote, checked against what the element may have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from grammars.floorplan._source import Findings, Node, with_article
from grammars.floorplan._values import Quantities

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
_IN_FLOOR: Final = {"translation": "xy", "rotation": "z"}
_IN_WALL: Final = {"translation": "xz", "rotation": "y"}


@dataclass(frozen=True, slots=True)
class Location:
    """The parts of a location; ``offset`` has the values per ``translation.x`` and so on.

    Components that are not written are 0. ``parts`` are the syntax nodes by keyword.
    """

    parts: dict[str, Node]
    offset: dict[str, float]

    def get(self, name: str) -> float:
        """Return a component such as ``translation.x`` [m or rad]."""
        return self.offset.get(name, 0.0)

    def __contains__(self, part: str) -> bool:
        return part in self.parts


def read_location(
    element: Node, kind: str, quantities: Quantities, findings: Findings
) -> Location | None:
    """Return the location of an element, or ``None`` when a needed part is missing.

    Broken components are reported and read as 0, so that the rest can be checked too.
    """
    parts: dict[str, Node] = {}
    offset: dict[str, float] = {}
    for node in element.parts:
        key = " ".join(node.key.split())
        if key not in _ALLOWED[kind]:
            needed = " and ".join(_NEEDED[kind])
            findings.error(
                node, f'{with_article(kind)} has no "{key}"', f"it is placed by {needed}"
            )
        elif key in parts:
            findings.error(node, f'"{key}" is given twice')
        else:
            parts[key] = node
            if key in ("translation", "rotation"):
                _read_vector(node, key, kind, offset, quantities, findings)
    for key in _NEEDED[kind]:
        if key not in parts:
            findings.error(
                element, f'{kind} "{element.name}" has no "{key}" in its location', _EXAMPLE[key]
            )
    complete = all(key in parts for key in _NEEDED[kind])
    return Location(parts, offset) if complete else None


def _read_vector(
    node: Node,
    key: str,
    kind: str,
    offset: dict[str, float],
    quantities: Quantities,
    findings: Findings,
) -> None:
    """Read the components of a translation or rotation; axes out of its plane must be 0."""
    free = (_IN_WALL if kind in ("entryway", "window") else _IN_FLOOR)[key]
    for component in node.components:
        name = f"{key}.{component.axis}"
        read = quantities.length if key == "translation" else quantities.angle
        value = read(component.value)
        if name in offset:
            findings.error(component, f'"{component.axis}" is given twice in this {key}')
        elif value and component.axis not in free:
            allowed = " and ".join(free)
            findings.error(
                component,
                f"the {key} of {with_article(kind)} about {component.axis} must be 0"
                if key == "rotation"
                else f"the {key} of {with_article(kind)} along {component.axis} must be 0",
                f"only {allowed} can be given",
            )
        offset[name] = value or 0.0
