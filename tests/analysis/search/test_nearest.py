"""The nearest failure, found by functions instead of runs, and distances from what is written."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.search.nearest import NEAREST_POINTS, find_nearest
from daemon.search.point_runner import PointRunner
from daemon.search.points import (
    change_size,
    changed_parameters,
    distance_from_written,
    taken_back,
    value_between,
)
from tests.analysis.search.searches import PretendedCase, chosen, make_task, ranged

A, B = ranged("doors.a"), ranged("doors.b")
TWELVE = make_task(*(ranged(f"doors.time{i}") for i in range(12)))
NOISE = ranged("robot.laser.noise", 0.01, 0.04, 0.001, unit="m", log=True, written=0.02)
LEADING = chosen("doors.leading", "bedroom", "kitchen")


class Search:
    """Points of a task with these margins that were run; those of ``chance`` fail by chance.

    They fail with one noise and pass by 0.05 with all others.
    """

    def __init__(self, task, margin, *points, chance=lambda _: False, allowed=lambda _: True):
        def margin_of(point, repeat):
            return 0.05 if repeat and chance(point) else margin(point)

        case = PretendedCase(task, margin_of)
        self.runs = case.runs()
        self.points = PointRunner(case, self.runs, allowed)
        written = tuple(p.written for p in task.parameters)
        if None not in written and allowed(written):
            points = (written, *points)
        trials = self.points.results([(point, "") for point in points], "explore")
        self.failures = [trial for trial in trials if trial.fails]

    def nearest(self, **influence):
        return find_nearest(self.points, self.failures, influence)

    def run_in(self, phase):
        return [one.values for one in self.runs.proposals if one.phase == phase]


def nearest(task, margin, *points, **more):
    return Search(task, margin, *points, **more).nearest()


def fails_from(index, edge):
    """Margins of a failure that begins where a parameter reaches an edge."""
    return lambda point: -0.02 if float(point[index]) >= edge else 0.1


def test_twelve_changes_come_down_to_the_one_that_matters():
    search = Search(TWELVE, fails_from(7, 5.37), (6.5,) * 12)
    found = search.nearest()
    assert found.result.point == (*(5.0,) * 7, 5.37, *(5.0,) * 4)
    assert found.passes.point == (*(5.0,) * 7, 5.36, *(5.0,) * 4)
    assert found.complete
    assert len(search.run_in("nearest")) <= 20


def test_changes_that_are_only_enough_together_stay_together():
    def margin(point):
        return 0.1 if min(point[2], point[9]) < 6.0 else -0.02

    found = nearest(TWELVE, margin, tuple(6.5 + 0.01 * n for n in range(12)))
    assert found.result.point == tuple(6.0 if n in (2, 9) else 5.0 for n in range(12))
    assert found.complete


def test_of_changes_each_of_which_is_enough_the_one_of_most_influence_stays():
    def margin(point):
        return 0.1 if max(point) < 6.0 else -0.02

    task = make_task(*(ranged(f"time{i}") for i in range(3)))
    search = Search(task, margin, (6.5, 6.5, 6.5))
    assert search.nearest(time0=-0.9, time1=0.2, time2=0.1).result.point == (6.0, 5.0, 5.0)


def test_it_begins_with_the_smallest_change_and_tries_the_worst_failure_as_well():
    def margin(point):
        return -0.5 if point[1] >= 5.5 else fails_from(0, 6.0)(point)

    assert nearest(make_task(A, B), margin, (6.2, 5.1), (5.1, 9.0)).result.point == (5.0, 5.5)


def by_chance(point):
    """Fails with the one noise only."""
    return point[1] == 5.1 and point[0] < 6.0


def late_or_by_chance(point):
    return -0.1 if point[0] >= 6.0 or by_chance(point) else 0.1


def test_a_solid_failure_farther_away_is_told_instead_of_one_by_chance():
    task = make_task(A, B)
    found = nearest(task, late_or_by_chance, (5.0, 5.1), (7.0, 5.1), chance=by_chance)
    assert found.result.point == (6.0, 5.0)
    assert nearest(task, late_or_by_chance, (5.5, 5.1), (5.0, 5.1), chance=by_chance) is None


def test_a_point_that_fails_by_chance_passes_beside_a_failure_that_holds():
    found = nearest(make_task(A), fails_from(0, 6.0), (7.0,), chance=lambda p: 6.0 <= p[0] < 6.5)
    assert (found.result.point, found.passes.point) == ((6.5,), (6.49,))


def test_a_scenario_that_fails_as_written_by_chance_is_not_the_nearest_failure():
    def margin(point):
        return -0.1 if point[0] >= 6.0 or point == (5.0,) else 0.1

    found = nearest(make_task(A), margin, (7.0,), chance=lambda point: point == (5.0,))
    assert found.result.point == (6.0,)


def test_it_begins_with_other_failures_until_one_holds_but_no_more_than_twenty():
    task = make_task(ranged("doors.a", high=15.0))
    points = [(6.0 + n,) for n in range(1, 9)]
    found = nearest(task, fails_from(0, 6.01), *points, chance=lambda p: 6.0 < p[0] < 12.5)
    assert found.result.point == (12.5,)
    many = [(6.0 + 0.1 * n,) for n in range(30)]
    search = Search(task, lambda point: -0.1, *many, chance=lambda _: True)
    assert search.nearest() is None
    assert len(set(search.run_in("confirm"))) == 20


def test_it_ends_when_its_runs_are_spent():
    def margin(point):
        return 0.1 if sum(float(value) > 5.004 for value in point) < 7 else -0.02

    search = Search(TWELVE, margin, (6.5,) * 12)
    found = search.nearest()
    assert found.result.fails
    assert not found.complete
    assert len(search.run_in("nearest")) <= NEAREST_POINTS


def test_a_point_that_breaks_a_constraint_is_not_tried():
    def ordered(point):
        return point[0] < point[1]

    task = make_task(A, ranged("doors.b", written=5.5))
    search = Search(task, fails_from(0, 6.0), (7.0, 7.5), allowed=ordered)
    assert search.nearest().result.point == (6.0, 6.01)
    assert all(map(ordered, search.run_in("nearest")))


@pytest.mark.parametrize(
    ("parameters", "margin", "start", "point"),
    [
        # Written nowhere: it is left as it is.
        ((ranged("a", written=None), B), fails_from(1, 6.0), (9.0, 8.0), (9.0, 6.0)),
        # Written outside of its range: it is still brought back to that.
        (
            (ranged("a", 4.0, 9.0, written=1.0), ranged("b", written=20.0)),
            fails_from(0, 6.0),
            (8.0, 3.0),
            (6.0, 20.0),
        ),
        # A choice goes back or stays.
        (
            (LEADING, B),
            lambda p: -0.02 if p[0] == "kitchen" else 0.1,
            ("kitchen", 8.0),
            ("kitchen", 5.0),
        ),
        ((LEADING, B), fails_from(1, 8.0), ("kitchen", 8.0), ("bedroom", 8.0)),
    ],
)
def test_values_go_back_to_what_is_written(parameters, margin, start, point):
    assert nearest(make_task(*parameters), margin, start).result.point == point


def test_a_run_that_neither_passes_nor_fails_is_no_step_on_the_way():
    found = nearest(
        make_task(A), lambda p: None if 5.0 < p[0] < 6.0 else fails_from(0, 6.0)(p), (8.0,)
    )
    assert (found.result.point, found.passes.point) == ((6.0,), (5.0,))


def test_without_a_failure_there_is_no_nearest_one():
    assert nearest(TWELVE, lambda point: 0.1) is None


@pytest.mark.parametrize("edge", [5.01, 5.5, 6.49, 6.5])
def test_neighbouring_steps_lie_on_either_side(edge):
    found = nearest(make_task(A), fails_from(0, edge), (6.5,))
    assert found.result.point == (edge,)
    assert found.passes.point == pytest.approx((edge - 0.01,))


def test_changes_are_shares_of_their_ranges():
    assert change_size(A, 7.5) == pytest.approx(0.25)
    assert change_size(NOISE, 0.04) == pytest.approx(0.5), "by its logarithm"
    assert change_size(LEADING, "kitchen") == 1.0
    task = make_task(A, NOISE, LEADING)
    assert distance_from_written(task, (7.5, 0.04, "kitchen")) == pytest.approx(1.75)
    assert changed_parameters(task, (5.0, 0.04, "bedroom")) == (1,)
    assert taken_back(task, (7.5, 0.04, "kitchen"), (0, 2)) == (5.0, 0.04, "bedroom")


def test_sums_of_steps_are_as_written_and_nothing_changes_that_is_written_nowhere():
    assert changed_parameters(make_task(ranged("doors.a", written=0.3)), (0.1 + 0.2,)) == ()
    task = make_task(ranged("doors.a", written=None))
    assert changed_parameters(task, (3.0,)) == ()
    assert taken_back(task, (3.0,), (0,)) == (3.0,)


@pytest.mark.parametrize(
    ("parameter", "failing", "passing", "between"),
    [
        (A, 5.0, 5.01, None),
        (A, 5.0, 5.02, 5.01),
        (LEADING, "bedroom", "kitchen", None),
        (NOISE, 0.01, 0.04, 0.02),
        (replace(A, step=0.0), 5.0, 6.0, 5.5),
    ],
)
def test_a_value_between_is_the_middle_of_the_steps(parameter, failing, passing, between):
    assert value_between(parameter, failing, passing) == between


@given(st.integers(0, 1000), st.integers(0, 1000))
def test_halving_ends_at_neighbouring_steps(failing, passing):
    low, high, halvings = 0.01 * failing, 0.01 * passing, 0
    while (value := value_between(A, low, high)) is not None:
        assert min(low, high) < value < max(low, high)
        low, halvings = value, halvings + 1
    assert halvings <= 10
    assert abs(low - high) < 0.0101
