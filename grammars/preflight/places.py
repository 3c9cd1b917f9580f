"""Where the things a scene is made of were written, for messages about them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from grammars.diagnostics import Where
from grammars.floorplan import FloorPlan
from grammars.scenery import SceneryLayer


def places_of(layers: Iterable[SceneryLayer], plan: FloorPlan | None = None) -> dict[str, Where]:
    """Return the place of every object by its name, and of the entryways of ``plan``."""
    places = {o.name: o.where for o in plan.openings} if plan is not None else {}
    places.update((i.name, i.where) for layer in layers for i in layer.instances)
    return places


def place_of(places: Mapping[str, Where], joint_or_object: str, otherwise: Where) -> Where:
    """Return the place of a joint, else of its object, else ``otherwise``."""
    body = joint_or_object.partition(".")[0]
    return places.get(joint_or_object) or places.get(body) or otherwise
