"""Cells, expectations, comparisons and surprises from run records."""

import random
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.judging.assessment import assess, evidence_text, undecided_cells
from daemon.model.assessments import (
    AssessmentRules,
    Expectation,
    RepeatPolicy,
)
from daemon.model.verdicts import Evidence, Outcome, Verdict
from grammars.text import codec
from tests.engine.judging.assessment.records import cell, lost, measure, record, verdict

RATE = AssessmentRules(RepeatPolicy(5, "rate", 0.8))
MEAN = AssessmentRules(RepeatPolicy(5, "mean"))


def expecting(wanted, **changes):
    base = Expectation("S1", "clear", (), wanted, "known")
    return AssessmentRules(expectations=(replace(base, **changes),))


def only(declared, records):
    (found,) = assess(declared, records).cells
    return found.oracles[0]


def test_all_repeats_must_pass_unless_said_otherwise():
    assert only(AssessmentRules(), cell([0.1] * 5)).verdict is Outcome.PASS
    failed = only(AssessmentRules(), cell([0.1, 0.2, -0.3, -0.1]))
    assert (failed.verdict, failed.passed, failed.failed, failed.n) == (Outcome.FAIL, 2, 2, 4)
    assert failed.worst is not None
    assert (failed.worst.run, failed.worst.verdict.margin) == ("c.S1-a2s-2", -0.3)


def test_statements_do_not_flatter():
    assert only(AssessmentRules(), cell([0.1] * 5)).statement == "5 of 5 shows at least 54.9 %"
    found = only(RATE, cell([0.1] * 5))
    assert found.statement == "5 of 5 shows at least 54.9 %, 9 more runs needed for 80 %"
    assert (found.verdict, found.needed) == (Outcome.INCONCLUSIVE, 9)
    assert only(RATE, cell([-1.0] * 5)).statement == "0 of 5 shows at most 45 %: less than 80 %"


@pytest.mark.parametrize(
    ("passed", "n", "expected"), [(14, 14, "pass"), (13, 13, "inconclusive"), (3, 10, "fail")]
)
def test_a_rate_passes_when_it_is_shown(passed, n, expected):
    found = only(RATE, cell([0.1] * passed + [-0.1] * (n - passed)))
    assert found.verdict == expected


def test_looking_again_and_again_asks_for_more():
    patient = RepeatPolicy(5, "rate", 0.8, until_decided=True, at_most=30)
    assert patient.looks == (5, 10, 20, 30)
    once, often = (only(AssessmentRules(p), cell([0.1] * 14)) for p in (RATE.policy, patient))
    assert once.verdict is Outcome.PASS
    assert often.verdict is Outcome.INCONCLUSIVE
    assert often.at_least < once.at_least
    assert often.statement.endswith("(4 looks)")


def test_the_mean_margin_is_judged_by_its_t_bounds():
    assert only(MEAN, cell([0.2, 0.3, -0.01, 0.25, 0.3])).verdict is Outcome.PASS
    assert only(MEAN, cell([-0.2, -0.3, 0.01, -0.25, -0.3])).verdict is Outcome.FAIL
    assert only(MEAN, cell([1.0, -0.9])).verdict is Outcome.INCONCLUSIVE
    assert only(MEAN, cell([1.0])).verdict is Outcome.INCONCLUSIVE
    assert only(MEAN, cell([1.0, 1.0, None])).verdict is Outcome.INCONCLUSIVE
    assert only(MEAN, cell([0.1, -0.1, 0.05])).verdict is Outcome.INCONCLUSIVE
    bound = record(2, replace(verdict(None), lower=1.0))
    assert only(MEAN, (*cell([1.0, 1.0]), bound)).verdict is Outcome.INCONCLUSIVE
    assert only(MEAN, cell([0.0, 0.0])).verdict is Outcome.PASS
    assert only(MEAN, cell([-0.1, -0.1])).verdict is Outcome.FAIL


def test_a_mean_that_is_looked_at_more_often_needs_more():
    # 2.132 and 3.495 are Student's t for 4 degrees of freedom, one-sided 5 % and 1.25 %.
    margins = [2.8 + d for d in (-2.0, -1.0, 0.0, 1.0, 2.0)]
    often = AssessmentRules(RepeatPolicy(5, "mean", until_decided=True, at_most=30))
    for rules, shown in ((MEAN, 2.132 * 0.5**0.5), (often, 3.495 * 0.5**0.5)):
        barely = [m - 2.8 + shown + 0.01 for m in margins]
        assert only(rules, cell(barely)).verdict is Outcome.PASS
        assert only(rules, cell([m - 0.02 for m in barely])).verdict is Outcome.INCONCLUSIVE
        assert only(rules, cell([-m for m in barely])).verdict is Outcome.FAIL


