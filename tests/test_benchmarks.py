"""Benchmarks print measurements beside references, and hold them to their goals."""

from dataclasses import replace

import pytest

from tests.benchmarks.__main__ import Made, benchmarks, load, main
from tests.benchmarks.measurement import (
    Measurement,
    Reference,
    at_least,
    at_most,
    in_turns,
)
from tests.benchmarks.printing import print_goals

SPEED = Measurement("S1", 130.0, "x real time", Reference("then", 100.0), (at_least(120.0),))
ALONE = Measurement("--help", 0.3, "CPU s")


@pytest.mark.parametrize("name", benchmarks())
def test_a_benchmark_is_a_module_that_measures(name):
    assert callable(load(name).measure)


@pytest.mark.parametrize(
    ("one", "goal", "met"),
    [
        (SPEED, at_least(130.0), True),
        (SPEED, at_least(1.35, of_ratio=True), False),
        (SPEED, at_least(1.3, of_ratio=True), True),
        (ALONE, at_most(0.3), True),
        (ALONE, at_most(0.2), False),
        (ALONE, at_most(0.5, of_ratio=True), False),
    ],
)
def test_a_goal_is_of_the_value_or_of_its_ratio(one, goal, met):
    assert one.met(goal) is met


def test_one_that_fails_says_how_and_does_not_hide_the_others(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")

    def fails():
        yield SPEED
        raise OSError("no room is left")

    made = Made()
    made.add("bad", "bad", fails)
    made.add("good", "good", lambda: [replace(SPEED, goals=(at_least(120.0),))])
    print_goals(made.console, made.measurements)
    assert made.failed == ["bad"]
    out, err = capsys.readouterr()
    assert "no room is left" in err
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert "S1 130 x real time 1.30 x then (100)" in lines
    assert "good: S1 >= 120 x real time 130 x real time 1.30 x then yes" in lines


def test_works_take_turns_every_other_round_backwards():
    done = []
    took = in_turns({name: lambda name=name: done.append(name) for name in "ab"}, 3)
    assert "".join(done) == "abbaab"
    assert {name: len(times) for name, times in took.items()} == {"a": 3, "b": 3}


def test_a_benchmark_that_is_not_there_is_said():
    with pytest.raises(SystemExit, match=r"no benchmark rum; there are: .*run.*against"):
        main(["rum"])
