"""Two campaigns side by side: what changed, what got worse, and what cannot be said."""

from dataclasses import replace

import pytest

from daemon.judging.assessment import (
    JudgedCampaign,
    compare_campaigns,
)
from daemon.model.assessments import AssessmentRules
from daemon.model.verdicts import Evidence, Outcome, Verdict
from tests.engine.judging.records import cell, measure, record, verdict
from tests.make import with_result


def judged(name, *records):
    return JudgedCampaign(name, AssessmentRules(), records)


def between(before, after, worse_by=None):
    return compare_campaigns(judged("a", *before), judged("b", *after), worse_by)


def shift(found, quantity):
    return next(s for s in found.shifts if s.quantity == quantity)


def test_equal_campaigns_differ_in_nothing():
    runs = cell([0.1, 0.2, 0.3])
    found = between(runs, runs, 0.0)
    assert (found.verdicts, found.regressed) == ((), False)
    assert [(s.mean, s.delta, s.p, s.changed) for s in found.shifts] == [(0.0, 0.0, 1.0, False)] * 2


def test_a_verdict_that_fails_now_is_worse_and_one_that_passes_now_is_not():
    good, bad = cell([0.1, 0.2]), cell([0.1, -0.2])
    (change,) = between(good, bad).verdicts
    assert (change.passed_before, change.passed_after, change.worse) == ("2/2", "1/2", True)
    (change,) = between(bad, good).verdicts
    assert not change.worse
    assert not between(bad, good).regressed


def test_margins_are_paired_by_repeat_and_seed():
    found = shift(between(cell([0.1, 0.5, 0.9]), cell([0.05, 0.44, 0.86])), "clear")
    assert (found.method, found.n, found.mean) == ("paired", 3, pytest.approx(-0.05))
    assert found.changed
    assert found.delta == pytest.approx(-1 / 3)
    strangers = tuple(replace(r, seed=r.seed + 7) for r in cell([0.05, 0.44, 0.86]))
    found = shift(between(cell([0.1, 0.5, 0.9]), strangers), "clear")
    assert (found.method, found.n, found.changed) == ("welch", 3, False)


def test_the_gate_asks_for_more_than_a_little():
    before, after = cell([0.5, 0.52, 0.54, 0.51]), cell([0.46, 0.49, 0.5, 0.47])
    assert shift(between(before, after, 0.0), "clear").worse
    assert not between(before, after, 0.1).regressed
    assert not between(before, after).regressed
    assert not between(after, before, 0.0).regressed


def test_longer_is_worse_and_measures_are_neither():
    def runs(extra):
        return tuple(
            record(i, verdict(1.0), measure(5.0 + extra), took=100.0 + i + extra) for i in range(4)
        )

    found = between(runs(0.0), runs(20.0), 0.1)
    assert {s.quantity: (s.kind, s.changed, s.worse) for s in found.shifts} == {
        "clear": ("margin", False, False),
        "buffer-time": ("measure", True, False),
        "duration": ("duration", True, True),
    }
    assert not between(runs(20.0), runs(0.0), 0.1).regressed


def test_one_of_many_is_no_finding():
    """A difference that would be significant alone is not among many that are not."""

    def runs(shifted):
        noise = (0.0, 0.1, -0.1, 0.05)
        return [
            record(i, *(verdict(5 + 0.01 * k + noise[(i + k) % 4] * bool(shifted), f"o{k}")
                        for k in range(1, 30)),
                   verdict(5.0 - shifted * (1 + noise[i]), "o0"))
            for i in range(4)
        ]  # fmt: skip

    alone = between([with_result(r, verdicts=r.verdicts[-1:]) for r in runs(0.0)],
                    [with_result(r, verdicts=r.verdicts[-1:]) for r in runs(0.1)])  # fmt: skip
    single, many = shift(alone, "o0"), shift(between(runs(0.0), runs(0.1)), "o0")
    assert many.p > 10 * single.p > 0.0


def test_one_repeat_shows_no_difference_but_its_verdict():
    found = between(cell([0.5]), cell([-0.4]), 0.0)
    assert (shift(found, "clear").mean, shift(found, "clear").p) == (pytest.approx(-0.9), None)
    assert found.verdicts[0].worse


