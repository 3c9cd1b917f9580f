"""Inequalities between parameters of a search: what they mean, and what is said of wrong ones."""

from __future__ import annotations

import pytest

from daemon.model.search import SearchParameter
from daemon.model.search_constraints import names_in_constraint, parse_constraint
from grammars.text.diagnostics import InputError, Where

PARAMETERS = (
    SearchParameter("doors.closes", "behaviours", 0, "closes", "s", 5.0, 7.0, 0.01),
    SearchParameter("doors.opens", "behaviours", 0, "opens", "min", 0.05, 0.2, 0.001),
    SearchParameter("robot.laser.noise", "robot", 0, "laser.noise", "m", 0.01, 0.1, 0.001),
    SearchParameter("sut.planner/tries", "sut", 0, "planner/tries", "", 1.0, 9.0, 1.0),
    SearchParameter("doors.leading", "behaviours", 0, "leading", choices=("a_door", "b_door")),
    SearchParameter("doors.near", "behaviours", 0, "near", choices=("1 m", "50 cm")),
)
POINT = (6.0, 0.1, 0.05, 4.0, "a_door", "50 cm")


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("doors.closes < doors.opens", False),  # 6 s, and 0.1 min is 6 s
        ("doors.closes <= doors.opens", True),
        ("doors.opens >= doors.closes - 1 s", True),
        ("doors.closes + 1 s <= doors.opens", False),
        ("doors.opens - doors.closes > -1 s", True),
        ("2 * sut.planner/tries > 7.5", True),
        ("0 < robot.laser.noise < 4 cm", False),
        ("robot.laser.noise <= doors.near", True),
        ("doors.opens - doors.closes >= 0", True),
    ],
)
def test_an_inequality_holds_in_the_units_that_are_written(text: str, holds: bool) -> None:
    assert all(one.holds(POINT) for one in parse_constraint(text, PARAMETERS)) is holds


def test_a_chain_is_one_inequality_after_the_other() -> None:
    chain = parse_constraint("1 s < doors.closes < doors.opens", PARAMETERS)
    assert [one.holds(POINT) for one in chain] == [True, False]


def test_sums_that_are_equal_but_for_rounding_are_equal() -> None:
    (one,) = parse_constraint("robot.laser.noise <= 2 cm + 3 cm", PARAMETERS)
    (less,) = parse_constraint("robot.laser.noise < 2 cm + 3 cm", PARAMETERS)
    assert one.holds(POINT)
    assert not less.holds(POINT)


def test_what_no_point_of_the_ranges_keeps_to_is_known() -> None:
    never, may = (
        parse_constraint(text, PARAMETERS)[0]
        for text in ("doors.closes > doors.opens + 5 s", "doors.closes > doors.opens")
    )
    assert never.least(PARAMETERS) == pytest.approx(1.0)
    assert may.least(PARAMETERS) == pytest.approx(-4.0)


def test_names_are_found_where_they_stand() -> None:
    text = "2 * a.b - c/d-e < 3 s + f"
    assert [text[start:end] for _, start, end in names_in_constraint(text)] == ["a.b", "c/d-e", "f"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("doors.closes", "is no inequality"),
        ("doors.closes == doors.opens", "is no inequality"),
        ("doors.closes <", "a sum is missing"),
        ("doors.close < doors.opens", 'nothing called "doors.close" is searched'),
        ("doors.closes < 3", "doors.closes is in s and 3 has no unit"),
        ("doors.closes < robot.laser.noise", "doors.closes is in s and robot.laser.noise is in m"),
        ("doors.closes < 3 parsec", "is not a unit"),
        ("doors.leading < doors.closes", "is no number"),
        ("__import__('os') < 1", 'nothing called "__import__"'),
        ("doors.closes doors.opens < 1 s", "cannot read on"),
        (" + ".join(["1 s"] * 60) + " < doors.closes", "more than 40 terms"),
        ("doors.closes < " + "9" * 600 + " s", "longer than"),
    ],
)
def test_what_is_no_inequality_is_told_with_its_place(text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_constraint(text, PARAMETERS, Where("a.yaml", 7, 3))
    assert said in str(caught.value)
    assert str(caught.value).startswith("a.yaml:7:3")
