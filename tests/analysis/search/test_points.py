"""How far points are from the scenario as written."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.model.search import SearchParameter
from daemon.search.points import (
    change_size,
    changed_parameters,
    distance_from_written,
    taken_back,
    value_between,
)
from tests.analysis.search.pretended import make_task, seconds

A = seconds("doors.a")
NOISE = SearchParameter(
    "robot.laser.noise", "robot", 0, "laser.noise", "m", 0.01, 0.04, 0.001, True, written=0.02
)
LEADING = SearchParameter(
    "doors.leading", "behaviours", 0, "leading", choices=("one", "two"), written="one"
)


def test_changes_are_shares_of_their_ranges():
    assert change_size(A, 7.5) == pytest.approx(0.25)
    assert change_size(NOISE, 0.04) == pytest.approx(0.5), "by its logarithm"
    assert change_size(LEADING, "two") == 1.0
    task = make_task(A, NOISE, LEADING)
    assert distance_from_written(task, (7.5, 0.04, "two")) == pytest.approx(1.75)
    assert changed_parameters(task, (5.0, 0.04, "one")) == (1,)
    assert taken_back(task, (7.5, 0.04, "two"), (0, 2)) == (5.0, 0.04, "one")


def test_sums_of_steps_are_as_written():
    assert changed_parameters(make_task(seconds("doors.a", 0.3)), (0.1 + 0.2,)) == ()


def test_what_is_written_nowhere_does_not_change():
    task = make_task(seconds("doors.a", None))
    assert changed_parameters(task, (3.0,)) == ()
    assert taken_back(task, (3.0,), (0,)) == (3.0,)


def test_there_is_nothing_between_neighbours_and_choices():
    assert value_between(A, 5.0, 5.01) is None
    assert value_between(A, 5.0, 5.02) == 5.01
    assert value_between(LEADING, "one", "two") is None
    assert value_between(NOISE, 0.01, 0.04) == 0.02
    assert value_between(dataclasses.replace(A, step=0.0), 5.0, 6.0) == 5.5


@given(st.integers(0, 1000), st.integers(0, 1000))
def test_halving_ends_at_neighbouring_steps(failing, passing):
    low, high = 0.01 * failing, 0.01 * passing
    halvings = 0
    while (value := value_between(A, low, high)) is not None:
        assert min(low, high) < float(value) < max(low, high)
        low, halvings = float(value), halvings + 1
    assert halvings <= 10
    assert abs(low - high) < 0.0101
