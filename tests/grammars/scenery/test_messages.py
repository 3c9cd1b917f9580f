"""What people are told when a layer cannot be read."""

import pytest

from grammars.editor import literals
from grammars.scenery import parse_scenery
from grammars.text.diagnostics import InputError
from tests.grammars.scenery.samples import DOOR, SLIDER


def told(text):
    with pytest.raises(InputError) as caught:
        parse_scenery(text, "d.scenery")
    return str(caught.value)


LINK = "object o link a box 1 m x 1 m from 0 m to 1 m, mass 1 kg "

MESSAGES = {
    "d stays at 1.4": ("d.scenery:1:12: a unit is missing after 1.4\n    write 1.4 deg or 1.4 m"),
    "d stays at 1.4 rads": ('d.scenery:1:12: "rads" is not a unit: did you mean "rad"?'),
    "parameter p = 3": (
        "d.scenery:1:15: a unit is missing after 3\n    write 3 m, 3 rad, 3 s, … as is meant"
    ),
    "parameter p = 3 Nm": 'd.scenery:1:15: "Nm" is not a unit: did you mean "N m"?',
    "parameter p = 3 m/sek": 'd.scenery:1:15: "m/sek" is not a unit: did you mean "m/s"?',
    "parameter p = 211 000 s": (
        'd.scenery:1:19: expected "object", "mover", "group", "parameter", "every", a name or '
        'the end of the file, found "000"\n    a unit is missing after 211'
    ),
    "v walks along (1,5 m), (2 m, 0 m)": (
        'd.scenery:1:21: expected ",", found ")"\n    decimals are written with a point'
    ),
    "d toggles between a and b every 3 s with probability 2 s": (
        "d.scenery:1:54: a ratio is needed here, 2 s is a time"
    ),
    "evry door stays open": (
        'd.scenery:1:6: expected "except", "is", "starts", "stays", "moves", "toggles", "goes", '
        '"walks", …, found "door"\n    did you mean "every"?'
    ),
    "# doors": (
        'd.scenery:1:1: expected "object", "mover", "group", "parameter", "every", a name or '
        'the end of the file, found "#"'
    ),
    "d is a hinged_door": ('d.scenery:1:19: expected "at" or "in", found the end of the file'),
    "d is a hinged_door in w, hinge left": (
        "d.scenery:1:26: to which side does the leaf open?\n"
        "    add opening inwards, opening outwards or opening into <space>"
    ),
    "d is a hinged_door in w, hinge left, opening inwards, x 1 m": (
        'd.scenery:1:55: "x" is for objects placed at a frame\n    write at <frame>, …'
    ),
    "d is a hinged_door in w, opening inwards": (
        'd.scenery:1:26: "opening" needs hinge left, hinge right or sliding …\n    say which side'
    ),
    "d is a hinged_door in w, hinge left, opening inwards, turned 90 deg": (
        'd.scenery:1:55: "turned" is not for doors with a hinge\n    leave it out'
    ),
    "d is a slider in w, sliding left, recessed 1 cm": (
        'd.scenery:1:35: "recessed" is not for sliding doors\n    leave it out'
    ),
    "d is a slider in w, sliding left, hinge left": (
        "d.scenery:1:21: a door has a hinge or slides, not both"
    ),
    "d is a hinged_door at w, hinge left": (
        'd.scenery:1:26: "hinge" is for objects placed in an entryway\n    write in <entryway>, …'
    ),
    "d is a hinged_door at w, x 1 m, x 2 m": 'd.scenery:1:33: "x" is written twice',
    "every d is a hinged_door at w": (
        "d.scenery:1:1: one object is placed at a time\n    door_1 is a hinged_door at …"
    ),
    "d goes from a to b by jump": (
        "d.scenery:1:1: when does it go?\n"
        "    add when the robot is within 1.3 m of its hinge; moves to … at … for given times"
    ),
    "d moves to open at 5 m": (
        "d.scenery:1:20: a time is needed here, 5 m is a length\n    write it in s"
    ),
    "d stays at 5 kg": (
        "d.scenery:1:12: an angle or a length is needed here, 5 kg is a mass\n    write it in rad"
    ),
    "d toggles between a and b every 3 s with probability 2": (
        "d.scenery:1:54: a probability lies between 0 and 1 (0 % and 100 %)"
    ),
    "d stays at 1e300 rad": (
        "d.scenery:1:12: 1e300 rad is more than anything in a building\n    is the unit right?"
    ),
    "d stays at 1,5 rad": ("d.scenery:1:12: decimals are written with a point\n    1.5, not 1,5"),
    "object link": 'd.scenery:1:8: "link" cannot be a name\n    take another word',
    "d is a hinged_door in w, hinge left, opening inward": (
        'd.scenery:1:46: expected "inwards", "outwards" or "into", found "inward"\n'
        '    did you mean "inwards"?'
    ),
    "group a: b\nparameter a = 1 m": (
        'd.scenery:2:1: the name "a" is taken\n    first used at d.scenery:1:1'
    ),
    LINK + "joint j revolute from a to b between 0 rad and 1 rad": (
        'd.scenery:1:85: there is no link "b"\n    known here: a'
    ),
    LINK + "joint j revolute from world to a between 0 rad and 1 rad": (
        "d.scenery:1:58: a revolute joint turns about a point\n    add at (0 m, 0 m)"
    ),
    LINK + "joint j prismatic from world to a between 0 m and 1 m": (
        "d.scenery:1:58: a prismatic joint needs a direction\n    add along x"
    ),
    LINK + "joint j prismatic from world to a along x between 1 m and 0 m": (
        "d.scenery:1:108: the lower limit is above the upper limit"
    ),
    LINK + "link a box 1 m x 1 m from 0 m to 1 m, mass 1 kg": (
        'd.scenery:1:58: link "a" exists already\n    see d.scenery:1:10'
    ),
    "object o link a box 0 m x 1 m from 0 m to 1 m, mass 1 kg": (
        "d.scenery:1:21: a size is at least 1 mm"
    ),
    "object o link a box 1 m x 1 m from 1 m to 1 m, mass 1 kg": (
        "d.scenery:1:10: the link has no height\n    write from the lower z up"
    ),
    "object o link a box 1 m x 1 m from 0 m to 1 m, mass 0 kg": (
        "d.scenery:1:53: a mass is greater than 0 kg"
    ),
    "object o link a polygon (0 m, 0 m), (2 m, 0 m), (1 m, 1 m), (1 m, 2 m) from 0 m to 1 m, "
    "mass 1 kg": (
        "d.scenery:1:17: the polygon is not convex\n"
        "    list three or more corners in order; join several convex shapes with and"
    ),
}


