"""Two runs compared: clocks, verdicts, specifications, and the screen that shows them."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.judging.signals import RunSignal
from daemon.model.live_judgement import DoorMotion
from daemon.model.spec import SutReference
from daemon.model.verdicts import Evidence, Outcome, Verdict
from scenario_tui.dashboard.run_timeline import RunTimeline, common_clock, shift_to_clock
from scenario_tui.text.comparison_text import (
    margin_change,
    pair_verdicts,
    spec_differences,
)
from tests.people.recorded import make_run


def timeline(end, reached):
    time = np.array([0.0, end])
    signal = RunSignal("speed", "m/s", time, time, time, against=((0.0, end),))
    doors = (DoorMotion(end, "door", opens=True),)
    return RunTimeline(0.0, end, (signal,), doors, reached, ("a", "b", "c"), (end,))


def test_by_time_the_clocks_are_the_same():
    clock = common_clock(timeline(10.0, (2.0,)), timeline(20.0, (4.0,)), "time")
    assert [clock.to_second(t) for t in (-1.0, 0.0, 15.0)] == [-1.0, 0.0, 15.0]


def test_by_mission_waypoints_meet_and_the_rest_goes_on():
    first, second = timeline(10.0, (2.0, 6.0)), timeline(30.0, (10.0, 20.0, 25.0))
    clock = common_clock(first, second, "mission")
    assert [clock.to_second(t) for t in (0.0, 1.0, 2.0, 4.0, 6.0, 9.0)] == [
        0.0, 5.0, 10.0, 15.0, 20.0, 23.0,
    ]  # fmt: skip
    moved = shift_to_clock(second, clock)
    assert moved.reached == (2.0, 6.0, 11.0)
    assert (moved.end, moved.decided, moved.doors[0].time) == (16.0, (16.0,), 16.0)
    assert moved.signals[0].against == ((0.0, 16.0),)
    assert moved.signals[0].low.tolist() == [0.0, 30.0]


def verdict(name, outcome, margin):
    return Verdict(name, "", outcome, margin, margin, "m", Evidence())


def test_a_change_has_no_more_digits_than_what_changes():
    (same,) = pair_verdicts(
        (verdict("a", Outcome.PASS, 0.294),), (verdict("a", Outcome.PASS, 0.29402),)
    )
    (less,) = pair_verdicts(
        (verdict("a", Outcome.PASS, 0.0111),), (verdict("a", Outcome.PASS, 0.00803),)
    )
    assert (margin_change(same), margin_change(less)) == (0.0, -0.0031)


def test_verdicts_that_differ_come_first():
    first = (verdict("same", Outcome.PASS, 1.0), verdict("turns", Outcome.PASS, 0.5))
    second = (verdict("turns", Outcome.FAIL, -0.1), verdict("same", Outcome.PASS, 3.0))
    found = pair_verdicts(first, (*second, verdict("new", Outcome.PASS, 1.0)))
    assert [(p.oracle, p.kind, margin_change(p)) for p in found] == [
        ("turns", "verdict", pytest.approx(-0.6)), ("new", "new", None), ("same", "margin", 2.0),
    ]  # fmt: skip


def test_specifications_differ_part_by_part():
    spec = make_run()
    other = replace(
        spec, scenario="S9", repeat=4, seed=7, sut=SutReference("pilot", "pilot", {"speed": 0.3})
    )
    found = {path: texts for path, *texts in spec_differences(spec, other)}
    assert found == {
        "scenario": [spec.scenario, "S9"],
        "sut.parameters": ["{}", "–"],
        "sut.parameters.speed": ["–", "0.3"],
        "seed": [str(spec.seed), "7"],
    }
    assert spec_differences(spec, replace(spec, repeat=3)) == []


@pytest.mark.parametrize(
    ("first", "second", "shown"),
    [
        (1.65806278, -2.0, ("1.65806", "-2")),
        (1.65806278, 1.65806279, ("1.65806278", "1.65806279")),
        ("a" * 50, "b", ("a" * 39 + "…", "b")),
        ("a" * 50 + "1", "a" * 50 + "2", ("a" * 50 + "1", "a" * 50 + "2")),
    ],
)
def test_differences_are_short_but_never_look_the_same(first, second, shown):
    spec = make_run()
    a, b = (replace(spec, sut=SutReference("it", "it", {"p": value})) for value in (first, second))
    (found,) = spec_differences(a, b)
    assert found[1:] == shown
