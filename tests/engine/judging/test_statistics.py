"""The statistics against scipy.stats and against their definitions."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from daemon.judging.statistics import (
    MeanDifference,
    at_least,
    at_most,
    chance_correlation,
    cliffs_delta,
    cut_percentage,
    effect_magnitude,
    holm_adjusted,
    mean_difference,
    mean_interval,
    proportion_interval,
    runs_needed,
)

counts = st.integers(0, 60).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))
values = st.lists(st.floats(-1e3, 1e3).map(lambda x: round(x, 3)), min_size=2, max_size=12)


def keyed(values, first=0):
    return {(index,): value for index, value in enumerate(values, first)}


def paired(left, right, confidence=0.95):
    difference = mean_difference(keyed(left), keyed(right), confidence)
    assert difference is not None
    return difference


def unpaired(left, right):
    difference = mean_difference(keyed(left), keyed(right, len(left)))
    assert difference is not None
    return difference


@pytest.fixture(scope="module")
def stats():
    """scipy.stats, imported by the process that runs these tests: all of them read this file."""
    from scipy import stats

    return stats


def test_five_of_five_shows_less_than_people_think():
    assert at_least(5, 5) == pytest.approx(0.549, abs=5e-4)
    assert runs_needed(5, 5, 0.8) == 9
    assert at_least(14, 14) >= 0.8 > at_least(13, 13)


def test_a_lower_bound_never_says_more_than_was_shown():
    assert cut_percentage(at_least(2, 2)) == "22.3 %"  # 0.22361
    assert cut_percentage(0.549) == "54.9 %"
    assert cut_percentage(0.8) == "80 %"


@given(counts, st.sampled_from([0.8, 0.95, 0.99]))
def test_the_interval_is_that_of_clopper_and_pearson(stats, count, level):
    passed, n = count
    assume(n > 0)
    exact = stats.binomtest(passed, n).proportion_ci(level, method="exact")
    assert proportion_interval(passed, n, level) == pytest.approx((exact.low, exact.high), abs=1e-9)
    low = stats.binomtest(passed, n, alternative="greater").proportion_ci(level, method="exact").low
    assert at_least(passed, n, level) == pytest.approx(low, abs=1e-9)


def test_bounds_are_those_of_published_tables():
    """Clopper and Pearson for 8 of 10; Student's t for 10 degrees of freedom, two-sided 95 %."""
    assert proportion_interval(8, 10) == pytest.approx((0.443905, 0.974789), abs=1e-6)
    assert at_least(1_000_000, 1_000_000) == pytest.approx(0.05**1e-6, abs=1e-13)
    eleven = mean_interval([float(n) for n in range(11)])
    assert eleven.high is not None
    assert eleven.high - 5.0 == pytest.approx(2.228139, abs=1e-6)


@given(counts)
def test_a_one_sided_bound_is_where_the_binomial_tail_is_as_likely_as_allowed(stats, count):
    passed, n = count
    assume(passed > 0)
    assert stats.binom.sf(passed - 1, n, at_least(passed, n)) == pytest.approx(0.05, abs=1e-6)
    assert stats.binom.cdf(n - passed, n, at_most(n - passed, n)) == pytest.approx(0.05, abs=1e-6)


def test_no_runs_show_nothing():
    assert proportion_interval(0, 0) == (0.0, 1.0)
    with pytest.raises(ValueError, match="6 of 5"):
        at_least(6, 5)


@given(counts, st.floats(0.05, 0.99))
def test_the_runs_needed_are_enough_and_one_less_is_not(count, rate):
    passed, n = count
    more = runs_needed(passed, n, rate)
    assert isinstance(more, int)
    assert at_least(passed + more, n + more) >= rate
    assert more == 0 or at_least(passed + more - 1, n + more - 1) < rate


