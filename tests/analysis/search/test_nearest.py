"""The nearest failure, found by functions instead of runs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from daemon.search.nearest import NEAREST_POINTS, find_nearest
from daemon.search.point_runner import PointRunner
from tests.analysis.search.pretended import PretendedCase, make_task, seconds

TWELVE = make_task(*(seconds(f"doors.time{i}") for i in range(12)))


def never(point):
    """No point is one that fails by chance."""
    return False


def always(point):
    """Every point may be run."""
    return True


class Searched:
    """Points of a task with these margins that were run; those of ``chance`` fail by chance.

    They fail with one noise and pass by 0.05 with all others.
    """

    def __init__(self, task, margin, *points, chance=never, allowed=always):
        def margin_of(point, repeat):
            return 0.05 if repeat and chance(point) else margin(point)

        case = PretendedCase(task, margin_of)
        self.runs = case.runs()
        self.points = PointRunner(case, self.runs, allowed)
        written = tuple(p.written for p in task.parameters if p.written is not None)
        if len(written) == len(task.parameters) and allowed(written):
            points = (written, *points)
        trials = self.points.results([(point, "") for point in points], "explore")
        self.failures = [trial for trial in trials if trial.fails]

    def nearest(self, influence=None):
        """Find the nearest of the failures."""
        return find_nearest(self.points, self.failures, influence or {})

    def tried(self):
        """Return the points that were tried for it."""
        return [one.values for one in self.runs.proposals if one.phase == "nearest"]


def nearest(task, margin, *points, **more):
    searched = Searched(task, margin, *points, **more)
    found = searched.nearest()
    assert found is not None
    return found, searched


def changed(found):
    return [index for index, value in enumerate(found.result.point) if value != 5.0]


def test_twelve_changes_come_down_to_the_one_that_matters():
    def margin(point):
        return 0.1 if float(point[7]) < 5.37 else -0.02

    found, searched = nearest(TWELVE, margin, (6.5,) * 12)
    assert found.result.point == (*(5.0,) * 7, 5.37, *(5.0,) * 4)
    assert found.complete
    assert found.passes is not None
    assert found.passes.point == (*(5.0,) * 7, 5.36, *(5.0,) * 4)
    assert len(searched.tried()) <= 20


def test_changes_that_are_only_enough_together_stay_together():
    def margin(point):
        return 0.1 if min(float(point[2]), float(point[9])) < 6.0 else -0.02

    found, _ = nearest(TWELVE, margin, tuple(6.5 + 0.01 * n for n in range(12)))
    assert [found.result.point[index] for index in changed(found)] == [6.0, 6.0]
    assert found.complete


def test_of_changes_each_of_which_is_enough_one_stays():
    def margin(point):
        return 0.1 if max(float(point[2]), float(point[9])) < 6.0 else -0.02

    found, _ = nearest(TWELVE, margin, (6.5,) * 12)
    assert len(changed(found)) == 1


def test_the_least_influence_is_taken_back_first():
    def margin(point):
        return 0.1 if max(map(float, point)) < 6.0 else -0.02

    task = make_task(*(seconds(f"doors.time{i}") for i in range(3)))
    influence = {"doors.time0": -0.9, "doors.time1": 0.2, "doors.time2": 0.1}
    found = Searched(task, margin, (6.5, 6.5, 6.5)).nearest(influence)
    assert found is not None
    assert found.result.point == (6.0, 5.0, 5.0)


def test_it_begins_with_the_smallest_change_and_tries_the_worst_failure_as_well():
    def margin(point):
        if float(point[1]) >= 5.5:
            return -0.5
        return 0.1 if float(point[0]) < 6.0 else -0.02

    task = make_task(seconds("doors.a"), seconds("doors.b"))
    found, _ = nearest(task, margin, (6.2, 5.1), (5.1, 9.0))
    assert found.result.point == (5.0, 5.5)


def by_chance(point):
    """Fails with the one noise only."""
    return point[1] == 5.1 and float(point[0]) < 6.0


def late_or_by_chance(point):
    return -0.1 if float(point[0]) >= 6.0 or by_chance(point) else 0.1


def test_a_solid_failure_farther_away_is_told_instead_of_one_by_chance():
    task = make_task(seconds("doors.a"), seconds("doors.b"))
    found, _ = nearest(task, late_or_by_chance, (5.0, 5.1), (7.0, 5.1), chance=by_chance)
    assert found.result.point == (6.0, 5.0)


def test_what_fails_by_chance_is_what_passes_beside_a_failure_that_holds():
    def margin(point):
        return -0.1 if float(point[0]) >= 6.0 else 0.1

    task = make_task(seconds("doors.a"))
    found, _ = nearest(task, margin, (7.0,), chance=lambda point: 6.0 <= float(point[0]) < 6.5)
    assert (found.result.point, found.passes.point) == ((6.5,), (6.49,))


def test_where_no_failure_holds_there_is_no_nearest_one():
    task = make_task(seconds("doors.a"), seconds("doors.b"))
    points = (5.5, 5.1), (5.0, 5.1)
    assert Searched(task, late_or_by_chance, *points, chance=by_chance).nearest() is None


def test_a_scenario_that_fails_as_written_by_chance_is_not_the_nearest_failure():
    def margin(point):
        return -0.1 if float(point[0]) >= 6.0 or point == (5.0,) else 0.1

    task = make_task(seconds("doors.a"))
    found, _ = nearest(task, margin, (7.0,), chance=lambda point: point == (5.0,))
    assert found.result.point == (6.0,)


def test_it_begins_with_other_failures_until_one_holds():
    found, _ = nearest(
        make_task(seconds("doors.a", high=15.0)),
        lambda point: -0.1 if float(point[0]) > 6.0 else 0.1,
        *((6.0 + n,) for n in range(1, 9)),
        chance=lambda point: 6.0 < float(point[0]) < 12.5,
    )
    assert found.result.point == (12.5,)


def test_it_begins_with_no_more_than_twenty_failures():
    points = [(6.0 + 0.1 * n,) for n in range(30)]
    task = make_task(seconds("doors.a"))
    searched = Searched(task, lambda point: -0.1, *points, chance=always)
    assert searched.nearest() is None
    repeated = {one.values for one in searched.runs.proposals if one.phase == "confirm"}
    assert len(repeated) == 20


def test_it_ends_when_its_runs_are_spent():
    def margin(point):
        return 0.1 if sum(float(value) > 5.004 for value in point) < 7 else -0.02

    found, searched = nearest(TWELVE, margin, (6.5,) * 12)
    assert not found.complete
    assert len(searched.tried()) <= NEAREST_POINTS
    assert found.result.fails


def test_what_breaks_a_constraint_or_makes_no_run_is_not_tried():
    def margin(point):
        return 0.1 if float(point[0]) < 6.0 else -0.02

    def ordered(point):
        return float(point[0]) < float(point[1])

    task = make_task(seconds("doors.a"), seconds("doors.b", 5.5))
    found, searched = nearest(task, margin, (7.0, 7.5), allowed=ordered)
    assert all(ordered(point) for point in searched.tried())
    assert found.result.point == (6.0, 6.01)


def test_what_is_written_nowhere_is_left_as_it_is():
    def margin(point):
        return 0.1 if float(point[1]) < 6.0 else -0.02

    task = make_task(seconds("doors.a", None), seconds("doors.b"))
    found, _ = nearest(task, margin, (9.0, 8.0))
    assert found.result.point == (9.0, 6.0)


def test_a_written_value_outside_of_the_range_is_still_what_it_is_brought_back_to():
    def margin(point):
        return 0.1 if float(point[0]) < 6.0 else -0.02

    task = make_task(seconds("doors.a", 1.0, 4.0, 9.0), seconds("doors.b", 20.0))
    found, _ = nearest(task, margin, (8.0, 3.0))
    assert found.result.point == (6.0, 20.0)


def test_what_neither_passes_nor_fails_is_no_step_on_the_way():
    def margin(point):
        if 5.0 < float(point[0]) < 6.0:
            return None
        return 0.1 if float(point[0]) < 6.0 else -0.02

    found, _ = nearest(make_task(seconds("doors.a")), margin, (8.0,))
    assert found.result.point == (6.0,)
    assert found.passes is not None
    assert found.passes.point == (5.0,)


def test_a_choice_goes_back_or_stays():
    choice = replace(seconds("doors.leading"), choices=("bedroom", "kitchen"), unit="")
    task = make_task(replace(choice, written="bedroom"), seconds("doors.b"))

    def margin(point):
        return -0.02 if point[0] == "kitchen" else 0.1

    found, _ = nearest(task, margin, ("kitchen", 8.0))
    assert found.result.point == ("kitchen", 5.0)


def test_without_a_failure_there_is_no_nearest_one():
    assert Searched(TWELVE, lambda point: 0.1).nearest() is None


@pytest.mark.parametrize("edge", [5.01, 5.5, 6.49, 6.5])
def test_neighbouring_steps_lie_on_either_side(edge):
    found, _ = nearest(
        make_task(seconds("doors.a")), lambda p: 0.1 if float(p[0]) < edge else -0.1, (6.5,)
    )
    assert found.result.point == (edge,)
    assert found.passes.point == pytest.approx((edge - 0.01,))
