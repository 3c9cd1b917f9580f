"""Sentences become concrete behaviours; chance is drawn here, reproducibly."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Hold, Jump, KeyFrame, KeyFrames, Servo, Spring, Trigger
from grammars.scenery.composition import compile_scene, resolve_behaviours
from grammars.text.diagnostics import InputError
from tests.languages.plans import behaviours_of, layer, resolved, scene_with, two_rooms

DOORS = """
a is a hinged_door at kitchen_doorway, x -0.475 m, y 0.2 m, turned -90 deg
b is a hinged_door in way_out, hinge left, opening inwards
c is a slider at hall
"""
TOGGLE = (
    "every hinged_door toggles between closed and open every 30 s from 90 s until 720 s, "
    "with probability 0.5, up to 10 s late in steps of 1 s, by jump"
)


def test_a_door_stays_where_it_is_told():
    assert behaviours_of(DOORS, "a stays open\nc stays at 20 cm") == (
        Hold("a.hinge", 1.7),
        Hold("c.rail", 0.2),
    )


def test_a_mirrored_door_turns_the_other_way():
    assert behaviours_of(DOORS, "b stays at 1.4 rad") == (Hold("b.hinge", -1.4),)


def test_a_door_moves_at_given_times():
    text = "parameter pace = 90 deg/s\na moves to closed at 0 s, to open at 1 min, by servo at pace"
    assert behaviours_of(DOORS, text) == (
        KeyFrames(
            "a.hinge", (KeyFrame(0.0, 0.0), KeyFrame(60.0, 1.7)), Servo(math.pi / 2, Servo().effort)
        ),
    )


def test_key_frames_as_listed_keep_the_order_of_the_list():
    text = "a moves to closed at 10 s, to 1 rad at 7 s, to open at 8 s, as listed, by jump"
    (found,) = behaviours_of(DOORS, text)
    frames = (KeyFrame(10.0, 0.0), KeyFrame(7.0, 1.0), KeyFrame(8.0, 1.7))
    assert found == KeyFrames("a.hinge", frames, Jump())
    in_order = "a moves to closed at 7 s, to open at 10 s"
    assert behaviours_of(DOORS, f"{in_order}, as listed") == behaviours_of(DOORS, in_order)


def test_a_state_of_several_joints_moves_them_all():
    lift = "l is a lift_door in kitchen_doorway"
    assert behaviours_of(lift, "l stays open") == (Hold("l.left", 0.5), Hold("l.right", 0.5))
    assert behaviours_of(lift, "l.right stays open") == (Hold("l.right", 0.5),)
    assert behaviours_of(lift, "l.right stays at 1 cm") == (Hold("l.right", 0.01),)


def test_a_door_reacts_to_the_robot():
    text = (
        "a goes from ajar to closed when the robot's footprint is within 1.3 m of its doorway, "
        "again beyond 2 m, by spring of 0.5 N m/rad damped by 0.1 N m s/rad"
    )
    assert behaviours_of(DOORS, text) == (
        Trigger(
            "a.hinge",
            pytest.approx(math.pi / 6),
            0.0,
            1.3,
            Spring(0.5, 0.1),
            "doorway",
            "footprint",
            2.0,
        ),
    )


def test_chance_is_drawn_into_key_frames():
    drawn = behaviours_of(DOORS, TOGGLE)
    assert [b.joint for b in drawn] == ["a.hinge", "b.hinge"]
    for behaviour in drawn:
        assert isinstance(behaviour, KeyFrames)
        assert behaviour.motion == Jump()
        first, *rest = behaviour.frames
        assert first == KeyFrame(0.0, 0.0)
        assert 5 <= len(rest) <= 18
        for i, frame in enumerate(rest):
            late = (frame.time - 90.0) % 30.0
            assert late in range(10)
            assert 90.0 <= frame.time <= 729.0
            assert abs(frame.position) == (1.7 if i % 2 == 0 else 0.0)


def test_the_seed_decides_and_every_door_has_its_own_chance():
    once, again = behaviours_of(DOORS, TOGGLE, seed=3), behaviours_of(DOORS, TOGGLE, seed=3)
    other = behaviours_of(DOORS, TOGGLE, seed=4)
    assert once == again
    assert once != other
    a, b = once
    assert isinstance(a, KeyFrames)
    assert isinstance(b, KeyFrames)
    assert [f.time for f in a.frames] != [f.time for f in b.frames]


def test_the_draw_of_a_seed_never_changes():
    (a, _) = behaviours_of(DOORS, TOGGLE, seed=2024)
    assert isinstance(a, KeyFrames)
    assert [f.time for f in a.frames] == RECORDED


RECORDED = [0.0, 306.0, 665.0, 697.0]


def test_another_door_changes_no_other_draw():
    more = "z is a hinged_door at kitchen\n" + DOORS + "y is a hinged_door at hall, y 1 m\n"
    drawn = {b.joint: b for b in behaviours_of(more, TOGGLE)}
    assert all(drawn[b.joint] == b for b in behaviours_of(DOORS, TOGGLE))


def test_probability_and_lateness_do_not_disturb_each_other():
    never = TOGGLE.replace("0.5", "0 %")
    always = TOGGLE.replace("0.5", "100 %")
    (a, _) = behaviours_of(DOORS, never)
    assert isinstance(a, KeyFrames)
    assert a.frames == (KeyFrame(0.0, 0.0),)
    (a, _) = behaviours_of(DOORS, always)
    assert isinstance(a, KeyFrames)
    assert len(a.frames) == 1 + 22


@given(st.integers(0, 2**63), st.floats(1, 60), st.floats(0, 1), st.floats(0, 100))
def test_drawn_frames_are_in_order_and_within_the_run(seed, period, share, since):
    text = (
        f"a toggles between ajar and open every {period:.6f} s from {since:.6f} s "
        f"with probability {share:.6f}, up to {period * 0.99:.6f} s late"
    )
    (a,) = behaviours_of(DOORS, text, seed=seed, limit=300.0)
    assert isinstance(a, KeyFrames)
    times = [f.time for f in a.frames]
    assert times == sorted(set(times))
    assert times[0] == 0.0
    assert times[-1] <= 300.0


def test_a_sentence_that_replaces_another_for_several_joints_says_so_once():
    layers = [
        layer(DOORS, "doors"),
        layer("every hinged_door stays open", "first", models=False),
        layer("every hinged_door stays closed", "second", models=False),
    ]
    result = resolved(compile_scene(two_rooms(), layers[:1]), layers)
    assert [d.message for d in result.overridden] == [
        "a.hinge and b.hinge follow this sentence, not the one at first.scenery:1:1"
    ]


def test_later_layers_win_and_say_so():
    doors, first, second = (
        layer(DOORS, "doors"),
        layer("every hinged_door stays open", "first", models=False),
        layer("a stays closed", "second", models=False),
    )
    scene = compile_scene(two_rooms(), [doors])
    result = resolved(scene, [doors, first, second])
    assert result.behaviours == (Hold("a.hinge", 0.0), Hold("b.hinge", -1.7))
    assert [str(d) for d in result.overridden] == [
        "second.scenery:1:1: warning: a.hinge follows this sentence, "
        "not the one at first.scenery:1:1"
    ]
    assert {joint: where.file for joint, where in result.places} == {
        "a.hinge": "second.scenery",
        "b.hinge": "first.scenery",
    }


def test_a_sentence_leaves_out_a_joint_that_another_of_its_layer_moves():
    assert len(behaviours_of(DOORS, "every hinged_door except a stays open\na stays closed")) == 2


def test_groups_reach_across_layers_and_a_campaign_may_change_them():
    doors = layer(DOORS + "group front: a", "doors")
    sentence = layer(
        "group chosen: every front\nparameter near = 1 m\n"
        "all chosen go from open to closed when the robot is within near of their leaf",
        "react",
        models=False,
    )
    scene = compile_scene(two_rooms(), [doors])
    assert [b.joint for b in resolved(scene, [doors, sentence]).behaviours] == ["a.hinge"]
    changed = resolve_behaviours(
        scene,
        [doors, sentence],
        seed=np.random.SeedSequence(1),
        limit=10.0,
        overrides={"react": {"chosen": ["b"], "near": "50 cm"}},
    )
    (b,) = changed.behaviours
    assert isinstance(b, Trigger)
    assert (b.joint, b.distance, b.of) == ("b.hinge", 0.5, "leaf")


def test_an_unknown_layer_in_the_overrides_is_reported():
    with pytest.raises(InputError, match='there is no layer "dors"\n    did you mean "doors"'):
        resolve_behaviours(
            scene_with(DOORS),
            [layer(DOORS, "doors")],
            seed=np.random.SeedSequence(1),
            limit=1.0,
            overrides={"dors": {}},
        )


def test_what_belongs_to_the_scene_is_not_lost_in_a_behaviour_layer():
    scene = scene_with(DOORS)
    late = layer("a starts open\nb is frozen", "late", models=False)
    with pytest.raises(InputError) as caught:
        resolved(scene, [layer(DOORS), late])
    assert str(caught.value) == (
        "late.scenery:1:1: a is not so in the scene\n"
        "    name this layer among the objects, not only among the behaviours\n"
        "late.scenery:2:1: b is not so in the scene\n"
        "    name this layer among the objects, not only among the behaviours"
    )
    more = layer("d is a slider at hall", "late", models=False)
    with pytest.raises(InputError, match=r"late.scenery:1:1: d does not stand in the scene"):
        resolved(scene, [layer(DOORS), more])
    together = [layer(DOORS), late]
    assert resolved(compile_scene(two_rooms(), together), together).behaviours == ()


def test_the_first_draw_comes_after_one_period_unless_something_else_is_said():
    (a,) = behaviours_of(
        DOORS, "a toggles between closed and open every 20 s, with probability 100 %", limit=60.0
    )
    assert isinstance(a, KeyFrames)
    assert [f.time for f in a.frames] == [0.0, 20.0, 40.0, 60.0]


def test_a_group_of_one_name_in_two_layers_must_not_be_guessed():
    layers = [
        layer(DOORS, "doors"),
        layer("group some: a", "one", models=False),
        layer("group some: b", "two", models=False),
        layer("every some stays open", "three", models=False),
    ]
    scene = compile_scene(two_rooms(), layers)
    with pytest.raises(InputError) as caught:
        resolved(scene, layers)
    assert str(caught.value) == (
        'three.scenery:1:7: "some" may mean several groups\n    one.scenery:1:1 and two.scenery:1:1'
    )
    own = [*layers[:3], layer("group some: c\nevery some stays open", "three", models=False)]
    assert [b.joint for b in resolved(scene, own).behaviours] == ["c.rail"]


def test_groups_leave_out_their_exceptions_and_name_joints_of_their_members():
    text = "group most: every hinged_door except b\nevery most.hinge stays open"
    assert behaviours_of(DOORS, text) == (Hold("a.hinge", 1.7),)


def test_a_servo_and_a_spring_may_take_parameters():
    text = (
        "parameter pull = 2 N m/rad\nparameter loss = 1 N m s/rad\nparameter pace = 1 rad/s\n"
        "parameter push = 9 N m\n"
        "a moves to open at 1 s by spring of pull damped by loss\n"
        "b moves to open at 1 s by servo at pace with push"
    )
    a, b = behaviours_of(DOORS, text)
    assert isinstance(a, KeyFrames)
    assert isinstance(b, KeyFrames)
    assert (a.motion, b.motion) == (Spring(2.0, 1.0), Servo(1.0, 9.0))


def test_groups_of_groups_are_read_once_each():
    groups = "".join(f"group g{k}: every g{k - 1}, g{k - 1}\n" for k in range(1, 60))
    text = f"group g0: every slider\n{groups}every g59 stays at 20 cm"
    assert behaviours_of(DOORS, text) == (Hold("c.rail", 0.2),)
