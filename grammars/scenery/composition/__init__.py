"""Composition of a floor plan and scenery layers to a scene, and of sentences to behaviours.

Only this package connects layers, by name; it reports conflicts with both places.
"""

from grammars.scenery.composition._behaviours import ResolvedBehaviours, resolve_behaviours
from grammars.scenery.composition._building import static_segments
from grammars.scenery.composition._catalogue import Catalogue
from grammars.scenery.composition._chance import RandomWaits
from grammars.scenery.composition._compiler import compile_scene
from grammars.scenery.composition._placement import (
    ObjectPlacement,
    frame_named,
    height_problem,
    mirrored_joints,
    mirrored_links,
    place_instance,
)
from grammars.scenery.composition._rings import convex_rings, is_convex

__all__ = [
    "Catalogue",
    "ObjectPlacement",
    "RandomWaits",
    "ResolvedBehaviours",
    "compile_scene",
    "convex_rings",
    "frame_named",
    "height_problem",
    "is_convex",
    "mirrored_joints",
    "mirrored_links",
    "place_instance",
    "resolve_behaviours",
    "static_segments",
]
