"""Small floor plans and layers that several tests use."""

from pathlib import Path

import numpy as np

from grammars.floorplan import parse_floorplan
from grammars.scenery import parse_scenery
from grammars.scenery.composition import compile_scene, resolve_behaviours
from grammars.variation import parse_variation, sample
from templates.world import ArtefactWorld

HERE = Path(__file__).parent

DOOR = """
object hinged_door
    link post  box 5 cm x 5 cm  from 0 m to 1.95 m, mass 100 kg
    link leaf  box 0.05 m x 0.93 m at (0 m, 0.5 m) from 0.005 m to 1.945 m, mass 20 kg
    joint hinge revolute from post to leaf at (-0.025 m, 0.025 m), between 0 rad and 2 rad,
        friction 0.5 N m, closer 2 N m/rad damped by 1 N m s/rad to 0 rad
    state closed: hinge 0 rad
    state ajar:   hinge 30 deg
    state open:   hinge 1.7 rad
"""

SLIDER = """
object slider
    link panel  box 1.1 m x 4 cm  from 1 cm to 2 m, mass 20 kg
    joint rail prismatic from world to panel along -x, between 0 m and 1 m, friction 5 N
    state closed: rail 0 m
    state open:   rail 1 m
"""

LIFT = """
object lift_door
    link left_panel   box 0.5 m x 4 cm at (-0.25 m, 0 m)  from 0 m to 2 m, mass 10 kg
    link right_panel  box 0.5 m x 4 cm at (0.25 m, 0 m)   from 0 m to 2 m, mass 10 kg
    joint left prismatic from world to left_panel along -x, between 0 m and 0.5 m
    joint right prismatic from world to right_panel along x, between 0 m and 0.5 m
    state closed: left 0 m, right 0 m
    state open: left 0.5 m, right 0.5 m
"""

PEOPLE = """
mover person
    link body  circle radius 25 cm  from 0 m to 1.7 m, mass 75 kg
    link hat   box 30 cm x 20 cm    from 1.7 m to 1.8 m, mass 200 g
    joint neck fixed from body to hat
object table
    link top   box 1.2 m x 0.8 m      from 70 cm to 74 cm, mass 20 kg
    link foot  cylinder radius 20 cm  from 0 m to 70 cm, mass 10 kg
    joint glue fixed from top to foot

visitor is a person in hall, x 1 m
table_1 is a table in kitchen, x 1 m, y 0.5 m, turned 30 deg
visitor walks along (1 m, 0 m), (3 m, 0 m) of hall, at 0.8 m/s, back and forth, pausing 2 s,
    yielding within 1 m
"""

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


HOUSE = (HERE / "models" / "house.fpm").read_text("utf-8")
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
