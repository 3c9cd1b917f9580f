"""Whatever layers say, composing them gives a scene or diagnostics, never a raw exception."""

import re

from hypothesis import given
from hypothesis import strategies as st

from grammars.model.scene import Scene
from grammars.preflight import check_scene
from grammars.scenery import parse_scenery
from grammars.scenery.composition import compile_scene, static_segments
from grammars.text import codec
from grammars.text.diagnostics import InputError
from tests.languages.plans import MODELS, resolved, two_rooms

PLAN = two_rooms()
SENTENCES = """
a is a hinged_door in kitchen_doorway, hinge left seen from hall, opening into kitchen
b is a hinged_door at hall.walls[1], x 1 m, y 0.1 m, turned 90 deg, starts ajar
c is a slider in way_out, sliding right, on the inside
d is a lift_door in way_out
group some: a, b
group more: every some except a
parameter near = 1.3 m
c starts open
all more toggle between closed and open every 30 s, with probability 0.5, up to 10 s late, by jump
a goes from ajar to closed when the robot is within near of its doorway, by spring of 0.5 N m/rad
c moves to open at 5 s, to 20 cm at 9 s, by servo at 0.3 m/s with 40 N
mover person link body circle radius 25 cm from 0 m to 1.7 m, mass 75 kg
    link hat box 5 cm x 8 cm from 1.7 m to 2 m, mass 100 g joint neck fixed from body to hat
p is a person in hall, x 1 m
p walks along (0 m, 0 m) of hall, (1 m, 0 m), (1 m, 1 m) of kitchen, round, yielding within 1 m
d.left goes from 50 cm to 0 m when p starts to move, after 2 s
d.right toggles between 0 m and 50 cm after uniform 10 s to 40 s
"""
WORDS = re.findall(r"\w+|[^\w\s]", SENTENCES)


def compose(text):
    try:
        layer = parse_scenery(MODELS + text, "fuzz.scenery")
        scene = compile_scene(PLAN, [layer])
        resolved(scene, [layer], limit=100.0)
    except InputError as error:
        assert all(d.message for d in error.findings)
        return
    check_scene(scene)
    assert codec.from_json(Scene, codec.to_json(scene)) == scene
    assert len(static_segments(scene, 0.3)[0]) > 0


def test_the_sentences_themselves_are_sound():
    layer = parse_scenery(MODELS + SENTENCES, "fuzz.scenery")
    scene = compile_scene(PLAN, [layer])
    assert len(resolved(scene, [layer]).behaviours) == 6


@given(st.integers(0, len(WORDS) - 1), st.sampled_from(WORDS))
def test_one_word_replaced(index, word):
    compose(" ".join([*WORDS[:index], word, *WORDS[index + 1 :]]))


@given(st.lists(st.sampled_from(SENTENCES.strip().splitlines()), max_size=8))
def test_sentences_in_any_order_and_number(lines):
    compose("\n".join(lines))
