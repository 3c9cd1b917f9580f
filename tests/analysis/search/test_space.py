"""The space of a search: values as written, equal shares, constraints."""

import math

import numpy as np
import pytest

from daemon.search.space import SearchSpace
from grammars.text.diagnostics import InputError
from tests.analysis.search.spaces import chosen, ranged, search_task


def test_values_are_multiples_of_the_step_in_the_range():
    space = SearchSpace(search_task(ranged(low=0.05, high=0.32, step=0.1)))
    assert [space.at([u])[0] for u in (0.0, 0.33, 0.34, 0.66, 0.67, 1.0)] == [
        0.1, 0.1, 0.2, 0.2, 0.3, 0.3,
    ]  # fmt: skip


def test_every_value_is_as_likely_as_any_other():
    space = SearchSpace(search_task(ranged(low=1, high=3, step=1), chosen("c", "x", "y")))
    shares = (np.arange(600) + 0.5) / 600
    drawn = [space.at([u, u]) for u in shares]
    assert [sum(p[0] == k for p in drawn) for k in (1, 2, 3)] == [200, 200, 200]
    assert sum(p[1] == "x" for p in drawn) == 300


def test_the_logarithm_runs_evenly():
    space = SearchSpace(search_task(ranged(low=0.01, high=1.0, step=0.0, log=True)))
    assert space.at([0.5]) == (0.1,)
    assert SearchSpace(search_task(ranged(low=1, high=4, step=1, log=True))).at([0.5]) == (2.0,)


def test_values_have_no_digits_that_are_not_written():
    space = SearchSpace(search_task(ranged(low=-0.3, high=0.3, step=0.1)))
    values = [space.at([(k + 0.5) / 7])[0] for k in range(7)]
    assert [str(value) for value in values] == ["-0.3", "-0.2", "-0.1", "0.0", "0.1", "0.2", "0.3"]
    (value,) = SearchSpace(search_task(ranged(low=0, high=1, step=0))).at([1 / 3])
    assert value == 0.3333333333


def test_what_is_written_is_kept_though_it_lies_outside():
    space = SearchSpace(search_task(ranged(low=6.0, high=8.0, written=5.0), chosen("b", "x", "y")))
    assert space.written == (5.0, "x")


def test_a_search_of_what_is_written_nowhere_has_no_written_point():
    assert SearchSpace(search_task(ranged(written=None), ranged("b"))).written is None


def test_constraints_compare_what_is_in_different_units():
    space = SearchSpace(
        search_task(
            ranged("doors.closes", unit="s"),
            ranged("doors.opens", unit="min"),
            constraints=("doors.closes + 60 s < doors.opens",),
        )
    )
    assert space.allowed((59.9, 2.0))
    assert not space.allowed((60.0, 2.0))


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        (ranged(low=2.0, high=1.0), "is no range"),
        (ranged(high=math.inf), "is no range"),
        (ranged(low=0.0, log=True), "begins above 0"),
    ],
)
def test_a_range_that_makes_no_sense_is_told(parameter, words):
    with pytest.raises(ValueError, match=words):
        SearchSpace(search_task(parameter))


def test_words_are_not_compared():
    with pytest.raises(InputError, match='"b" is not varied here'):
        SearchSpace(search_task(ranged(), chosen("b", "x", "y"), constraints=("a < b",)))
