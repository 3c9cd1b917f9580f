"""Composition: a floor plan and scenery layers become one world, sentences become behaviours.

Layers meet here by name and nowhere else; what does not fit together is reported with both places.
"""

from grammars.composition.behaviours import ResolvedBehaviours, resolve_behaviours
from grammars.composition.compiler import compile_scene
from grammars.composition.outline import static_segments

__all__ = ["ResolvedBehaviours", "compile_scene", "resolve_behaviours", "static_segments"]
