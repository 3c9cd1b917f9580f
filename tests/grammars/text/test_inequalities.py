"""Inequalities between named quantities: read into sums, refused with what is wrong."""

import pytest

from grammars.text.inequalities import LONGEST, read_inequality

UNITS = {
    "doors.closes": "s",
    "doors.opens": "min",
    "doors.opens.late": "s",
    "/planner/speed": "m/s",
    "swing": "deg",
    "turn": "rad",
    "count": "",
}


@pytest.mark.parametrize(
    ("text", "values", "holds"),
    [
        ("doors.closes < doors.opens", {"doors.closes": 59.0, "doors.opens": 1.0}, True),
        ("doors.closes < doors.opens", {"doors.closes": 60.0, "doors.opens": 1.0}, False),
        ("doors.closes <= doors.opens", {"doors.closes": 60.0, "doors.opens": 1.0}, True),
        ("doors.opens > doors.closes", {"doors.closes": 59.0, "doors.opens": 1.0}, True),
        ("doors.closes + 1 s <= doors.opens", {"doors.closes": 59.5, "doors.opens": 1.0}, False),
        ("-doors.closes+0.5min>=-doors.opens", {"doors.closes": 90.0, "doors.opens": 1.0}, True),
        ("doors.opens.late - doors.closes - 1 s > 2 s",
         {"doors.opens.late": 8.0, "doors.closes": 5.0}, False),
        ("/planner/speed < 0.5 m/s", {"/planner/speed": 0.4}, True),
        ("swing <= turn", {"swing": 90.0, "turn": 1.57}, False),
        ("count + count < 5", {"count": 2.0}, True),
    ],
)  # fmt: skip
def test_sums_are_compared_in_si_units(text, values, holds):
    assert read_inequality(text, UNITS).holds(values) is holds


def test_what_is_equal_up_to_rounding_is_equal():
    values = {"a": 0.1, "b": 0.2}
    units = {"a": "s", "b": "s"}
    assert read_inequality("a + b <= 0.3 s", units).holds(values)
    assert not read_inequality("a + b > 0.3 s", units).holds(values)


def test_names_are_told_once():
    assert read_inequality("count + count < 5 - count", UNITS).names == ("count",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("doors.closes", "is no inequality"),
        ("1 s < doors.closes < 2 s", "write [1 s < doors.closes, doors.closes < 2 s]"),
        ("doors.closes == doors.opens", "is no inequality"),
        ("doors.close < doors.opens", 'did you mean "doors.closes"?'),
        ("doors.closes < swing", "doors.closes in s and swing in rad do not go together"),
        ("doors.closes < 5", "5 without a unit"),
        ("doors.closes < 5 parsec", '"parsec" is not a unit'),
        ("doors.closes <", "a name or a quantity is missing"),
        ("doors.closes + < 5 s", "a name or a quantity is missing"),
        ("doors.closes 3 s < 5 s", "expected + or -"),
        ("2 * count < 5", "expected + or -"),
        ("1 s < 2 s", "names nothing that is varied"),
        ("__import__('os').system('true') < 5 s", "is not varied here"),
        ("count < 1" + "0" * LONGEST, "characters"),
    ],
)
def test_what_makes_no_sense_is_told(text, words):
    with pytest.raises(ValueError, match="^") as refused:
        read_inequality(text, UNITS)
    assert words in str(refused.value)
