"""Comparisons of two scenarios: what is paired, what is left out, when they pass."""

from dataclasses import replace

import pytest

from daemon.judging.assessment import assess
from daemon.model.assessments import (
    AssessmentRules,
    Expectation,
    ScenarioComparison,
)
from daemon.model.verdicts import Outcome
from tests.engine.judging.records import measure, record, timed, verdict
from tests.make import with_result


def delay(limit=30.0, op="<=", quantity="delay"):
    text = f"{quantity}(A vs B) {op} {limit:g} s"
    sentence = ScenarioComparison("d", quantity, "A", "B", None, op, limit, "s", text)
    return AssessmentRules(comparisons=(sentence,))


def compared(declared, *sides):
    (found,) = assess(declared, sum(sides, ())).comparisons
    return found


def test_delays_are_paired_by_repeat():
    # Each side varies by much more than their differences do.
    found = compared(delay(), timed("A", [108, 209, 311]), timed("B", [100, 200, 300]))
    assert (found.method, found.n, found.differences) == ("paired", 3, (8.0, 9.0, 11.0))
    assert found.verdict is Outcome.PASS
    assert found.high < 30.0
    assert compared(delay(5), timed("A", [108, 209, 311]), timed("B", [100, 200, 300])).verdict == (
        Outcome.FAIL
    )
    assert compared(delay(10), timed("A", [90, 140]), timed("B", [100, 100])).verdict == (
        Outcome.INCONCLUSIVE
    )


def test_without_pairs_the_means_are_compared():
    other = tuple(replace(r, seed=r.seed + 100) for r in timed("B", [100, 101, 102]))
    found = compared(delay(), timed("A", [108, 109, 110]), other)
    assert (found.method, found.n, found.mean) == ("welch", 3, pytest.approx(8.0))
    assert found.verdict is Outcome.PASS


def test_a_robot_that_never_arrives_has_no_short_delay():
    stuck = with_result(timed("A", [0, 0, 120])[2], ended="limit")
    left = (*timed("A", [108, 109]), stuck)
    found = compared(delay(), left, timed("B", [100, 100, 100]))
    assert (found.verdict, found.left_out, found.n) == (Outcome.INCONCLUSIVE, 1, 2)
    assert found.note == "1 run did not end the mission"
    gave_up = record(2, verdict(-1.0, "reached", "reached(mission, 0.25 m)"), scenario="A")
    assert (
        compared(delay(), (*timed("A", [108, 109]), gave_up), timed("B", [100] * 3)).left_out == 1
    )


@pytest.mark.parametrize(
    ("text", "counts"),
    [
        ("reached(mission, 0.25 m)", True),
        ("reached (mission, 0.25 m)", True),
        ("  reached\n  ( mission , 0.25 m )", True),
        ("reached(mission, 0.25 m) when speed < 1 m/s", True),
        ("always(mission.reached >= 0)", False),
        ("a_plugin_that_is_not_here(3)", False),
    ],
)
def test_a_mission_that_was_missed_is_known_however_its_oracle_is_written(text, counts):
    missed = tuple(
        record(i, verdict(-1.0, "arrives", text), scenario="A", took=20.0) for i in range(5)
    )
    found = compared(delay(), missed, timed("B", [100] * 5))
    assert found.left_out == (5 if counts else 0)
    assert found.verdict is (Outcome.INCONCLUSIVE if counts else Outcome.PASS)


def test_one_pair_decides_nothing():
    found = compared(delay(), timed("A", [101]), timed("B", [100]))
    assert (found.verdict, found.note) == (Outcome.INCONCLUSIVE, "only one pair")
    assert found.mean == 1.0


def test_measures_are_compared_by_their_name():
    def side(name, values):
        return tuple(record(i, measure(v), scenario=name) for i, v in enumerate(values))

    found = compared(delay(0, ">=", "buffer-time"), side("A", [5, 6.1]), side("B", [4, 5]))
    assert (found.verdict, found.mean) == (Outcome.PASS, pytest.approx(1.05))


def test_comparisons_have_expectations_too():
    sides = (*timed("A", [200, 201]), *timed("B", [100, 100]))
    unknown = assess(delay(), sides)
    assert unknown.exit_code == 1
    assert unknown.surprises[0].text.startswith("a2s d  +100 s  fail, n=2: delay(A vs B)")
    known = Expectation("A", "d", (), "fail", "the detour is long")
    assert assess(replace(delay(), expectations=(known,)), sides).exit_code == 0


def apart(*by):
    """Runs of A that take so much longer [s] than their pairs of B."""
    return timed("A", [100 + x for x in by]), timed("B", [100] * len(by))


@pytest.mark.parametrize(
    ("op", "below", "at", "above"),
    [
        ("<=", "pass", "pass", "fail"),
        ("<", "pass", "fail", "fail"),
        (">=", "fail", "pass", "pass"),
        (">", "fail", "fail", "pass"),
    ],
)
def test_each_operator_says_what_the_limit_itself_is(op, below, at, above):
    found = [compared(delay(10, op), *apart(*[by] * 3)).verdict for by in (9, 10, 11)]
    assert found == [below, at, above]


