"""The statistics against scipy.stats and against their definitions."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from daemon.judging.statistics import (
    at_least,
    at_most,
    chance_correlation,
    cliffs_delta,
    effect_magnitude,
    holm_adjusted,
    mean_difference,
    mean_interval,
    proportion_interval,
    runs_needed,
)

counts = st.integers(1, 60).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))
values = st.lists(st.floats(-1e3, 1e3).map(lambda x: round(x, 3)), min_size=2, max_size=12)


def paired(left, right, confidence=0.95):
    return mean_difference(dict(enumerate(left)), dict(enumerate(right)), confidence)


def unpaired(left, right):
    return mean_difference(dict(enumerate(left)), dict(enumerate(right, len(left))))


@pytest.fixture(scope="module")
def stats():
    """scipy.stats, imported by the process that runs these tests: all of them read this file."""
    from scipy import stats

    return stats


@given(counts, st.sampled_from([0.8, 0.95, 0.99]))
def test_the_interval_of_a_rate_is_that_of_clopper_and_pearson(stats, count, level):
    passed, n = count
    exact = stats.binomtest(passed, n).proportion_ci(level, method="exact")
    assert proportion_interval(passed, n, level) == pytest.approx((exact.low, exact.high), abs=1e-9)
    low = stats.binomtest(passed, n, alternative="greater").proportion_ci(level, method="exact").low
    assert at_least(passed, n, level) == pytest.approx(low, abs=1e-9)
    assert at_most(n - passed, n, level) == pytest.approx(1.0 - low, abs=1e-9)
    assert at_least(10**6, 10**6) == pytest.approx(0.05**1e-6, abs=1e-13)


def test_no_runs_show_nothing_and_no_number_of_runs_shows_certainty():
    assert proportion_interval(0, 0) == (0.0, 1.0)
    assert runs_needed(5, 5, 1.0) is None
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
    assert chance_correlation(2) == chance_correlation(3, 3) == chance_correlation(0) == 1.0


@given(values, st.sampled_from([0.1, 0.49, 0.9, 0.95]))
def test_the_interval_of_a_mean_is_students(stats, sample, level):
    assume(max(sample) - min(sample) > 1e-2)
    found = mean_interval(sample, level)
    expected = stats.ttest_1samp(sample, 0.0).confidence_interval(level)
    assert (found.low, found.high) == pytest.approx(
        (expected.low, expected.high), rel=1e-7, abs=1e-7
    )
    assert found.std == pytest.approx(np.std(sample, ddof=1))


def test_one_value_has_no_interval():
    found = mean_interval([4.0])
    assert (found.mean, found.std, found.low, found.high) == (4.0, None, None, None)
    with pytest.raises(ValueError, match="no values"):
        mean_interval([])


def test_pairs_are_preferred_and_two_values_on_each_side_needed():
    left, right = {(1,): 3.0, (2,): 5.0, (3,): 99.0}, {(1,): 1.0, (2,): 2.0, (4,): -99.0}
    shared = mean_difference(left, right)
    assert (shared.method, shared.n, shared.mean) == ("paired", 2, 2.5)
    welch = mean_difference(left, {(7,): 1.0, (8,): 2.0})
    assert (welch.method, welch.n, welch.mean) == ("welch", 2, pytest.approx(107 / 3 - 1.5))
    assert mean_difference(left, {(1,): 1.0}) is None
    assert mean_difference(left, {(7,): 1.0}) is None
    assert mean_difference({(7,): 1.0}, left) is None


def agrees(stats, found, greater, less):
    assert found.low == pytest.approx(greater.confidence_interval(0.95).low, rel=1e-6, abs=1e-7)
    assert found.high == pytest.approx(less.confidence_interval(0.95).high, rel=1e-6, abs=1e-7)
    assert found.freedom == pytest.approx(greater.df)
    assert found.p_above(0.0) == pytest.approx(greater.pvalue, abs=1e-9)
    assert found.p_below(0.0) == pytest.approx(less.pvalue, abs=1e-9)
    smaller = min(greater.pvalue, less.pvalue)
    assert found.p_different == pytest.approx(2.0 * smaller, rel=1e-6, abs=1e-12)
    limit = found.mean + found.error
    assert found.p_above(limit) == pytest.approx(stats.t.cdf(1.0, found.freedom), rel=1e-6)
    assert found.p_below(limit) == pytest.approx(stats.t.sf(1.0, found.freedom), rel=1e-6)


@given(
    st.lists(st.tuples(st.integers(-9999, 9999), st.integers(-9999, 9999)), min_size=2, max_size=9)
)
def test_a_paired_difference_is_the_one_sided_t_test(stats, pairs):
    assume(len({a - b for a, b in pairs}) > 1)
    left, right = ([pair[side] / 8 for pair in pairs] for side in (0, 1))
    tests = [stats.ttest_rel(left, right, alternative=side) for side in ("greater", "less")]
    agrees(stats, paired(left, right), *tests)
    # A bound that is to hold with less than even odds lies on the other side of the mean.
    assert paired(left, right, 0.3).high == pytest.approx(
        tests[1].confidence_interval(0.3).high, rel=1e-6, abs=1e-7
    )


@given(values, values)
def test_without_pairs_it_is_welchs(stats, left, right):
    assume(min(np.ptp(left), np.ptp(right)) > 1.0)
    agrees(
        stats,
        unpaired(left, right),
        *(
            stats.ttest_ind(left, right, equal_var=False, alternative=side)
            for side in ("greater", "less")
        ),
    )


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


def test_nothing_is_larger_than_nothing():
    for left, right in (([], [1.0]), ([1.0], []), ([], [])):
        with pytest.raises(ValueError, match="both sides"):
            cliffs_delta(left, right)
    assert holm_adjusted([]) == ()


def test_magnitudes_have_words():
    """Romano et al.: 0.147, 0.33 and 0.474 belong to the larger effect."""
    for word, deltas in {
        "negligible": (0.0, 0.146),
        "small": (-0.2, 0.147),
        "medium": (0.4, -0.33, 0.473),
        "large": (-1.0, 0.474),
    }.items():
        assert {effect_magnitude(delta) for delta in deltas} == {word}


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
