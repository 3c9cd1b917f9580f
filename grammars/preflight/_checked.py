"""A scene under check, and where the things it is made of were written."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from shapely.geometry.base import BaseGeometry

from grammars.floorplan import FloorPlan
from grammars.model.free_space import FreeSpace, SolidIndex, valid_polygon
from grammars.model.scene import Scene
from grammars.scenery import SceneryLayer
from grammars.text.diagnostics import Where


def places_of(layers: Iterable[SceneryLayer], plan: FloorPlan | None = None) -> dict[str, Where]:
    """Return the place of every object by its name, and of the entryways of ``plan``."""
    places = {o.name: o.where for o in plan.openings} if plan is not None else {}
    places.update((i.name, i.where) for layer in layers for i in layer.instances)
    return places


@dataclass(frozen=True)
class CheckedScene:
    """A scene under check: its solids, searchable, and where its things were written.

    ``places`` are those of objects, entryways and joints by name, ``home`` that of the rest.
    """

    scene: Scene
    places: Mapping[str, Where]
    home: Where

    @functools.cached_property
    def obstacles(self) -> SolidIndex:
        """The walls, columns and dividers."""
        return _solid_index(self.scene)

    @functools.cached_property
    def floors(self) -> Sequence[BaseGeometry]:
        """The floor of every space, then that of every doorway."""
        return _floors(self.scene)

    def place(self, name: str) -> Where:
        """Return the place of a joint, else of its object, else of everything."""
        owner = name.partition(".")[0]
        return self.places.get(name) or self.places.get(owner) or self.home


# Scenarios and the points of a search share their scene: what follows from it alone is made once.


@functools.lru_cache(maxsize=4)
def _solid_index(scene: Scene) -> SolidIndex:
    return SolidIndex(scene)


@functools.lru_cache(maxsize=4)
def _floors(scene: Scene) -> tuple[BaseGeometry, ...]:
    rings = [r.outline for r in scene.regions] + [d.footprint for d in scene.doorways]
    return tuple(valid_polygon(ring) for ring in rings)


@functools.lru_cache(maxsize=4)
def free_space(scene: Scene, height: float) -> FreeSpace:
    """Return the free floor below ``height`` [m], which all missions of a scene have in common."""
    return FreeSpace(scene, height)
