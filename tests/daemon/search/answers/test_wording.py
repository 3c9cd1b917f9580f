"""Changes and failures in words."""

import pytest

from daemon.model.search import SearchParameter
from daemon.model.search_answer import Confirmation, NearestFailure, ParameterChange
from daemon.search.answers.wording import (
    change_words,
    confirmation_words,
    nearest_sentence,
    percentage,
    point_words,
    rounded,
)
from tests.daemon.search.pretended import made_trial, make_task, seconds


def parameter(name, unit, written):
    key = name.partition(".")[2]
    return SearchParameter(name, "behaviours", 0, key, unit, 0.0, 100.0, 0.01, written=written)


@pytest.mark.parametrize(
    ("name", "unit", "written", "value", "words"),
    [
        ("doors.kitchen_opens", "s", 8.0, 8.54, "kitchen_opens 8.54 s instead of 8 s"),
        ("robot.drive.speed", "m/s", 1.0, 1.5, "drive.speed 1.5 m/s instead of 1 m/s"),
        ("mission.start.y", "m", 0.0, -0.12, "start.y −0.12 m instead of 0 m"),
        ("pilot.particles", "", 500.0, 120.0, "particles 120 instead of 500"),
    ],
)
def test_a_change_is_told_by_both_values(name, unit, written, value, words):
    task = make_task(parameter(name, unit, written))
    assert change_words(task, ParameterChange(name, unit, written, value)) == words


def test_a_choice_is_told_like_a_number_and_what_is_written_nowhere_alone():
    choice, free = parameter("doors.leading", "", "one"), parameter("doors.trigger", "m", None)
    task = make_task(choice, free)
    change = ParameterChange("doors.leading", "", "one", "two")
    assert change_words(task, change) == "leading two instead of one"
    assert change_words(task, ParameterChange("doors.trigger", "m", None, 1.5)) == "trigger 1.5 m"


def test_a_name_keeps_its_layer_where_two_layers_have_it():
    task = make_task(seconds("doors.pause"), seconds("people.pause"), seconds("people.opens"))
    assert [task.short_name(p.name) for p in task.parameters] == [
        "doors.pause",
        "people.pause",
        "opens",
    ]


def test_the_sentence_of_one_change():
    task = make_task(seconds("doors_moving.kitchen_opens", 8.0), seconds("doors_moving.swing", 6.0))
    change = ParameterChange("doors_moving.kitchen_opens", "s", 8.0, 8.54, 8.32)
    failing = made_trial((8.54, 6.0), -0.0183, near="kitchen_door")
    passing = made_trial((8.32, 6.0), 0.105, near="kitchen_door")
    assert nearest_sentence(task, NearestFailure(failing, (change,), passing, 9, True, "")) == (
        "kitchen_opens 8.54 s instead of 8 s and keeps-clear fails by 0.0183 m "
        "near kitchen_door; at 8.32 s it passes with 0.105 m"
    )


def test_the_sentence_of_several_changes():
    task = make_task(seconds("doors.kitchen_opens", 8.0), seconds("doors.bedroom_opens", 6.0))
    changes = (
        ParameterChange("doors.kitchen_opens", "s", 8.0, 8.5, 8.49),
        ParameterChange("doors.bedroom_opens", "s", 6.0, 5.5, 5.51),
    )
    failing = made_trial((8.5, 5.5), -0.018, near="")
    passing = made_trial((8.5, 5.51), 0.002, near="")
    assert nearest_sentence(task, NearestFailure(failing, changes, passing, 9, True, "")) == (
        "kitchen_opens 8.5 s instead of 8 s and bedroom_opens 5.5 s instead of 6 s, and "
        "keeps-clear fails by 0.018 m; with bedroom_opens 5.51 s it passes with 0.002 m"
    )


def test_of_many_values_some_are_told():
    task = make_task(*(seconds(f"doors.t{i}", float(i)) for i in range(6)))
    assert point_words(task, (0.0, 1.5, 2.0, 3.0, 4.0, 5.0)) == "t1 1.5 s"
    assert point_words(task, (9.0,) * 6, most=2) == "t0 9 s, t1 9 s and 4 more"
    assert point_words(task, (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)) == "as written"


def test_numbers_have_three_digits_and_bounds_are_no_narrower_than_shown():
    numbers = (0.01834, 0.5, 12.0, 123.4, 12345.0, 0.0, -0.00102, 1e-9)
    assert [rounded(number) for number in numbers] == [
        "0.0183",
        "0.5",
        "12",
        "123",
        "12345",
        "0",
        "−0.00102",
        "1e−09",
    ]
    assert percentage(0.18104) == "18.2 %"
    words = confirmation_words(Confirmation(5, 5, 0.4782, 1.0))
    assert words == "fails in 5 of 5 repeats with other noise (47.8 % to 100 % with 95 % certainty)"
