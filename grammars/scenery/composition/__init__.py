"""Composition of a floor plan and scenery layers to a scene, and of sentences to behaviours.

Only this package connects layers, by name; it reports conflicts with both places.
"""

from grammars.scenery.composition._behaviours import ResolvedBehaviours, resolve_behaviours
from grammars.scenery.composition._building import static_segments
from grammars.scenery.composition._catalogue import Catalogue
from grammars.scenery.composition._compiler import compile_scene
from grammars.scenery.composition._placement import (
    height_problem,
    mirrored_joints,
    mirrored_links,
    place_instance,
)

__all__ = [
    "Catalogue",
    "ResolvedBehaviours",
    "compile_scene",
    "height_problem",
    "mirrored_joints",
    "mirrored_links",
    "place_instance",
    "resolve_behaviours",
    "static_segments",
]