def test_correlations_by_chance_are_bounded_by_t_and_f(stats):
    for n in (4, 5, 10, 15, 60):
        t = stats.t.ppf(0.975, n - 2)
        assert chance_correlation(n) == pytest.approx(t / (n - 2 + t * t) ** 0.5)
        f = stats.f.ppf(0.95, 2, n - 3)
        assert chance_correlation(n, 3) == pytest.approx((2 * f / (2 * f + n - 3)) ** 0.5)
    assert chance_correlation(10) == pytest.approx(0.632, abs=1e-3)
    assert chance_correlation(2) == chance_correlation(3, 3) == chance_correlation(0) == 1.0


def test_no_number_of_runs_shows_certainty():
    assert runs_needed(5, 5, 1.0) is None


@given(values)
def test_the_interval_of_a_mean_is_students(stats, sample):
    assume(max(sample) - min(sample) > 1e-2)
    found = mean_interval(sample)
    expected = stats.ttest_1samp(sample, 0.0).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx(
        (expected.low, expected.high), rel=1e-7, abs=1e-7
    )
    assert found.std == pytest.approx(np.std(sample, ddof=1))


@pytest.mark.parametrize("confidence", [0.0, 0.1, 0.4, 0.49, 0.51, 0.9, 0.999])
def test_intervals_of_any_confidence_are_students(stats, confidence):
    for sample in ([1.0, 2.0], [1.0, 2.0, 4.0], [0.1 * k * k for k in range(30)]):
        found = mean_interval(sample, confidence)
        half = stats.t.ppf(0.5 + 0.5 * confidence, len(sample) - 1) * stats.sem(sample)
        assert found.high is not None
        assert found.low is not None
        assert found.high - found.mean == pytest.approx(half, rel=1e-9, abs=1e-12)
        assert found.mean - found.low == pytest.approx(half, rel=1e-9, abs=1e-12)
    # A bound that is to hold with less than even odds lies on the other side of the mean.
    bold = paired([1.0, 2.0, 4.0], [0.0, 0.0, 0.0], 0.5 - 0.5 * confidence)
    expected = stats.t.ppf(0.5 - 0.5 * confidence, 2) * stats.sem([1.0, 2.0, 4.0])
    assert bold.high - bold.mean == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("mean", [0.0, 1e-12, 1e-9, 1e-3, 1.0, 1e3, 1e6, 1e9])
def test_differences_next_to_nothing_and_beyond_doubt_have_their_p_value(stats, mean):
    found = MeanDifference(5, mean, 0.0, 0.0, 1.0, 4.0, "paired")
    assert found.p_above(0.0) == pytest.approx(stats.t.sf(mean, 4), rel=1e-9)
    assert found.p_above(2.0 * mean) == pytest.approx(stats.t.cdf(mean, 4), rel=1e-9)
    assert found.p_below(0.0) == pytest.approx(stats.t.cdf(mean, 4), rel=1e-9)
    assert found.p_below(2.0 * mean) == pytest.approx(stats.t.sf(mean, 4), rel=1e-9)
    assert found.p_different == pytest.approx(2.0 * stats.t.sf(mean, 4), rel=1e-9)


def test_pairs_are_preferred_and_two_values_on_each_side_needed():
    left, right = {(1,): 3.0, (2,): 5.0, (3,): 99.0}, {(1,): 1.0, (2,): 2.0, (4,): -99.0}
    shared = mean_difference(left, right)
    assert shared is not None
    assert (shared.method, shared.n, shared.mean) == ("paired", 2, 2.5)
    strangers = {(7,): 1.0, (8,): 2.0}
    welch = mean_difference(left, strangers)
    assert welch is not None
    assert (welch.method, welch.n, welch.mean) == ("welch", 2, pytest.approx(107 / 3 - 1.5))
    assert mean_difference(left, {(1,): 1.0}) is None
    assert mean_difference(left, {(7,): 1.0}) is None
    assert mean_difference({(7,): 1.0}, left) is None


