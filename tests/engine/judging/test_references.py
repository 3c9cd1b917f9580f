"""Reference values beside what runs gave: the same statistic, with its interval."""

import pytest

from daemon.judging.assessment import assess, reference_comparisons
from daemon.judging.statistics import mean_interval, proportion_interval
from daemon.model.assessments import AssessmentRules, ReferenceValue, ScenarioComparison
from tests.engine.judging.records import cell, measure, record, timed, verdict


def reference(oracle, value, **other):
    given = {"scenario": "S1", "suts": (), "statistic": "mean", "unit": "s"} | other
    return ReferenceValue(
        name="paper", source="a paper", oracle=oracle, value=value, text=f"{value}", **given
    )


def test_a_mean_has_deviation_and_the_t_interval():
    runs = timed("S1", (60.0, 62.0, 67.0))
    (found,) = reference_comparisons([reference("duration", 61.0)], assess(AssessmentRules(), runs))
    expected = mean_interval((60.0, 62.0, 67.0))
    assert (found.scenario, found.sut, found.n) == ("S1", "a2s", 3)
    assert (found.value, found.deviation) == (63.0, expected.std)
    assert (found.low, found.high) == (expected.low, expected.high)
    assert found.difference == pytest.approx(2.0)


@pytest.mark.parametrize(("statistic", "value"), [("min", 1.0), ("median", 2.0), ("max", 9.0)])
def test_of_other_statistics_there_is_no_interval(statistic, value):
    runs = [record(i, verdict(1.0), measure(v)) for i, v in enumerate((2.0, 9.0, 1.0))]
    wanted = reference("buffer-time", 0.5, statistic=statistic)
    (found,) = reference_comparisons([wanted], assess(AssessmentRules(), runs))
    assert (found.value, found.low, found.high) == (value, None, None)


def test_a_count_has_the_exact_interval_of_its_rate():
    assessment = assess(AssessmentRules(), cell((1.0, 1.0, -1.0, 1.0)))
    wanted = reference("clear", 0.6, statistic="rate", unit="1")
    (found,) = reference_comparisons([wanted], assessment)
    assert (found.n, found.value) == (4, 0.75)
    assert (found.low, found.high) == proportion_interval(3, 4)


def test_a_run_that_was_not_judged_may_have_been_either():
    assessment = assess(AssessmentRules(), cell((1.0, None)))
    wanted = reference("clear", 1.0, statistic="rate", unit="1")
    (found,) = reference_comparisons([wanted], assessment)
    assert (found.low, found.high) == (proportion_interval(1, 2)[0], proportion_interval(2, 2)[1])


def test_a_comparison_stands_beside_its_pairs():
    asked = ScenarioComparison("delay-1", "delay", "S2", "S1", None, "<=", 30.0, "s", "delay(...)")
    runs = (*timed("S1", (60.0, 61.0)), *timed("S2", (70.0, 73.0)))
    assessment = assess(AssessmentRules(comparisons=(asked,)), runs)
    (found,) = reference_comparisons([reference("delay-1", -8.9, scenario="")], assessment)
    assert (found.scenario, found.n, found.value) == ("", 2, 11.0)
    assert found.difference == pytest.approx(19.9)


def test_patterns_speak_of_several_cells_and_of_variants():
    runs = (
        *timed("S3.1", (1.0, 2.0)),
        *timed("S3.2@7", (3.0, 4.0)),
        *timed("S3.1", (5.0, 6.0), sut="fro-diff"),
        *timed("S1", (7.0, 8.0)),
    )
    wanted = reference("duration", 0.0, scenario="S3.?", suts=("a2s",))
    found = reference_comparisons([wanted], assess(AssessmentRules(), runs))
    assert [(each.scenario, each.sut) for each in found] == [("S3.1", "a2s"), ("S3.2@7", "a2s")]


def test_what_nobody_measured_is_said_so():
    assessment = assess(AssessmentRules(), cell((1.0,)))
    (found,) = reference_comparisons([reference("buffer-time", 3.0)], assessment)
    assert (found.n, found.value, found.difference) == (0, None, None)