def test_cells_of_one_side_only_are_named():
    found = between(cell([1.0], scenario="S1"), cell([1.0], scenario="S2"))
    assert (found.only_before, found.only_after) == ((("S1", "a2s"),), (("S2", "a2s"),))
    assert found.shifts == ()


def test_only_a_verdict_that_was_there_and_no_failure_gets_worse():
    for before, after, worse in ((None, -1.0, True), (1.0, None, False), (-1.0, None, False)):
        (change,) = between(cell([before]), cell([after])).verdicts
        assert change.worse is worse
    added = [record(0, verdict(1.0), verdict(-1.0, "new"))]
    (change,) = between(cell([1.0]), added).verdicts
    assert (change.oracle, change.before, change.after) == ("new", None, "fail")
    assert (change.passed_before, change.passed_after, change.worse) == ("", "0/1", False)
    (gone,) = between(added, cell([1.0])).verdicts
    assert (gone.after, gone.passed_before, gone.passed_after) == (None, "0/1", "")


def test_shifts_say_both_means_and_the_interval_of_their_difference():
    found = shift(between(cell([0.1, 0.5, 0.9]), cell([0.05, 0.44, 0.86])), "clear")
    assert (found.before, found.after) == (pytest.approx(0.5), pytest.approx(0.45))
    # Differences -0.05, -0.06, -0.04: standard error 0.01/sqrt 3, t 4.303 for 2 degrees of freedom.
    assert found.low == pytest.approx(-0.05 - 4.303 * 0.01 / 3**0.5, abs=1e-5)
    assert found.high == pytest.approx(-0.05 + 4.303 * 0.01 / 3**0.5, abs=1e-5)
    assert found.unit == "m"


def test_a_margin_below_zero_may_get_worse_by_its_share_too():
    before, after = cell([-0.5, -0.5, -0.5]), cell([-0.54, -0.54, -0.54])
    assert shift(between(before, after, 0.07), "clear").worse
    assert not shift(between(before, after, 0.09), "clear").worse
    slow = [record(i, verdict(1.0), took=107.0) for i in range(3)]
    quick = [record(i, verdict(1.0), took=100.0) for i in range(3)]
    assert shift(between(quick, slow, 0.06), "duration").worse
    assert not shift(between(quick, slow, 0.08), "duration").worse


def test_margins_that_nobody_judged_are_no_values():
    bound = replace(verdict(None), lower=9.0)
    before = [record(0, verdict(0.1)), record(1, bound), record(2, verdict(0.3), ended="crashed")]
    found = shift(between(before, cell([0.2, 0.2, 0.2])), "clear")
    assert (found.before, found.after, found.n) == (0.1, pytest.approx(0.2), 1)
    assert (found.method, found.delta, found.changed, found.worse) == ("", None, False, False)
    measured = between([record(0, measure(5.0))], [record(0, measure(8.0))], 0.1)
    assert (shift(measured, "buffer-time").mean, shift(measured, "buffer-time").kind) == (
        3.0,
        "measure",
    )


@pytest.mark.parametrize("broken", [0, 4])
@pytest.mark.parametrize("made", [measure, verdict])
def test_a_run_without_a_valid_trace_leaves_the_quantities_of_the_others(broken, made):
    def runs(value):
        return [record(i, made(value + 0.1 * i, "seen")) for i in range(5)]

    invalid = Evidence(note="invalid trace: no clock")
    error = Verdict("seen", "…", Outcome.ERROR, None, None, "", invalid)
    after = runs(3.0)
    after[broken] = record(broken, error, outcome=Outcome.ERROR)
    found = shift(between(runs(2.0), after), "seen")
    kind = "measure" if made is measure else "margin"
    assert (found.kind, found.unit, found.n) == (kind, made(1.0).unit, 4)


def test_a_difference_is_no_change_when_it_is_as_likely_as_not():
    # Differences of 0.1 and 0.3: t = 2 for 1 degree of freedom, two-sided p = 0.2952; twice that
    # after Holm, for the duration is tested as well.
    found = shift(between(cell([0.5, 0.5]), cell([0.6, 0.8])), "clear")
    assert (found.p, found.changed) == (pytest.approx(2 * 0.29517, abs=1e-4), False)