def test_one_value_has_no_interval():
    found = mean_interval([4.0])
    assert (found.mean, found.std, found.low, found.high) == (4.0, None, None, None)
    with pytest.raises(ValueError, match="no values"):
        mean_interval([])


@given(
    st.lists(st.tuples(st.integers(-9999, 9999), st.integers(-9999, 9999)), min_size=2, max_size=9)
)
def test_a_paired_difference_is_the_one_sided_t_test(stats, pairs):
    assume(len({a - b for a, b in pairs}) > 1)
    left, right = ([pair[side] / 8 for pair in pairs] for side in (0, 1))
    found = paired(left, right)
    greater = stats.ttest_rel(left, right, alternative="greater")
    assert found.low == pytest.approx(greater.confidence_interval(0.95).low, rel=1e-6, abs=1e-7)
    less = stats.ttest_rel(left, right, alternative="less")
    assert found.high == pytest.approx(less.confidence_interval(0.95).high, rel=1e-6, abs=1e-7)
    assert found.p_above(0.0) == pytest.approx(greater.pvalue, abs=1e-9)
    assert found.p_different == pytest.approx(stats.ttest_rel(left, right).pvalue, abs=1e-9)


@given(values, values)
def test_without_pairs_it_is_welchs(stats, left, right):
    assume(min(np.ptp(left), np.ptp(right)) > 1.0)
    found = unpaired(left, right)
    greater = stats.ttest_ind(left, right, equal_var=False, alternative="greater")
    assert found.freedom == pytest.approx(greater.df)
    assert found.p_above(0.0) == pytest.approx(greater.pvalue, abs=1e-9)
    assert found.low == pytest.approx(greater.confidence_interval(0.95).low, rel=1e-6, abs=1e-7)


def test_a_difference_that_never_varies_is_known_exactly():
    found = paired([3.0, 4.0, 5.0], [1.0, 2.0, 3.0])
    assert (found.low, found.mean, found.high) == (2.0, 2.0, 2.0)
    assert (found.p_above(1.9), found.p_above(2.0), found.p_different) == (0.0, 1.0, 0.0)
    assert (found.p_below(2.1), found.p_below(2.0)) == (0.0, 1.0)
    assert paired([1.0, 2.0], [1.0, 2.0]).p_different == 1.0
    assert unpaired([1.0, 1.0], [1.0, 1.0]).high == 0.0


@given(values, values)
def test_cliffs_delta_counts_who_is_larger(left, right):
    pairs = list(itertools.product(left, right))
    expected = sum((a > b) - (a < b) for a, b in pairs) / len(pairs)
    assert cliffs_delta(left, right) == pytest.approx(expected)
    assert cliffs_delta(right, left) == pytest.approx(-expected)


def test_nothing_is_larger_than_nothing():
    for left, right in (([], [1.0]), ([1.0], []), ([], [])):
        with pytest.raises(ValueError, match="both sides"):
            cliffs_delta(left, right)
    assert holm_adjusted([]) == ()


def test_magnitudes_have_words():
    assert [effect_magnitude(d) for d in (0.0, -0.2, 0.4, -1.0)] == [
        "negligible", "small", "medium", "large",
    ]  # fmt: skip
    # Romano et al.: 0.147, 0.33 and 0.474 belong to the larger effect.
    assert [effect_magnitude(d) for d in (0.146, 0.147, -0.33, 0.473, 0.474)] == [
        "negligible", "small", "medium", "medium", "large",
    ]  # fmt: skip


@given(st.lists(st.floats(0.0, 1.0), max_size=8))
def test_holms_adjustment_is_its_definition(ps):
    adjusted = holm_adjusted(ps)
    ordered = sorted(ps)
    for p, found in zip(ps, adjusted, strict=True):
        # The largest of (m - j + 1) p_(j) over every p_(j) that is not larger, and 1 at most.
        upto = len(ordered) - ordered[::-1].index(p)
        assert found == pytest.approx(
            min(1.0, max((len(ps) - j) * ordered[j] for j in range(upto)))
        )
