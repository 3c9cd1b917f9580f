"""Layers of scenery: what is read of each construct, and what a campaign changes."""

import dataclasses
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

import grammars.scenery
from grammars.editor.oracles import literals
from grammars.model.geometry import Pose2
from grammars.model.kinematics import link_poses
from grammars.model.movers import is_mover
from grammars.model.scene import SceneObject
from grammars.scenery import configure, load_scenery, parse_scenery
from grammars.scenery.model import FrameName, Measure, Path, Subject, Word
from grammars.text.diagnostics import InputError, Where
from tests.languages.plans import DOOR, HERE, PEOPLE

EVERYTHING = (HERE / "fuzz" / "seeds" / "everything.scenery").read_text("utf-8")


def outline(value):
    """Return a value as text: what is not empty of it, without places."""
    match value:
        case Measure():
            return f"{value.value:.12g} ({value.text})"
        case Subject():
            names = ", ".join(map(str, value.names)) + " (each)" * value.every
            return names + "".join(f" except {name}" for name in value.exceptions)
        case Word() | Path() | FrameName():
            return str(value)
        case float():
            return f"{round(value, 12) + 0.0:.12g}"
        case tuple() if len(value) > 8:
            return f"[{outline(value[0])}, … {len(value)}]"
        case tuple():
            return f"[{', '.join(map(outline, value))}]"
    if not dataclasses.is_dataclass(value):
        return str(value)
    return f"{type(value).__name__}({', '.join(fields(value))})"


def fields(value):
    members = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    return [
        f"{name}={outline(member)}"
        for name, member in members.items()
        if name not in ("where", "text") and member not in (None, (), "", False)
    ]


def test_everything_is_read_as_it_is_meant(golden):
    layer = parse_scenery(EVERYTHING, "all.scenery")
    lines = []
    for part in ("models", "instances", "groups", "parameters", "settings", "sentences"):
        for each in getattr(layer, part):
            where = each.where if hasattr(each, "where") else each.subject.where
            lines += ["", f"{where}: {type(each).__name__}", *fields(each)]
    golden("scenery.txt", "\n    ".join(lines).replace("\n    \n    ", "\n\n").strip() + "\n")


def test_line_breaks_and_comments_carry_no_meaning():
    one_line = " ".join(line.split("//")[0] for line in EVERYTHING.splitlines())
    assert parse_scenery(one_line, "s.scenery") == parse_scenery(
        EVERYTHING.replace("\n", " // remark\n"), "s.scenery"
    )


def test_plural_and_singular_mean_the_same():
    one, other = parse_scenery("every door stays open all door stay open", "s").sentences
    assert one == other


def test_a_layer_is_read_from_a_file_and_may_be_empty(tmp_path):
    assert parse_scenery("// nothing yet\n", "s").instances == ()
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


def test_a_word_of_the_language_is_never_taken_for_a_unit():
    words = {w for words in literals("grammars.scenery", "scenery.tx").values() for w in words}
    for word in [*filter(str.isalpha, words), "back"]:
        with pytest.raises(InputError) as caught:
            parse_scenery(f"d moves to open at 5 {word}", "d.scenery")
        assert "is not a unit" not in str(caught.value)


def test_a_mover_hangs_on_a_planar_chain():
    person, table = parse_scenery(PEOPLE, "p.scenery").models
    assert (is_mover(person.joints), is_mover(table.joints)) == (True, False)
    at = SceneObject("p", "p", Pose2(1, 2, math.pi / 2), person.links, person.joints, (0,) * 4)
    poses = link_poses(at, (3.0, 4.0, 0.5, 0.0))
    body = poses["body"]
    assert poses["hat"] == body
    assert (body.x, body.y, body.yaw) == pytest.approx((-3.0, 5.0, math.pi / 2 + 0.5))


LAYER = parse_scenery(
    """
    group doors: door_12, door_17
    parameter within = 1.3 m
    all doors go from ajar to closed when the robot is within within of their hinge
    """,
    "close_on_approach.scenery",
)
HERE_IN_CAMPAIGN = Where("campaign.yaml", 12, 9)


def test_a_campaign_gives_parameters_and_groups_other_values():
    changed = configure(LAYER, {"within": "90 cm"}, HERE_IN_CAMPAIGN)
    assert changed.parameters[0].value.value == pytest.approx(0.9)
    assert LAYER.parameters[0].value.value == 1.3
    assert changed.sentences == LAYER.sentences
    for members in (["door_3", "door_4"], "door_3"):
        (group,) = configure(LAYER, {"doors": members}, HERE_IN_CAMPAIGN).groups
        assert str(group.members) == (members if isinstance(members, str) else "door_3, door_4")


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3),
)


@given(st.dictionaries(st.sampled_from(["doors", "within", "other"]), VALUES))
def test_any_other_value_is_taken_or_refused(overrides):
    try:
        configure(LAYER, overrides)
    except InputError as error:
        assert error.findings