@pytest.mark.parametrize("text", MESSAGES, ids=lambda text: text[:50])
def test_messages_say_where_what_and_what_to_do(text):
    assert told(text).startswith(MESSAGES[text])


def test_a_hash_is_no_comment():
    assert told("# doors").endswith("comments start with //")


def test_states_stay_within_the_limits_of_their_joints():
    wrong = DOOR.replace("hinge 1.7 rad", "hinge 3 rad")
    assert told(wrong) == (
        "d.scenery:9:25: 3 rad is outside the limits of joint hinge\n    between 0 and 2 rad"
    )


def test_states_name_joints_that_exist():
    wrong = SLIDER.replace("open:   rail", "open:   rial")
    assert told(wrong) == 'd.scenery:6:19: there is no joint "rial"\n    did you mean "rail"?'


def test_states_use_the_dimension_of_their_joint():
    assert "an angle is needed here, 1 m is a length" in told(
        DOOR.replace("hinge 1.7 rad", "hinge 1 m")
    )


def test_a_link_is_moved_by_one_joint_only_and_not_by_itself():
    second = "joint again revolute from post to leaf at (0 m, 0 m), between 0 rad and 1 rad\n"
    assert 'link "leaf" is moved by two joints' in told(DOOR + second)
    loop = "joint back revolute from leaf to post at (0 m, 0 m), between 0 rad and 1 rad\n"
    assert "carries itself through its joints" in told(DOOR + loop)


def test_a_star_is_not_convex_although_it_turns_one_way():
    star = "(0 m, 1 m), (0.6 m, -0.8 m), (-0.95 m, 0.3 m), (0.95 m, 0.3 m), (-0.6 m, -0.8 m)"
    assert "not convex" in told(f"object o link a polygon {star} from 0 m to 1 m, mass 1 kg")


def test_all_problems_of_a_file_are_reported_at_once_in_order():
    text = "d stays at 5 kg\nd moves to open at 5 m\ngroup a: b\ngroup a: c\n"
    lines = [line for line in told(text).splitlines() if line.startswith("d.scenery")]
    assert [line.split(":")[1] for line in lines] == ["1", "2", "4"]


def test_all_missing_units_are_reported_at_once():
    assert told("d stays at 5\nd moves to 1 at 5").count("a unit is missing") == 3
    broken = LINK.replace("1 m from", "1 from").replace("1 kg", "1")
    assert told(broken).count("a unit is missing") == 2


def test_every_statement_with_a_syntax_error_is_reported_beside_missing_units():
    message = told("d is a door\nd stays at 5\nd moves too open\n")
    assert message == (
        'd.scenery:2:1: expected "at" or "in", found "d"\n'
        "d.scenery:2:12: a unit is missing after 5\n    write 5 deg or 5 m\n"
        'd.scenery:3:9: expected "to", found "too"\n    did you mean "to"?'
    )


@pytest.mark.parametrize(
    ("sentence", "hint"),
    [
        ("v walks along (0 m, 0 m) of hall, (1 m, 0 m) of hall, at 0.7, round", "write 0.7 m/s"),
        ("v walks along (0 m, 0 m), (1 m, 0 m),\n  accelerating at 2", "write 2 m/s^2"),
        ("v walks along (0 m, 0 m), (1 m, 0 m), pausing 2, once", "write 2 s"),
        ("d moves to open at 5", "write 5 s"),
        ("d moves to open at 5 s, by servo at 60 with 2 N m", "write 60 deg/s or 60 m/s"),
        ("d is a door at hall, x 1", "write 1 m"),
        ("d goes from closed to open when the robot is within 2 of its hinge", "write 2 m"),
        ("v walks along (0 m, 0 m), (1 m, 0 m)\nd stays at 5", "write 5 deg or 5 m"),
    ],
)
def test_the_unit_that_is_expected_is_the_one_to_write(sentence, hint):
    assert f"\n    {hint}" in told(sentence)


WORDS = sorted({w for words in literals("grammars.scenery", "scenery.tx").values() for w in words})


@pytest.mark.parametrize("word", [*filter(str.isalpha, WORDS), "back"])
def test_a_word_of_the_language_is_never_taken_for_a_unit(word):
    with pytest.raises(InputError) as caught:
        parse_scenery(f"d moves to open at 5 {word}", "d.scenery")
    assert "is not a unit" not in str(caught.value)