@pytest.mark.parametrize("op", ["<=", "<", ">=", ">"])
def test_a_difference_around_the_limit_decides_nothing(op):
    found = compared(delay(10, op), *apart(7, 10, 14))
    assert found.verdict is Outcome.INCONCLUSIVE
    assert found.note == ""
    assert (found.mean, found.n) == (pytest.approx(31 / 3), 3)
    # Student's t for 2 degrees of freedom is 2.920, the standard error sqrt(37/3/3) = 2.028 s.
    assert found.low == pytest.approx(31 / 3 - 2.920 * 2.028, abs=2e-3)
    assert found.high == pytest.approx(31 / 3 + 2.920 * 2.028, abs=2e-3)


def unfinished(scenario, repeat):
    return record(repeat, verdict(1.0), scenario=scenario, ended="limit")


def test_what_is_left_out_on_both_sides_is_counted_together():
    left, right = apart(8, 9, 10)
    sides = (*left, unfinished("A", 3), unfinished("A", 4), *right, unfinished("B", 3))
    found = compared(delay(), sides)
    assert (found.left_out, found.verdict) == (3, Outcome.INCONCLUSIVE)
    assert found.note == "3 runs did not end the mission"
    # What is too long already does not become better by those that took longer still.
    late = compared(delay(5), sides)
    assert (late.verdict, late.note) == (Outcome.FAIL, "3 runs did not end the mission")


def test_what_stands_in_the_way_of_a_verdict_is_said_together():
    left, right = apart(8)
    one = compared(delay(), (*left, unfinished("A", 1)), right)
    assert one.note == "only one pair; 1 run did not end the mission"
    assert (one.n, one.low, one.high, one.method) == (1, None, None, "")
    none = compared(delay(), (unfinished("A", 0),), right)
    assert none.note == "nothing to compare; 1 run did not end the mission"
    assert (none.n, none.mean, none.differences) == (0, None, ())
    measured = (record(0, measure(5.0), scenario="A"), record(0, scenario="B"))
    assert compared(delay(0, "<=", "buffer-time"), measured).note == (
        "nothing to compare; 1 run left out"
    )


def test_the_delay_of_a_leg_is_that_of_the_measure_that_times_it():
    (sentence,) = delay().comparisons
    leg = AssessmentRules(comparisons=(replace(sentence, measure="leg"),))
    runs = [
        record(i, measure(time, "leg"), scenario=name, took=900.0 - time)
        for name, times in (("A", (18.0, 28.0)), ("B", (10.0, 20.0)))
        for i, time in enumerate(times)
    ]
    assert compared(leg, tuple(runs)).differences == (8.0, 8.0)
    # A leg that was timed in a run that ended before its mission did is no delay.
    runs[1] = with_result(runs[1], ended="limit")
    assert compared(leg, tuple(runs)).left_out == 1


def test_variants_are_paired_with_their_like():
    sides = [
        record(0, verdict(1.0), scenario=f"{name}@{variant}", took=took)
        for name, variant, took in (("A", 1, 111), ("A", 2, 222), ("B", 2, 220), ("B", 1, 110))
    ]
    assert compared(delay(), tuple(sides)).differences == (1.0, 2.0)


def test_every_system_that_ran_both_scenarios_is_compared():
    def runs(sut, scenario, by):
        return tuple(replace(r, sut=sut) for r in timed(scenario, [100 + by, 102 + by]))

    records = (
        *runs("slow", "A", 50), *runs("fast", "A", 5), *runs("alone", "A", 5),
        *runs("fast", "B", 0), *runs("slow", "B", 0), *runs("slow", "C", 0),
    )  # fmt: skip
    found = assess(delay(), records).comparisons
    assert [(c.sut, c.verdict, c.mean) for c in found] == [
        ("slow", "fail", 50.0),
        ("fast", "pass", 5.0),
    ]


@pytest.mark.parametrize(
    ("wanted", "by", "status", "code"),
    [
        ("fail", 99, "met", 0),
        ("fail", 1, "contradicted", 1),
        ("mixed", 99, "met", 0),
        ("mixed", 1, "contradicted", 1),
        ("pass", 1, "met", 0),
        ("pass", 99, "contradicted", 1),
    ],
)
def test_a_comparison_is_one_repeat_of_what_is_expected(wanted, by, status, code):
    known = Expectation("A", "d", (), wanted, "the detour")
    result = assess(replace(delay(), expectations=(known,)), sum(apart(by, by), ()))
    (found,) = result.comparisons
    assert (found.status, found.why, result.exit_code) == (status, "the detour", code)


def test_an_unexpected_comparison_is_told_with_what_was_found():
    (surprise,) = assess(delay(), sum(apart(99, 101), ())).surprises
    assert (surprise.scenario, surprise.run, surprise.repeat) == ("", "", None)
    assert surprise.text == "a2s d  +100 s  fail, n=2: delay(A vs B) <= 30 s"