def test_a_repeat_nobody_judged_counts_neither_way():
    found = only(RATE, cell([0.1] * 20 + [None]))
    assert (found.low, found.at_least) < (1.0, 0.9)
    assert found.high == 1.0
    unjudged = only(AssessmentRules(), (*cell([0.1] * 4), lost(4)))
    assert (unjudged.verdict, unjudged.missing, unjudged.n) == (Outcome.INCONCLUSIVE, 1, 5)


def test_nothing_a_crashed_system_did_is_trusted():
    crashed = record(0, verdict(0.1), outcome=Outcome.ERROR, ended="crashed", note="division")
    result = assess(AssessmentRules(), (crashed,))
    assert result.cells[0].verdict is Outcome.ERROR
    assert result.exit_code == 3
    worst = result.cells[0].oracles[0].worst
    assert worst is not None
    assert worst.verdict.evidence.note == "division"


@pytest.mark.parametrize(
    ("wanted", "margins", "status", "code"),
    [
        ("pass", [1, 1], "met", 0),
        ("pass", [1, -1], "contradicted", 1),
        ("pass", [1, None], "open", 4),
        ("fail", [-1, -1], "met", 0),
        ("fail", [-1, 1], "contradicted", 1),
        ("fail", [-1, None], "open", 4),
        ("mixed", [-1, 1], "met", 0),
        ("mixed", [-1, -1], "met", 0),
        ("mixed", [1, 1], "contradicted", 1),
        ("mixed", [1, None], "open", 4),
        ("any", [1, None], "met", 0),
        ("any", [-1, -1], "met", 0),
    ],
)
def test_an_unmet_expectation_is_red_in_both_directions(wanted, margins, status, code):
    result = assess(expecting(wanted), cell(margins))
    assert result.cells[0].oracles[0].status == status
    assert result.exit_code == code
    assert bool(result.surprises) is (code == 1)


def test_a_surprise_says_where_to_look():
    (surprise,) = assess(AssessmentRules(), cell([0.1, -0.012])).surprises
    assert surprise.run == "c.S1-a2s-1"
    assert surprise.text == "a2s S1 clear  −0.012 m  at 41.3 s  door-17  (1 of 2 fail)"
    (passes,) = assess(expecting("mixed"), cell([0.1, 0.2])).surprises
    assert passes.run == "c.S1-a2s-0"
    assert passes.text == "a2s S1 clear  passes 2 of 2, expected mixed"
    assert (passes.why, passes.repeat) == ("known", 0)
    (all_fail,) = assess(AssessmentRules(), cell([-0.1, -0.012])).surprises
    assert (all_fail.run, all_fail.repeat) == ("c.S1-a2s-0", 0)
    assert all_fail.text == "a2s S1 clear  −0.1 m  at 41.3 s  door-17"


def test_expectations_are_patterns_and_the_last_one_counts():
    failing = cell([-1.0], scenario="S3.2@1003", sut="fro-diff")
    for changes in ({"scenario": "S3.*"}, {"scenario": "S3.2"}, {"scenario": "*", "oracle": "c*"}):
        assert assess(expecting("fail", **{"scenario": "S3.2"} | changes), failing).exit_code == 0
    assert assess(expecting("fail", scenario="S3.2", suts=("a2s",)), failing).exit_code == 1
    assert assess(expecting("fail", scenario="S3.2", suts=("a2s", "fro-*")), failing).exit_code == 0
    general = Expectation("*", "*", (), "pass", "all is well")
    both = (*expecting("fail", scenario="S3.2").expectations, general)
    assert assess(AssessmentRules(expectations=both), failing).exit_code == 1


def test_the_passing_run_that_surprises_is_of_the_same_cell_and_oracle():
    runs = (
        *cell([1.0], scenario="S0"),
        *cell([1.0], sut="b"),
        record(0, verdict(1.0, "near"), verdict(-1.0)),
        record(1, verdict(1.0, "near"), verdict(None)),
        record(2, verdict(1.0, "near"), verdict(1.0)),
    )
    (found,) = assess(expecting("fail", suts=("a2s",)), runs).surprises
    assert (found.run, found.repeat) == ("c.S1-a2s-2", 2)
    assert (found.scenario, found.sut, found.oracle) == ("S1", "a2s", "clear")


def test_evidence_is_told_as_far_as_it_goes():
    seen = Evidence(time=12.34, object="door-17", note="last pose")
    text = "always(...)"
    full = Verdict("o", text, Outcome.FAIL, -0.25, -0.25, "m", seen)
    assert evidence_text(full) == "−0.25 m  at 12.3 s  door-17  last pose"
    assert evidence_text(replace(full, unit="1", evidence=Evidence())) == "−0.25"
    assert evidence_text(replace(full, unit="", upper=0.5, evidence=Evidence(time=0.0))) == (
        "+0.5  at 0.0 s"
    )
    assert evidence_text(replace(full, upper=None)) == "at 12.3 s  door-17  last pose"


