"""Delta debugging: laws that hold for any failure."""

from collections.abc import Callable
from itertools import pairwise

from hypothesis import assume, given
from hypothesis import strategies as st

from daemon.analysis.blame import ddmin

Test = Callable[[tuple[int, ...]], bool]


def asks(fails):
    return lambda tried: next((i for i, one in enumerate(tried) if fails(one)), None)


def least(items, fails):
    found = tuple(items)
    for found in ddmin(items, asks(fails)):
        assert fails(found), "every configuration on the way fails"
    return found


SIZES = st.integers(0, 40)
CAUSES = st.sets(st.integers(0, 39), max_size=5)


@given(SIZES, CAUSES)
def test_the_cause_of_a_monotone_failure_is_found_exactly(size, cause):
    cause = {item for item in cause if item < size}
    assert least(range(size), lambda kept: cause <= set(kept)) == tuple(sorted(cause))


@given(st.integers(1, 12), st.randoms(use_true_random=False))
def test_what_is_left_is_1_minimal_whatever_fails(size, chance):
    whole, verdicts = tuple(range(size)), {}

    def fails(kept):
        if kept == whole:
            return True
        return verdicts.setdefault(kept, chance.random() < 0.3)

    left = least(whole, fails)
    for index in range(len(left)):
        assert not fails(left[:index] + left[index + 1 :])


@given(SIZES, CAUSES)
def test_order_is_kept_and_every_step_is_smaller(size, cause):
    assume(cause & set(range(size)))
    steps = [tuple(range(size)), *ddmin(range(size), asks(lambda kept: bool(cause & set(kept))))]
    assert all(list(step) == sorted(step) for step in steps)
    assert all(len(late) < len(early) for early, late in pairwise(steps))


def test_one_cause_among_many_takes_few_tests():
    asked = []

    def fails(kept):
        asked.append(kept)
        return 777 in kept

    *_, last = ddmin(range(1024), asks(fails))
    assert last == (777,)
    assert len(asked) <= 2 * 10 + 1, "halving, not walking"
