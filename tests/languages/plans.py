"""Small floor plans and layers for tests of composition and pre-flight."""

import numpy as np

from grammars.floorplan import parse_floorplan
from grammars.scenery import parse_scenery
from grammars.scenery.composition import compile_scene, resolve_behaviours
from templates.world import ArtefactWorld
from tests.languages.scenery.samples import DOOR, LIFT, SLIDER

MODELS = DOOR + SLIDER + LIFT

# hall: x -5..5, y -2..2, its wall 0 looks north to the kitchen at y 2.4..5.4
TWO_ROOMS = """
Floor plan: two_rooms
Defaults:
    walls: thickness: 0.2 m height: 2.5 m
Space hall:
    shape: Rectangle width=10 m, length=4 m
    location: wrt: world of: this
Space kitchen:
    shape: Rectangle width=4 m, length=3 m
    location: wrt: hall.walls[0] of: this.walls[2] spaced
    features:
        Column pillar:
            shape: Rectangle width=0.3 m, length=0.3 m
            height: 2 m
            location: wrt: this translation: x: 1 m, y: 0.5 m
Entryway kitchen_doorway:
    shape: Rectangle width=1 m, height=2 m
    location: in: hall.walls[0] and kitchen.walls[2] translation: x: 0.5 m, z: 1 m
Entryway way_out:
    shape: Rectangle width=1.2 m, height=2.1 m
    location: in: hall.walls[2] translation: z: 1.05 m
Window hall_window:
    shape: Rectangle width=2 m, height=1 m
    location: in: hall.walls[3] translation: z: 1.5 m
"""


def two_rooms(*changes):
    """Return the plan, with some of its words replaced by others."""
    text = TWO_ROOMS
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return parse_floorplan(text, "two_rooms.fpm")


def layer(text, name="objects", models=True):
    """Return a layer of ``text``, with the models of the samples in front."""
    return parse_scenery((MODELS if models else "") + text, f"{name}.scenery")


def world_of(plan, layers=()):
    """Return the world of a plan and layers, as exports get it."""
    return ArtefactWorld(plan.name, compile_scene(plan, layers), plan, layers=tuple(layers))


def scene_with(text):
    """Return the two rooms with objects."""
    return compile_scene(two_rooms(), [layer(text)])


def resolved(scene, layers, seed=1, limit=1200.0):
    """Resolve with a plain seed."""
    return resolve_behaviours(scene, layers, seed=np.random.SeedSequence(seed), limit=limit)


def behaviours_of(objects, *sentences, **options):
    """Return the behaviours of one object layer and further layers."""
    layers = [layer(objects)]
    layers.extend(layer(s, f"layer_{i}", models=False) for i, s in enumerate(sentences))
    scene = compile_scene(two_rooms(), layers)
    limit = options.get("limit", 1200.0)
    return resolved(scene, layers, int(options.get("seed", 1)), limit).behaviours
