"""Cells, expectations, comparisons and surprises from run records."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daemon.judging.assessment import assess, undecided_cells
from daemon.model.assessments import (
    AssessmentRules,
    CellVerdict,
    Expectation,
    RepeatPolicy,
    RunRecord,
    ScenarioComparison,
)
from daemon.model.verdicts import Evidence, Outcome, Verdict
from grammars.text import codec
from tests.daemon.judging.assessment.records import cell, lost, measure, record, timed, verdict

RATE = AssessmentRules(RepeatPolicy(5, "rate", 0.8))
MEAN = AssessmentRules(RepeatPolicy(5, "mean"))


def expecting(wanted: str, **changes: object) -> AssessmentRules:
    base = Expectation("S1", "clear", (), wanted, "known")  # type: ignore[arg-type]
    return AssessmentRules(expectations=(replace(base, **changes),))


def only(declared: AssessmentRules, records: tuple[RunRecord, ...]) -> CellVerdict:
    (found,) = assess(declared, records).cells
    return found.oracles[0]


def test_all_repeats_must_pass_unless_said_otherwise() -> None:
    assert only(AssessmentRules(), cell([0.1] * 5)).verdict is Outcome.PASS
    failed = only(AssessmentRules(), cell([0.1, 0.2, -0.3, -0.1]))
    assert (failed.verdict, failed.passed, failed.failed, failed.n) == (Outcome.FAIL, 2, 2, 4)
    assert failed.worst is not None
    assert (failed.worst.run, failed.worst.verdict.margin) == ("c.S1-a2s-2", -0.3)


def test_statements_do_not_flatter() -> None:
    assert only(AssessmentRules(), cell([0.1] * 5)).statement == "5 of 5 shows at least 54.9 %"
    found = only(RATE, cell([0.1] * 5))
    assert found.statement == "5 of 5 shows at least 54.9 %, 9 more runs needed for 80 %"
    assert (found.verdict, found.needed) == (Outcome.INCONCLUSIVE, 9)
    assert only(RATE, cell([-1.0] * 5)).statement == "0 of 5 shows at most 45 %: less than 80 %"


@pytest.mark.parametrize(
    ("passed", "n", "expected"), [(14, 14, "pass"), (13, 13, "inconclusive"), (3, 10, "fail")]
)
def test_a_rate_passes_when_it_is_shown(passed: int, n: int, expected: str) -> None:
    found = only(RATE, cell([0.1] * passed + [-0.1] * (n - passed)))
    assert found.verdict == expected


def test_looking_again_and_again_asks_for_more() -> None:
    patient = RepeatPolicy(5, "rate", 0.8, until_decided=True, at_most=30)
    assert patient.looks == (5, 10, 20, 30)
    once, often = (only(AssessmentRules(p), cell([0.1] * 14)) for p in (RATE.policy, patient))
    assert once.verdict is Outcome.PASS
    assert often.verdict is Outcome.INCONCLUSIVE
    assert often.at_least < once.at_least
    assert often.statement.endswith("(4 looks)")


def test_the_mean_margin_is_judged_by_its_t_bounds() -> None:
    assert only(MEAN, cell([0.2, 0.3, -0.01, 0.25, 0.3])).verdict is Outcome.PASS
    assert only(MEAN, cell([-0.2, -0.3, 0.01, -0.25, -0.3])).verdict is Outcome.FAIL
    assert only(MEAN, cell([1.0, -0.9])).verdict is Outcome.INCONCLUSIVE
    assert only(MEAN, cell([1.0])).verdict is Outcome.INCONCLUSIVE
    assert only(MEAN, cell([1.0, 1.0, None])).verdict is Outcome.INCONCLUSIVE


def test_a_repeat_nobody_judged_counts_neither_way() -> None:
    found = only(RATE, cell([0.1] * 20 + [None]))
    assert (found.low, found.at_least) < (1.0, 0.9)
    assert found.high == 1.0
    unjudged = only(AssessmentRules(), (*cell([0.1] * 4), lost(4)))
    assert (unjudged.verdict, unjudged.missing, unjudged.n) == (Outcome.INCONCLUSIVE, 1, 5)


def test_nothing_a_crashed_system_did_is_trusted() -> None:
    crashed = record(0, verdict(0.1), outcome=Outcome.ERROR, ended="crashed", note="division")
    result = assess(AssessmentRules(), (crashed,))
    assert result.cells[0].verdict is Outcome.ERROR
    assert result.exit_code == 3
    worst = result.cells[0].oracles[0].worst
    assert worst is not None
    assert worst.verdict.evidence.note == "division"


@pytest.mark.parametrize(
    ("wanted", "margins", "met", "code"),
    [
        ("pass", [1, 1], True, 0),
        ("pass", [1, -1], False, 1),
        ("pass", [1, None], False, 4),
        ("fail", [-1, -1], True, 0),
        ("fail", [-1, 1], False, 1),
        ("fail", [-1, None], False, 4),
        ("mixed", [-1, 1], True, 0),
        ("mixed", [-1, -1], True, 0),
        ("mixed", [1, 1], False, 1),
        ("mixed", [1, None], False, 4),
        ("any", [1, None], True, 0),
        ("any", [-1, -1], True, 0),
    ],
)
def test_an_unmet_expectation_is_red_in_both_directions(
    wanted: str, margins: list[float | None], met: bool, code: int
) -> None:
    result = assess(expecting(wanted), cell(margins))
    assert result.cells[0].oracles[0].met is met
    assert result.exit_code == code
    assert bool(result.surprises) is (code == 1)


def test_a_surprise_says_where_to_look() -> None:
    (surprise,) = assess(AssessmentRules(), cell([0.1, -0.012])).surprises
    assert surprise.run == "c.S1-a2s-1"
    assert surprise.text == "a2s S1 clear  -0.012 m  t=41.3 s  door-17  (1 of 2 fail)"
    (passes,) = assess(expecting("mixed"), cell([0.1, 0.2])).surprises
    assert passes.run == "c.S1-a2s-0"
    assert passes.text == "a2s S1 clear  passes 2 of 2, expected mixed"
    assert passes.why == "known"


def test_expectations_are_patterns_and_the_last_one_counts() -> None:
    failing = cell([-1.0], scenario="S3.2@1003", sut="fro-diff")
    for changes in ({"scenario": "S3.*"}, {"scenario": "S3.2"}, {"scenario": "*", "oracle": "c*"}):
        assert assess(expecting("fail", **{"scenario": "S3.2"} | changes), failing).exit_code == 0
    assert assess(expecting("fail", scenario="S3.2", suts=("a2s",)), failing).exit_code == 1
    assert assess(expecting("fail", scenario="S3.2", suts=("a2s", "fro-*")), failing).exit_code == 0
    general = Expectation("*", "*", (), "pass", "all is well")
    both = (*expecting("fail", scenario="S3.2").expectations, general)
    assert assess(AssessmentRules(expectations=both), failing).exit_code == 1


@pytest.mark.parametrize(("state", "code"), [("lost", 3), ("cancelled", 4), ("queued", 4)])
def test_runs_without_a_result_are_not_as_expected(state: str, code: int) -> None:
    assert assess(AssessmentRules(), (record(0, verdict(1.0)), lost(1, state))).exit_code == code
    assert assess(AssessmentRules(), (record(0, verdict(-1.0)), lost(1, state))).exit_code == 1


def test_a_campaign_that_judges_nothing_decides_nothing() -> None:
    assert assess(AssessmentRules(), ()).exit_code == 4
    assert assess(AssessmentRules(), (record(0, measure(1.0)),)).exit_code == 4


def test_measures_are_told_with_their_interval() -> None:
    runs = tuple(record(i, verdict(1.0), measure(x), took=70.0 + i) for i, x in enumerate((2, 4)))
    buffer, duration = assess(AssessmentRules(), runs).cells[0].measures
    assert (buffer.oracle, buffer.values, buffer.mean) == ("buffer-time", (2.0, 4.0), 3.0)
    assert buffer.std == pytest.approx(2**0.5)
    assert buffer.low == pytest.approx(3.0 - 12.706, abs=1e-3)
    assert (duration.oracle, duration.unit, duration.values) == ("duration", "s", (70.0, 71.0))


def delay(limit: float = 30.0, op: str = "<=", quantity: str = "delay") -> AssessmentRules:
    text = f"{quantity}(A vs B) {op} {limit:g} s"
    sentence = ScenarioComparison("d", quantity, "A", "B", None, op, limit, "s", text)  # type: ignore[arg-type]
    return AssessmentRules(comparisons=(sentence,))


def compared(declared: AssessmentRules, *sides: tuple[RunRecord, ...]):
    (found,) = assess(declared, sum(sides, ())).comparisons
    return found


def test_delays_are_paired_by_repeat() -> None:
    # Each side varies by much more than their differences do.
    found = compared(delay(), timed("A", [108, 209, 311]), timed("B", [100, 200, 300]))
    assert (found.method, found.n, found.differences) == ("paired", 3, (8.0, 9.0, 11.0))
    assert found.verdict is Outcome.PASS
    assert found.high is not None
    assert found.high < 30.0
    assert compared(delay(5), timed("A", [108, 209, 311]), timed("B", [100, 200, 300])).verdict == (
        Outcome.FAIL
    )
    assert compared(delay(10), timed("A", [90, 140]), timed("B", [100, 100])).verdict == (
        Outcome.INCONCLUSIVE
    )


def test_without_pairs_the_means_are_compared() -> None:
    other = tuple(replace(r, seed=r.seed + 100) for r in timed("B", [100, 101, 102]))
    found = compared(delay(), timed("A", [108, 109, 110]), other)
    assert (found.method, found.n, found.mean) == ("welch", 3, pytest.approx(8.0))
    assert found.verdict is Outcome.PASS


def test_a_robot_that_never_arrives_has_no_short_delay() -> None:
    stuck = replace(timed("A", [0, 0, 120])[2], ended="limit")
    left = (*timed("A", [108, 109]), stuck)
    found = compared(delay(), left, timed("B", [100, 100, 100]))
    assert (found.verdict, found.left_out, found.n) == (Outcome.INCONCLUSIVE, 1, 2)
    assert found.note == "1 run did not end the mission"
    gave_up = record(2, verdict(-1.0, "reached", "reached(mission, 0.25 m)"), scenario="A")
    assert (
        compared(delay(), (*timed("A", [108, 109]), gave_up), timed("B", [100] * 3)).left_out == 1
    )


def test_one_pair_decides_nothing() -> None:
    found = compared(delay(), timed("A", [101]), timed("B", [100]))
    assert (found.verdict, found.note) == (Outcome.INCONCLUSIVE, "only one pair")
    assert found.mean == 1.0


def test_measures_are_compared_by_their_name() -> None:
    def side(name: str, values: list[float]) -> tuple[RunRecord, ...]:
        return tuple(record(i, measure(v), scenario=name) for i, v in enumerate(values))

    found = compared(delay(0, ">=", "buffer-time"), side("A", [5, 6.1]), side("B", [4, 5]))
    assert (found.verdict, found.mean) == (Outcome.PASS, pytest.approx(1.05))


def test_comparisons_have_expectations_too() -> None:
    sides = (*timed("A", [200, 201]), *timed("B", [100, 100]))
    unknown = assess(delay(), sides)
    assert unknown.exit_code == 1
    assert unknown.surprises[0].text.startswith("a2s d  +100 s  fail, n=2: delay(A vs B)")
    known = Expectation("A", "d", (), "fail", "the detour is long")
    assert assess(replace(delay(), expectations=(known,)), sides).exit_code == 0


def test_only_cells_that_more_repeats_can_decide_are_repeated() -> None:
    assert undecided_cells(RATE, cell([0.1] * 5)) == (("S1", "a2s"),)
    assert undecided_cells(RATE, cell([0.1] * 14)) == ()
    assert undecided_cells(RATE, (*cell([0.1] * 4), lost(4))) == ()
    assert undecided_cells(RATE, cell([0.1] * 4 + [None])) == ()
    nobody_cares = replace(expecting("any"), policy=RATE.policy)
    assert undecided_cells(nobody_cares, cell([0.1] * 5)) == ()


margins = st.lists(st.one_of(st.none(), st.floats(-1, 1)), min_size=1, max_size=8)
policies = st.sampled_from([RepeatPolicy(), RepeatPolicy(5, "rate", 0.5), RepeatPolicy(5, "mean")])


@settings(max_examples=40, deadline=None)
@given(margins, policies, st.integers(0, 99))
def test_the_order_of_records_does_not_matter(found, policy: RepeatPolicy, seed: int) -> None:
    runs = list(cell(found))
    there = assess(AssessmentRules(policy), runs)
    random.Random(seed).shuffle(runs)
    assert assess(AssessmentRules(policy), runs) == there
    assert codec.from_json(type(there), codec.to_json(there)) == there


@settings(max_examples=40, deadline=None)
@given(margins, policies)
def test_a_better_margin_never_turns_a_pass_into_a_failure(found, policy: RepeatPolicy) -> None:
    better = [None if m is None else m + 0.2 for m in found]
    before, after = (only(AssessmentRules(policy), cell(side)).verdict for side in (found, better))
    assert not (before is Outcome.PASS and after is Outcome.FAIL)
    assert policy.rule == "mean" or before is not Outcome.PASS or after is Outcome.PASS


def test_a_measure_stays_one_beside_a_trace_that_cannot_be_trusted() -> None:
    broken = Verdict("buffer-time", "time(...)", Outcome.ERROR, None, None, "", Evidence())
    runs = (record(0, verdict(0.1), measure(3.0)), record(1, verdict(0.1), broken))
    (found,) = assess(AssessmentRules(), runs).cells
    assert [oracle.oracle for oracle in found.oracles] == ["clear"]
    assert [m.values for m in found.measures if m.oracle == "buffer-time"] == [(3.0,)]
