"""The nearest failure, found by functions instead of runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from daemon.model.search import Point
from daemon.model.search_answer import PointResult
from daemon.search.nearest import NEAREST_POINTS, NearestQuestion, find_nearest
from tests.daemon.search.pretended import made_result, make_task, seconds

TWELVE = make_task(*(seconds(f"doors.time{i}") for i in range(12)))
Margin = Callable[[Point], float | None]


@dataclass
class Prober:
    """Answers by a function and counts what it was asked; ``allowed`` are points with a run.

    Those of ``chance`` fail with one noise and pass by 0.05 with most of them.
    """

    margin: Margin
    known: dict[Point, PointResult] = field(default_factory=dict)
    allowed: Callable[[Point], bool] = lambda _: True
    batches: list[list[str]] = field(default_factory=list)
    chance: Callable[[Point], bool] = lambda _: False

    def is_known(self, point, *, one_noise):
        return point in self.known or not self.allowed(point)

    def results(self, tried, *, one_noise):
        new = [(p, note) for p, note in tried if not self.is_known(p, one_noise=one_noise)]
        if new:
            self.batches.append([note for _, note in new])
        for point, _ in new:
            self.known[point] = made_result(point, self.margin(point), 100 + len(self.known))
        found = [self.known.get(point) for point, _ in tried]
        if one_noise:
            return found
        return [
            made_result(one.values, 0.05, one.number) if one and self.chance(one.values) else one
            for one in found
        ]

    @property
    def runs(self):
        return sum(map(len, self.batches))


def nearest(task, margin, *failures, **more):
    written = tuple(p.written for p in task.parameters if p.written is not None)
    prober = Prober(margin, **more)
    if len(written) == len(task.parameters):
        prober.known[written] = made_result(written, margin(written))
    results = [made_result(point, margin(point), n) for n, point in enumerate(failures, 1)]
    prober.known |= {result.values: result for result in results}
    found = find_nearest(NearestQuestion(task, results, {}), prober)
    assert found is not None
    return found, prober


def test_twelve_changes_come_down_to_the_one_that_matters():
    def margin(point):
        return 0.1 if float(point[7]) < 5.37 else -0.02

    found, prober = nearest(TWELVE, margin, (6.5,) * 12)
    assert [(c.parameter, c.value, c.passing) for c in found.changes] == [
        ("doors.time7", 5.37, 5.36)
    ]
    assert found.complete
    assert found.passes is not None
    assert found.passes.values == (*(5.0,) * 7, 5.36, *(5.0,) * 4)
    assert found.runs == prober.runs <= 20
    assert max(map(len, prober.batches)) == 2
    assert found.sentence == (
        "time7 0.37 s later (5.37 s instead of 5 s) and keeps-clear fails by 0.02 m near door; "
        "at 5.36 s it passes with 0.1 m"
    )


def test_changes_that_are_only_enough_together_stay_together():
    def margin(point):
        return 0.1 if min(float(point[2]), float(point[9])) < 6.0 else -0.02

    found, _ = nearest(TWELVE, margin, tuple(6.5 + 0.01 * n for n in range(12)))
    assert {(c.parameter, c.value) for c in found.changes} == {
        ("doors.time2", 6.0),
        ("doors.time9", 6.0),
    }
    assert found.complete


def test_of_changes_each_of_which_is_enough_one_stays():
    def margin(point):
        return 0.1 if max(float(point[2]), float(point[9])) < 6.0 else -0.02

    found, _ = nearest(TWELVE, margin, (6.5,) * 12)
    assert len(found.changes) == 1


def test_the_least_influence_is_taken_back_first():
    def margin(point):
        return 0.1 if max(map(float, point)) < 6.0 else -0.02

    task = make_task(*(seconds(f"doors.time{i}") for i in range(3)))
    failure = made_result((6.5, 6.5, 6.5), -0.02, 1)
    prober = Prober(margin)
    influence = {"doors.time0": -0.9, "doors.time1": 0.2, "doors.time2": 0.1}
    found = find_nearest(NearestQuestion(task, [failure], influence), prober)
    assert found is not None
    assert [change.parameter for change in found.changes] == ["doors.time0"]


def test_it_begins_with_the_smallest_change_and_tries_the_worst_failure_as_well():
    def margin(point):
        if float(point[1]) >= 5.5:
            return -0.5
        return 0.1 if float(point[0]) < 6.0 else -0.02

    task = make_task(seconds("doors.a"), seconds("doors.b"))
    found, _ = nearest(task, margin, (6.2, 5.1), (5.1, 9.0))
    assert [(c.parameter, c.value) for c in found.changes] == [("doors.b", 5.5)]


def by_chance(point):
    """Fails with the one noise only."""
    return point[1] == 5.1 and float(point[0]) < 6.0


def late_or_by_chance(point):
    return -0.1 if float(point[0]) >= 6.0 or by_chance(point) else 0.1


def test_a_solid_failure_farther_away_is_told_instead_of_one_by_chance():
    task = make_task(seconds("doors.a"), seconds("doors.b"))
    failures = [made_result((5.0, 5.1), -0.1, 1), made_result((7.0, 5.1), -0.1, 2)]
    prober = Prober(late_or_by_chance, chance=by_chance)
    found = find_nearest(NearestQuestion(task, failures, {}), prober)
    assert found is not None
    assert found.holds
    assert [(c.parameter, c.value) for c in found.changes] == [("doors.a", 6.0)]


def test_what_fails_by_chance_is_what_passes_beside_a_failure_that_holds():
    def margin(point):
        return -0.1 if float(point[0]) >= 6.0 else 0.1

    prober = Prober(margin, chance=lambda point: float(point[0]) < 6.5)
    task = make_task(seconds("doors.a"))
    found = find_nearest(NearestQuestion(task, [made_result((7.0,), -0.1, 1)], {}), prober)
    assert found is not None
    (change,) = found.changes
    assert (change.value, change.passing) == (6.5, 6.49)
    assert found.sentence.endswith("at 6.49 s it passes with 0.05 m")


def test_where_no_failure_holds_one_noise_decides():
    task = make_task(seconds("doors.a"), seconds("doors.b"))
    failures = [made_result((5.5, 5.1), -0.1, 1), made_result((5.0, 5.1), -0.1, 2)]
    prober = Prober(late_or_by_chance, chance=by_chance)
    found = find_nearest(NearestQuestion(task, failures, {}), prober)
    assert found is not None
    assert not found.holds
    assert [(c.parameter, c.value) for c in found.changes] == [("doors.b", 5.1)]


def test_a_scenario_that_fails_as_written_by_chance_is_not_the_nearest_failure():
    def margin(point):
        return -0.1 if float(point[0]) >= 6.0 or point == (5.0,) else 0.1

    task = make_task(seconds("doors.a"))
    failures = [made_result((5.0,), -0.1, 0), made_result((7.0,), -0.1, 1)]
    prober = Prober(margin, chance=lambda point: point == (5.0,))
    found = find_nearest(NearestQuestion(task, failures, {}), prober)
    assert found is not None
    assert found.result.values == (6.0,)
    prober.chance = lambda point: True
    alone = find_nearest(NearestQuestion(task, failures, {}), prober)
    assert alone is not None
    assert (alone.changes, alone.holds) == ((), False)


def test_it_begins_with_other_failures_until_one_holds():
    task = make_task(seconds("doors.a"))
    failures = [made_result((6.0 + n,), -0.1, n) for n in range(9)]
    prober = Prober(lambda point: -0.1 if float(point[0]) > 6.0 else 0.1)
    prober.chance = lambda point: float(point[0]) < 12.5
    prober.known = {one.values: one for one in failures}
    found = find_nearest(NearestQuestion(task, failures, {}), prober)
    assert found is not None
    assert found.holds
    assert found.result.values == (12.5,)


def test_it_begins_with_no_more_than_twenty_failures():
    task = make_task(seconds("doors.a"))
    failures = [made_result((6.0 + 0.1 * n,), -0.1, n) for n in range(30)]
    begun = []

    def chance(point):
        begun.append(point)
        return True

    prober = Prober(lambda point: -0.1, chance=chance)
    found = find_nearest(NearestQuestion(task, failures, {}), prober)
    assert found is not None
    assert not found.holds
    assert len(begun) == 20


def test_it_ends_when_its_runs_are_spent():
    def margin(point):
        return 0.1 if sum(float(value) > 5.004 for value in point) < 7 else -0.02

    found, prober = nearest(TWELVE, margin, (6.5,) * 12)
    assert not found.complete
    assert found.runs == prober.runs <= NEAREST_POINTS
    assert found.result.fails


def test_what_breaks_a_constraint_or_makes_no_run_is_not_tried():
    def margin(point):
        return 0.1 if float(point[0]) < 6.0 else -0.02

    def ordered(point):
        return float(point[0]) < float(point[1])

    task = make_task(seconds("doors.a"), seconds("doors.b", 5.5))
    found, prober = nearest(task, margin, (7.0, 7.5), allowed=ordered)
    assert all(ordered(point) for point in prober.known)
    assert {(c.parameter, c.value) for c in found.changes} == {("doors.a", 6.0), ("doors.b", 6.01)}


def test_what_is_written_nowhere_is_left_as_it_is():
    def margin(point):
        return 0.1 if float(point[1]) < 6.0 else -0.02

    task = make_task(seconds("doors.a", None), seconds("doors.b"))
    found, _ = nearest(task, margin, (9.0, 8.0))
    assert found.result.values == (9.0, 6.0)
    assert [change.parameter for change in found.changes] == ["doors.b"]


def test_a_written_value_outside_of_the_range_is_still_what_it_is_brought_back_to():
    def margin(point):
        return 0.1 if float(point[0]) < 6.0 else -0.02

    task = make_task(seconds("doors.a", 1.0, 4.0, 9.0), seconds("doors.b", 20.0))
    found, _ = nearest(task, margin, (8.0, 3.0))
    assert found.result.values == (6.0, 20.0)


def test_what_neither_passes_nor_fails_is_no_step_on_the_way():
    def margin(point):
        if 5.0 < float(point[0]) < 6.0:
            return None
        return 0.1 if float(point[0]) < 6.0 else -0.02

    found, _ = nearest(make_task(seconds("doors.a")), margin, (8.0,))
    assert found.result.values == (6.0,)
    assert found.passes is not None
    assert found.passes.values == (5.0,)
    assert found.sentence.endswith("; as written it passes with 0.1 m")


def test_a_choice_goes_back_or_stays():
    choice = replace(seconds("doors.leading"), choices=("bedroom", "kitchen"), unit="")
    task = make_task(replace(choice, written="bedroom"), seconds("doors.b"))

    def margin(point):
        return -0.02 if point[0] == "kitchen" else 0.1

    found, _ = nearest(task, margin, ("kitchen", 8.0))
    assert found.sentence == (
        "leading kitchen instead of bedroom and keeps-clear fails by 0.02 m near door; "
        "as written it passes with 0.1 m"
    )


def test_without_a_failure_there_is_no_nearest_one():
    prober = Prober(lambda point: 0.1)
    assert find_nearest(NearestQuestion(TWELVE, [], {}), prober) is None


@pytest.mark.parametrize("edge", [5.01, 5.5, 6.49, 6.5])
def test_neighbouring_steps_lie_on_either_side(edge):
    found, _ = nearest(
        make_task(seconds("doors.a")), lambda p: 0.1 if float(p[0]) < edge else -0.1, (6.5,)
    )
    assert found.result.values == (edge,)
    (change,) = found.changes
    assert change.passing == pytest.approx(edge - 0.01)
