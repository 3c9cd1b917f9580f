"""The named states of a scene's objects, as their layers define them."""

from __future__ import annotations

from collections.abc import Iterable

from grammars.scene import Scene
from grammars.scenery import SceneryLayer

States = tuple[tuple[str, tuple[tuple[str, float], ...]], ...]


def named_states(scene: Scene, layers: Iterable[SceneryLayer]) -> States:
    """Return every state name with the positions [rad or m] it gives by scene-wide joint name.

    Mirrored objects turn the other way round, as in the scene.
    """
    models = {model.name: model for layer in layers for model in layer.models}
    states: dict[str, dict[str, float]] = {}
    for thing in scene.objects:
        model = models.get(thing.model)
        if model is None:
            continue
        turning = {joint.name for joint in thing.joints if joint.kind == "revolute"}
        for state in model.states:
            for joint, position in state.positions:
                sign = -1.0 if thing.mirrored and joint in turning else 1.0
                states.setdefault(state.name, {})[f"{thing.name}.{joint}"] = sign * position + 0.0
    return tuple((name, tuple(positions.items())) for name, positions in states.items())
