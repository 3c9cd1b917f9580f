"""Small floor plans and layers that several tests use."""

import re
from pathlib import Path

import numpy as np

from grammars.floorplan import parse_floorplan
from grammars.scenery import parse_scenery
from grammars.scenery.composition import compile_scene, resolve_behaviours
from grammars.variation import parse_variation, sample
from templates.world import ArtefactWorld

HERE = Path(__file__).parent


def model_text(name):
    """Return the text of a file in ``models``, behind an empty line."""
    return "\n" + (HERE / "models" / name).read_text("utf-8")


def answers(name, describe):
    """Return a table with what ``describe`` says today of the text before each arrow."""
    text = (HERE / name).read_text("utf-8")
    return re.sub(r"^(.+) => .*$", lambda row: f"{row[1]} => {describe(row[1])}", text, flags=re.M)


DOOR = model_text("door.scenery")
SLIDER = model_text("slider.scenery")
LIFT = model_text("lift.scenery")
PEOPLE = model_text("people.scenery")
TWO_ROOMS = model_text("two_rooms.fpm")


NAMED = {"hinged_door": DOOR, "slider": SLIDER, "lift_door": LIFT}

# hall: x -5..5, y -2..2, its wall 0 looks north to the kitchen at y 2.4..5.4


def two_rooms(*changes):
    """Return the plan, with some of its words replaced by others."""
    text = TWO_ROOMS
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return parse_floorplan(text, "two_rooms.fpm")


def layer(text, name="objects", models=True):
    """Return a layer of ``text``, with the models of the samples that it names in front."""
    named = (model for word, model in NAMED.items() if models and word in text)
    return parse_scenery("".join(named) + text, f"{name}.scenery")


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


HOUSE = model_text("house.fpm")[1:]
"""A plan that says everything variations may change, laid out in many ways."""


def vary(folder, statements, plan=HOUSE):
    """Return the variation of ``plan`` by ``statements``."""
    (folder / "plan.fpm").write_bytes(plan.encode())
    text = f'import "plan.fpm"\n{statements}'
    return parse_variation(text, "test.variation", folder)


def one_variant(folder, statements, plan=HOUSE, **options):
    """Return the variant of seed 7."""
    return sample(vary(folder, statements, plan), 1, seed=7, **options)[0]


def numbers(variant):
    """Return the values of a variant by their names."""
    return {value.name: value.number for value in variant.values}
