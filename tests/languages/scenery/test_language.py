import math
import re

import pytest

import grammars.scenery
from grammars.editor.oracles import literals
from grammars.scenery import load_scenery, parse_scenery
from grammars.scenery.measure import Measure
from grammars.scenery.model import At, Goes, In, Moves, Stays, Toggles, Word
from grammars.text.diagnostics import InputError, Where
from tests.languages.scenery.samples import BEHAVIOUR, DOOR, EVERYTHING, LIFT, PLACED, SLIDER


@pytest.mark.parametrize(("share", "value"), [("35 %", 0.35), ("7 %", 0.07), ("0.35", 0.35)])
def test_a_share_in_percent_is_the_number_one_would_write(share, value):
    text = f"d toggles between a and b every 3 s with probability {share}"
    (toggles,) = parse_scenery(text, "d.scenery").sentences
    assert toggles.probability == value


def test_an_object_model_has_links_joints_and_states():
    model = parse_scenery(DOOR, "doors.scenery").models[0]
    post, leaf = model.links
    assert model.name == "hinged_door"
    assert post.polygons == (((-0.025, -0.025), (0.025, -0.025), (0.025, 0.025), (-0.025, 0.025)),)
    assert (leaf.mass, leaf.z_min, leaf.z_max) == (20.0, 0.005, 1.945)
    joint = model.joints[0]
    assert (joint.kind, joint.parent, joint.child) == ("revolute", "post", "leaf")
    assert (joint.anchor, joint.lower, joint.upper) == ((-0.025, 0.025), 0.0, 2.0)
    assert (joint.friction, joint.stiffness, joint.damping, joint.rest) == (0.5, 2.0, 1.0, 0.0)
    assert [(s.name, s.positions) for s in model.states] == [
        ("closed", (("hinge", 0.0),)),
        ("ajar", (("hinge", pytest.approx(math.radians(30))),)),
        ("open", (("hinge", 1.7),)),
    ]


def test_a_prismatic_joint_moves_along_a_signed_axis_or_a_direction():
    assert parse_scenery(SLIDER, "s").models[0].joints[0].axis == (-1.0, 0.0)
    turned = parse_scenery(SLIDER.replace("along -x", "along 90 deg"), "s").models[0].joints[0]
    assert turned.axis == pytest.approx((0.0, 1.0))


def test_links_may_have_circles_polygons_and_several_shapes():
    text = """
    object cone
        link body polygon (0 m, 0 m), (0 m, 1 m), (1 m, 0 m) and circle radius 10 cm at (2 m, 0 m)
            and box 1 m x 2 m turned 90 deg from 0 m to 1 m, mass 1 kg
    """
    triangle, circle, box = parse_scenery(text, "s").models[0].links[0].polygons
    assert triangle == ((1.0, 0.0), (0.0, 1.0), (0.0, 0.0))
    assert all(math.dist(p, (2.0, 0.0)) == pytest.approx(0.1) for p in circle)
    assert max(x for x, _ in box) == pytest.approx(1.0)


def test_instances_stand_in_frames_or_in_entryways():
    layer = parse_scenery(DOOR + SLIDER + LIFT + PLACED, "doors.scenery")
    kitchen, store, spare, lift = layer.instances
    assert isinstance(kitchen.place, In)
    assert (kitchen.place.manner, kitchen.place.side, kitchen.place.towards) == (
        "hinge",
        "left",
        "in",
    )
    assert isinstance(store.place, In)
    assert (store.place.manner, store.place.side, store.place.towards) == (
        "sliding",
        "right",
        "out",
    )
    assert store.frozen
    assert isinstance(spare.place, At)
    assert str(spare.place.frame) == "hall.walls[1]"
    assert (spare.place.x, spare.place.y, spare.place.yaw) == (0.2, 0.1, -math.pi / 2)
    assert str(spare.starts) == "ajar"
    assert isinstance(lift.place, In)
    assert lift.place.manner == ""


def test_sentences_say_what_joints_do():
    toggles, goes, moves, stays = parse_scenery(BEHAVIOUR, "b.scenery").sentences
    assert isinstance(toggles, Toggles)
    assert toggles.probability == pytest.approx(0.4)
    assert isinstance(toggles.until, Measure)
    assert toggles.until.value == 720.0
    assert isinstance(goes, Goes)
    assert (goes.of, goes.to, goes.motion.kind) == ("doorway", "footprint", "spring")
    assert isinstance(goes.distance, Word)
    assert isinstance(moves, Moves)
    assert [str(position) for position, _ in moves.frames] == ["open", "closed"]
    assert isinstance(stays, Stays)
    assert str(stays.subject) == "lift.left"


def test_line_breaks_and_comments_carry_no_meaning():
    one_line = " ".join(line.split("//")[0] for line in EVERYTHING.splitlines())
    assert parse_scenery(one_line, "s.scenery") == parse_scenery(
        EVERYTHING.replace("\n", " // remark\n"), "s.scenery"
    )


def test_plural_and_singular_mean_the_same():
    one = parse_scenery("every door stays open", "s").sentences[0]
    all_of_them = parse_scenery("all door stay open", "s").sentences[0]
    assert one == all_of_them


def test_everything_knows_its_place():
    layer = parse_scenery("\n\n  door_1 stays at 1 rad\n", "some/layer.scenery")
    assert layer.sentences[0].where == Where("some/layer.scenery", 3, 3)
    assert layer.name == "layer"


def test_an_empty_layer_is_a_layer():
    assert parse_scenery("// nothing yet\n", "s").instances == ()


def test_a_layer_is_read_from_a_file(tmp_path):
    file = tmp_path / "doors.scenery"
    file.write_text(DOOR, encoding="utf-8")
    assert load_scenery(file).name == "doors"
    with pytest.raises(InputError, match=r"no such file\n    did you mean \"doors.scenery\"\?"):
        load_scenery(tmp_path / "door.scenery")


def test_the_examples_of_the_documentation_are_sound():
    paragraphs = (grammars.scenery.__doc__ or "").split("::\n\n")[1:]
    blocks = [re.split(r"\n(?=\S)", paragraph)[0] for paragraph in paragraphs]
    layer = parse_scenery("\n".join(blocks), "doc.scenery")
    assert (len(layer.models), len(layer.instances), len(layer.sentences)) == (3, 8, 11)


WORDS = sorted({w for words in literals("grammars.scenery", "scenery.tx").values() for w in words})


@pytest.mark.parametrize("word", [*filter(str.isalpha, WORDS), "back"])
def test_a_word_of_the_language_is_never_taken_for_a_unit(word):
    with pytest.raises(InputError) as caught:
        parse_scenery(f"d moves to open at 5 {word}", "d.scenery")
    assert "is not a unit" not in str(caught.value)