@pytest.mark.parametrize(("state", "code"), [("lost", 3), ("cancelled", 4), ("queued", 4)])
def test_runs_without_a_result_are_not_as_expected(state, code):
    assert assess(AssessmentRules(), (record(0, verdict(1.0)), lost(1, state))).exit_code == code
    assert assess(AssessmentRules(), (record(0, verdict(-1.0)), lost(1, state))).exit_code == 1


def test_a_cell_without_oracles_is_as_its_runs_were():
    (broken,) = assess(AssessmentRules(), (record(0, measure(1.0)), lost(1))).cells
    assert broken.verdict is Outcome.ERROR
    error = record(1, measure(1.0), outcome=Outcome.ERROR)
    assert assess(AssessmentRules(), (record(0, measure(1.0)), error)).cells[0].verdict == "error"
    (silent,) = assess(AssessmentRules(), (record(0, measure(1.0)), lost(1, "queued"))).cells
    assert silent.verdict is Outcome.INCONCLUSIVE


def test_a_silent_cell_beside_one_that_passes_decides_nothing():
    spoken, silent = cell([1.0]), (record(0, measure(1.0), scenario="S2"),)
    assert assess(AssessmentRules(), spoken).exit_code == 0
    assert assess(AssessmentRules(), (*spoken, *silent)).exit_code == 4


def test_a_cell_is_called_by_its_gravest_oracle():
    error = Verdict("seen", "always(...)", Outcome.ERROR, None, None, "m", Evidence())
    good, bad, open_yet = verdict(1.0, "a"), verdict(-1.0, "b"), verdict(None, "c")
    for verdicts, expected in (
        ((good, error, bad, open_yet), Outcome.FAIL),
        ((good, open_yet, error), Outcome.ERROR),
        ((good, open_yet), Outcome.INCONCLUSIVE),
        ((good, verdict(0.0, "d")), Outcome.PASS),
    ):
        (found,) = assess(AssessmentRules(), (record(0, *verdicts),)).cells
        assert found.verdict is expected
        assert [o.oracle for o in found.oracles] == [v.oracle for v in verdicts]


def test_all_repeats_fail_before_they_are_in_error_and_before_they_are_open():
    error = Verdict("clear", "always(...)", Outcome.ERROR, None, None, "m", Evidence())
    repeats = [record(0, verdict(1.0)), record(1, verdict(None)), record(2, error)]
    counted = only(AssessmentRules(), tuple(repeats))
    assert (counted.verdict, counted.passed, counted.errors) == (Outcome.ERROR, 1, 1)
    assert (counted.inconclusive, counted.failed, counted.missing) == (1, 0, 0)
    assert counted.worst is not None
    assert counted.worst.repeat == 2
    assert only(AssessmentRules(), (*repeats, record(3, verdict(-1.0)))).verdict is Outcome.FAIL
    # What is shown is shown, whatever the broken repeats would have been.
    enough = (*cell([0.1] * 29), record(29, error))
    assert only(RATE, enough).verdict is Outcome.PASS
    assert only(RATE, enough[24:]).verdict is Outcome.ERROR
    assert only(MEAN, enough).verdict is Outcome.ERROR


def test_of_two_failures_the_deeper_one_is_shown_and_an_unknown_margin_last():
    unknown = replace(verdict(-0.1), upper=None)
    runs = (record(0, unknown), record(1, verdict(-0.1)), record(2, verdict(-0.3)))
    passing = cell([0.1, 0.0, 0.2])
    for records, run in ((runs, 2), (runs[:2], 1), (runs[:1], 0), (passing, 1)):
        worst = only(AssessmentRules(), records).worst
        assert worst is not None
        assert worst.repeat == run


def test_pass_rates_are_bounded_from_both_sides():
    # Clopper and Pearson for 8 of 10: 0.4439 to 0.9748, two-sided; 0.4931 at least, one-sided.
    found = only(RATE, cell([0.1] * 8 + [-0.1] * 2))
    assert (found.low, found.high) == (
        pytest.approx(0.443905, abs=1e-6),
        pytest.approx(0.974789, abs=1e-6),
    )
    assert found.at_least == pytest.approx(0.493099, abs=1e-6)
    assert only(AssessmentRules(), cell([0.1] * 5)).needed is None


