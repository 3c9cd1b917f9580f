"""What a sampled plan can be measured for in a ``require``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, TypeAlias

from grammars.floorplan import Feature, FloorPlan, Opening, Space
from grammars.variation._expressions import AREA, LENGTH, Dimension
from grammars.variation._plan import Element

Part: TypeAlias = Space | Feature | Opening
Measurement: TypeAlias = tuple[Dimension, Callable[[FloorPlan], float]]


def _area(part: Part) -> float:
    import shapely

    assert isinstance(part, Space)
    return float(shapely.Polygon(part.outline).area)


def _perimeter(part: Part) -> float:
    assert isinstance(part, Space)
    return sum(wall.length for wall in part.walls)


def _thickness(part: Part) -> float:
    assert isinstance(part, Space)
    return part.walls[0].thickness


def _height(part: Part) -> float:
    match part:
        case Space():
            return part.walls[0].height
        case Feature():
            return part.height
    return part.z_max - part.z_min


def _width(part: Part) -> float:
    assert isinstance(part, Opening)
    return part.width


def _depth(part: Part) -> float:
    assert isinstance(part, Opening)
    return part.depth


def _sill(part: Part) -> float:
    assert isinstance(part, Opening)
    return part.z_min


_OF_SPACES: Final = {
    "area": (AREA, _area),
    "perimeter": (LENGTH, _perimeter),
    "thickness": (LENGTH, _thickness),
    "height": (LENGTH, _height),
}
_OF_OPENINGS: Final = {
    "width": (LENGTH, _width),
    "height": (LENGTH, _height),
    "depth": (LENGTH, _depth),
    "sill": (LENGTH, _sill),
}
_OF_FEATURES: Final = {"height": (LENGTH, _height)}


def measures_of(element: Element) -> Mapping[str, tuple[Dimension, Callable[[Part], float]]]:
    """Return what can be measured on an element, by the word people write."""
    if element.is_opening:
        return _OF_OPENINGS
    return _OF_SPACES if element.kind == "space" else _OF_FEATURES


def measurement(element: Element, word: str) -> Measurement:
    """Return the dimension of a measure and how to take it."""
    dimension, take = measures_of(element)[word]
    return dimension, lambda plan: take(find_part(plan, element))


def distance(one: Element, other: Element) -> Measurement:
    """Return how to measure the shortest distance between two elements, seen from above [m]."""

    def take(plan: FloorPlan) -> float:
        import shapely

        a, b = (shapely.Polygon(_ring(find_part(plan, e))) for e in (one, other))
        return float(shapely.distance(a, b))

    return LENGTH, take


def find_part(plan: FloorPlan, element: Element) -> Part:
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
