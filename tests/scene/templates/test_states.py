"""The named states of things, as maps show them one by one."""

from grammars.scenery.composition import compile_scene
from templates.world import named_states
from tests.languages.plans import layer, two_rooms
from tests.scene.templates.worlds import scene

THINGS = """
a is a hinged_door at kitchen_doorway, x -0.475 m, y 0.2 m, turned -90 deg
b is a hinged_door in way_out, hinge left, opening inwards
c is a slider at hall
"""


def test_a_state_holds_for_all_that_have_it_and_mirrored_doors_turn_the_other_way():
    things = layer(THINGS)
    made = compile_scene(two_rooms(), [things])
    assert [thing.mirrored for thing in made.objects] == [False, True, False]
    states = {name: dict(positions) for name, positions in named_states(made, [things])}
    assert states["open"] == {"a.hinge": 1.7, "b.hinge": -1.7, "c.rail": 1.0}
    assert states["closed"] == {"a.hinge": 0.0, "b.hinge": 0.0, "c.rail": 0.0}


def test_things_without_a_model_have_no_states():
    assert named_states(scene(), []) == ()
    assert named_states(scene(), [layer(THINGS)]) == ()