def test_statements_say_what_is_shown_and_what_is_missing():
    for passed, failed, statement in (
        (1, 9, "1 of 10 shows at least 0.5 %, at most 39.4 %: less than 80 %"),
        (13, 0, "13 of 13 shows at least 79.4 %, 1 more run needed for 80 %"),
        (14, 0, "14 of 14 shows at least 80.7 %"),
    ):
        found = only(RATE, cell([0.1] * passed + [-0.1] * failed))
        assert found.statement == statement
    assert only(AssessmentRules(), cell([-1.0] * 5)).statement == "0 of 5 shows at most 45 %"


def test_a_campaign_that_judges_nothing_decides_nothing():
    assert assess(AssessmentRules(), ()).exit_code == 4
    assert assess(AssessmentRules(), (record(0, measure(1.0)),)).exit_code == 4


def test_measures_are_told_with_their_interval():
    runs = tuple(record(i, verdict(1.0), measure(x), took=70.0 + i) for i, x in enumerate((2, 4)))
    buffer, duration = assess(AssessmentRules(), runs).cells[0].measures
    assert (buffer.oracle, buffer.values, buffer.mean) == ("buffer-time", (2.0, 4.0), 3.0)
    assert buffer.std == pytest.approx(2**0.5)
    assert buffer.low == pytest.approx(3.0 - 12.706, abs=1e-3)
    assert (duration.oracle, duration.unit, duration.values) == ("duration", "s", (70.0, 71.0))
    assert (buffer.unit, buffer.repeats, duration.repeats) == ("s", (0, 1), (0, 1))


def test_only_runs_that_have_a_value_are_measured():
    runs = (
        record(0, measure(2.0), verdict(1.0, "far"), ended="crashed"),
        record(1, verdict(1.0, "far")),
        record(2, measure(4.0)),
        lost(3),
    )
    found = {
        m.oracle: (m.repeats, m.values) for m in assess(AssessmentRules(), runs).cells[0].measures
    }
    assert found == {"buffer-time": ((2,), (4.0,)), "duration": ((1, 2), (60.0, 60.0))}
    # A measure of this name takes the place of the one that every run has.
    own = record(0, measure(7.0, "duration", "1"), took=60.0)
    (only_one,) = assess(AssessmentRules(), (own,)).cells[0].measures
    assert (only_one.unit, only_one.values) == ("1", (7.0,))


def test_only_cells_that_more_repeats_can_decide_are_repeated():
    assert undecided_cells(RATE, cell([0.1] * 5)) == (("S1", "a2s"),)
    assert undecided_cells(RATE, cell([0.1] * 14)) == ()
    assert undecided_cells(RATE, (*cell([0.1] * 4), lost(4))) == ()
    assert undecided_cells(RATE, cell([0.1] * 4 + [None])) == ()
    assert undecided_cells(RATE, (*cell([0.1] * 14), *cell([0.1] * 3, scenario="S2"))) == (
        ("S2", "a2s"),
    )
    assert undecided_cells(AssessmentRules(), cell([0.1, -0.1])) == ()
    nobody_cares = replace(expecting("any"), policy=RATE.policy)
    assert undecided_cells(nobody_cares, cell([0.1] * 5)) == ()


margins = st.lists(st.one_of(st.none(), st.floats(-1, 1)), min_size=1, max_size=8)
policies = st.sampled_from([RepeatPolicy(), RepeatPolicy(5, "rate", 0.5), RepeatPolicy(5, "mean")])


@given(margins, policies, st.integers(0, 99))
def test_the_order_of_records_does_not_matter(found, policy, seed):
    runs = list(cell(found))
    there = assess(AssessmentRules(policy), runs)
    random.Random(seed).shuffle(runs)
    assert assess(AssessmentRules(policy), runs) == there
    assert codec.from_json(type(there), codec.to_json(there)) == there


@given(margins, policies)
def test_a_better_margin_never_turns_a_pass_into_a_failure(found, policy):
    better = [None if m is None else m + 0.2 for m in found]
    before, after = (only(AssessmentRules(policy), cell(side)).verdict for side in (found, better))
    assert not (before is Outcome.PASS and after is Outcome.FAIL)
    assert policy.rule == "mean" or before is not Outcome.PASS or after is Outcome.PASS


def test_a_measure_stays_one_beside_a_trace_that_cannot_be_trusted():
    broken = Verdict("buffer-time", "time(...)", Outcome.ERROR, None, None, "", Evidence())
    runs = (record(0, verdict(0.1), measure(3.0)), record(1, verdict(0.1), broken))
    (found,) = assess(AssessmentRules(), runs).cells
    assert [oracle.oracle for oracle in found.oracles] == ["clear"]
    assert [m.values for m in found.measures if m.oracle == "buffer-time"] == [(3.0,)]
