"""Sentences become concrete behaviours, walks and events; chance is drawn here, reproducibly."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Behaviour, Hold, Jump
from grammars.preflight._behaviours import check_times
from grammars.preflight._checked import CheckedScene
from grammars.scenery import configure
from grammars.scenery.composition import compile_scene
from grammars.scenery.composition._catalogue import Catalogue
from grammars.scenery.composition._chance import RandomWaits
from grammars.text import codec
from grammars.text.diagnostics import InputError, Where
from tests.languages.plans import (
    PEOPLE,
    answers,
    behaviours_of,
    layer,
    resolved,
    scene_with,
    two_rooms,
)
from tests.scene.composition.test_sentences import line

DOORS = """
a is a hinged_door at kitchen_doorway, x -0.475 m, y 0.2 m, turned -90 deg
b is a hinged_door in way_out, hinge left, opening inwards
c is a slider at hall
l is a lift_door in kitchen_doorway
"""
VISITED = DOORS + PEOPLE[: PEOPLE.index("visitor walks")]
TOGGLE = (
    "every hinged_door toggles between closed and open every 30 s from 90 s until 720 s, "
    "with probability 0.5, up to 10 s late in steps of 1 s, by jump"
)


def one(*sentences, objects=VISITED, **options):
    (behaviour,) = behaviours_of(objects, *sentences, **options)
    return behaviour


def times_of(frames):
    return [frame.time for frame in frames.frames]


def test_groups_of_groups_are_read_once_each():
    groups = "".join(f"group g{k}: every g{k - 1}, g{k - 1}\n" for k in range(1, 60))
    text = f"group g0: every slider\n{groups}every g59 stays at 20 cm"
    assert behaviours_of(DOORS, text) == (Hold("c.rail", 0.2),)


# Chance.


def test_the_seed_decides_and_every_door_has_its_own_chance():
    once, again = behaviours_of(DOORS, TOGGLE, seed=3), behaviours_of(DOORS, TOGGLE, seed=3)
    assert once == again
    assert once != behaviours_of(DOORS, TOGGLE, seed=4)
    a, b = once
    assert times_of(a) != times_of(b)
    # Another door changes no other draw: a draw depends on the name of the joint alone.
    more = "z is a hinged_door at kitchen\n" + DOORS + "y is a hinged_door at hall, y 1 m\n"
    drawn = {b.joint: b for b in behaviours_of(more, TOGGLE, seed=3)}
    assert all(drawn[b.joint] == b for b in once)
    alone, every = (
        behaviours_of(DOORS, f"{doors} toggles between closed and open after exponential mean 9 s")
        for doors in ("a", "every hinged_door")
    )
    assert alone == every[:1]
    assert times_of(every[0]) != times_of(every[1])


def test_the_draw_of_a_seed_never_changes():
    a, b = behaviours_of(DOORS, TOGGLE, seed=2024)
    assert (a.joint, a.motion, b.joint) == ("a.hinge", Jump(), "b.hinge")
    assert [(frame.time, frame.position) for frame in a.frames] == [
        (0.0, 0.0), (306.0, 1.7), (665.0, 0.0), (697.0, 1.7)
    ]  # fmt: skip
    assert {(time - 90.0) % 30.0 in range(11) for time in times_of(b)[1:]} == {True}


def test_probability_and_lateness_do_not_disturb_each_other():
    for probability, frames in (("0 %", 1), ("100 %", 1 + 22)):
        (a, _) = behaviours_of(DOORS, TOGGLE.replace("0.5", probability))
        assert len(a.frames) == frames
    # The first draw comes after one period unless something else is said.
    always = "a toggles between closed and open every 20 s, with probability 100 %"
    assert times_of(one(always, limit=60.0)) == [0.0, 20.0, 40.0, 60.0]


@pytest.mark.parametrize(
    ("kind", "second", "mean", "spread"),
    [
        ("uniform", 40.0, 25.0, 30.0 / math.sqrt(12)),
        ("exponential", 0.0, 10.0, 10.0),
        ("normal", 2.0, 10.0, 2.0),
    ],
)
def test_waiting_times_follow_their_distribution(kind, second, mean, spread):
    pauses = RandomWaits(kind, 10.0, second, 5.0, 30_000.0)
    frames = pauses.draw(np.random.SeedSequence(1), 0.0, 1.0)
    waits = np.diff([5.0, *(frame.time for frame in frames[1:])])
    assert np.mean(waits) == pytest.approx(mean, rel=0.1)
    assert np.std(waits) == pytest.approx(spread, rel=0.1)
    assert [f.position for f in frames[:4]] == [0.0, 1.0, 0.0, 1.0]


@given(
    st.one_of(
        st.builds(
            "every {:.6f} s from {:.6f} s with probability {:.6f}, up to 0.9 s late".format,
            *(st.floats(1, 60), st.floats(3, 100), st.floats(0, 1)),
        ),
        st.sampled_from(
            ["uniform 0 s to 2 s", "exponential with mean 1 s", "normal mean 1 s and deviation 3 s"]
        ).map("after {} from 3 s until 50 s".format),
    ),
    st.integers(0, 2**63),
)
def test_changes_are_in_order_and_end_with_the_run(words, seed):
    times = times_of(one(f"a toggles between closed and open {words}", seed=seed, limit=40.0))
    assert times[0] == 0.0
    assert all(3.0 <= time <= 40.0 for time in times[1:])
    assert all(b - a >= 0.009 for a, b in itertools.pairwise(times))


# Layers.

OPEN, CLOSED = (f"every hinged_door stays {state}" for state in ("open", "closed"))
REACT = (
    "group chosen: every front\nparameter near = 1 m\n"
    "all chosen go from open to closed when the robot is within near of their leaf"
)
EAST, NORTH = (f"visitor walks along (0 m, 0 m), {to}" for to in ("(1 m, 0 m)", "(0 m, 1 m)"))
SOME = ["group some: a", "group some: b", "every some stays open"]
LAYERS = {
    "later layers win and say so": [DOORS, OPEN, "a stays closed"],
    "a sentence that replaces another for several joints says so once": [DOORS, OPEN, CLOSED],
    "a later layer gives another walk": [VISITED, EAST, NORTH],
    "groups reach across layers": [f"{DOORS}group front: a", REACT],
    "words of a scene in a layer without models": [DOORS, "a starts open\nb is frozen"],
    "a group of one name in two layers must not be guessed": [DOORS, *SOME],
    "one's own group is meant": [DOORS, *SOME[:2], f"group some: c\n{SOME[2]}"],
}


def layers_of(texts):
    return [layer(text, f"layer_{n}", models=n == 0) for n, text in enumerate(texts)]


def test_layers_of_behaviours(golden):
    """``layers.txt``: what several layers tell, what is overridden, who says what."""
    lines = []
    for name, texts in LAYERS.items():
        layers = layers_of(texts)
        lines.append(f"--- {name}")
        try:
            found = resolved(compile_scene(two_rooms(), layers), layers)
        except InputError as refusal:
            lines.append(str(refusal))
            continue
        lines += [line(codec.to_plain(one, Behaviour)).rstrip() for one in found.behaviours]
        lines += [str(one) for one in found.warnings]
        lines += [f"{who} at {where}" for who, where in found.places]
    golden("layers.txt", "\n".join(lines) + "\n")


def test_a_campaign_may_change_groups_and_parameters_of_layers():
    layers = layers_of(LAYERS["groups reach across layers"])
    scene = compile_scene(two_rooms(), layers[:1])

    changed = [layers[0], configure(layers[1], {"chosen": ["b"], "near": "50 cm"})]
    (b,) = resolved(scene, changed).behaviours
    assert (b.joint, b.distance, b.of) == ("b.hinge", 0.5, "leaf")


def test_frames_are_kept_only_where_something_walks():
    assert scene_with(DOORS).frames == ()
    frames = dict(scene_with(VISITED).frames)
    assert {"hall", "hall.walls[3]", "kitchen.pillar", "kitchen_doorway"} <= set(frames)


def said_of(sentences):
    """Return the warnings about sentences of one layer, in a run of 60 s."""
    layers = [layer(VISITED), layer(sentences, "then", models=False)]
    if sentences.startswith("object"):
        layers = [layer(VISITED + sentences)]
    scene = compile_scene(two_rooms(), layers)
    found = resolved(scene, layers, limit=60.0)
    checked = CheckedScene(scene, dict(found.places), Where("task.yaml"), found.behaviours)
    check_times(checked, 60.0)
    empty = Catalogue(layers).unknown_members()
    said = dict.fromkeys((*found.warnings, *checked.findings.all, *empty))
    return " | ".join(f"{one.message} ({one.hint})" for one in said) or "nothing"


def test_what_does_nothing_in_a_run_is_warned_of(golden):
    golden("idle.txt", answers("../scene/composition/idle.txt", said_of))
