"""Methods and the nearest failure on functions instead of runs; the space of a search."""

import functools
import math
import statistics
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.model.search import SPACE_FILLING
from daemon.search import methods
from daemon.search.methods import MethodProposal
from daemon.search.nearest import NEAREST_POINTS, find_nearest
from daemon.search.point_runner import PointRunner
from daemon.search.points import (
    change_size,
    changed_parameters,
    distance_from_written,
    taken_back,
    value_between,
)
from daemon.search.space import SearchSpace
from grammars.text.diagnostics import InputError
from tests.analysis.search.searches import PretendedCase
from tests.analysis.search.tasks import chosen, make_task, mixed, mixed_task, ranged, searched

A, B = ranged("doors.a"), ranged("doors.b")
TIMES = tuple(ranged(f"doors.time{i}") for i in range(12))
NOISE = ranged("robot.laser.noise", 0.01, 0.04, 0.001, unit="m", log=True, written=0.02)
LEADING = chosen("doors.leading", "bedroom", "kitchen")


class Search:
    """Points of some parameters that were run: they fail or pass, or are errors (``None``).

    Those of ``chance`` fail with one noise and pass with all others.
    """

    def __init__(self, parameters, fails, *points, chance=lambda _: False, allowed=lambda _: True):
        def margin_of(point, repeat):
            failed = fails(point) and not (repeat and chance(point))
            return None if fails(point) is None else -0.02 if failed else 0.1

        self.task = make_task(*parameters)
        case = PretendedCase(self.task, margin_of)
        self.runs = case.runs()
        self.points = PointRunner(case, self.runs, allowed)
        written = tuple(p.written for p in parameters)
        if None not in written and allowed(written):
            points = (written, *points)
        trials = self.points.results([(point, "") for point in points], "explore")
        self.failures = [trial for trial in trials if trial.fails]

    def nearest(self, **influence):
        return find_nearest(self.points, self.failures, influence)

    def run_in(self, phase):
        return [one.values for one in self.runs.proposals if one.phase == phase]


def changed(**values):
    """The point of twelve times as written, but for those of these numbers."""
    return tuple(values.get(f"t{n}", 5.0) for n in range(12))


def late(point):
    return point[0] >= 6.0


def by_chance(point):
    """Fails with the one noise only."""
    return point[1] == 5.1 and point[0] < 6.0


AS_WRITTEN = {"chance": lambda point: point == (5.0,)}
NEAREST = {
    "twelve changes come down to the one that matters": (
        TIMES, lambda p: p[7] >= 5.37, [(6.5,) * 12], changed(t7=5.37), {}),
    "changes that are only enough together stay together": (
        TIMES, lambda p: min(p[2], p[9]) >= 6.0, [tuple(6.5 + 0.01 * n for n in range(12))],
        changed(t2=6.0, t9=6.0), {}),
    "it begins with the smallest change and tries the worst failure as well": (
        (A, B), lambda p: p[1] >= 5.5 or late(p), [(6.2, 5.1), (5.1, 9.0)], (5.0, 5.5), {}),
    "one large change is nearer than two small ones": (
        (A, B), lambda p: p[0] >= 9.0 or min(p) >= 5.3, [(5.4, 5.4), (9.5, 5.0)], (9.0, 5.0), {}),
    "one small change is nearer than two large ones": (
        (A, B), lambda p: p[0] >= 5.5 or (p[0] <= 3.0 and p[1] >= 8.0), [(5.6, 5.0), (2.0, 9.0)],
        (5.5, 5.0), {}),
    "a solid failure farther away is told instead of one by chance": (
        (A, B), lambda p: late(p) or by_chance(p), [(5.0, 5.1), (7.0, 5.1)], (6.0, 5.0),
        {"chance": by_chance}),
    "no failure by chance is told": (
        (A, B), lambda p: late(p) or by_chance(p), [(5.5, 5.1), (5.0, 5.1)], None,
        {"chance": by_chance}),
    "a point that fails by chance passes beside a failure that holds": (
        (A,), late, [(7.0,)], (6.5,), {"chance": lambda p: p[0] < 6.5}),
    "a scenario that fails as written by chance is not the nearest failure": (
        (A,), lambda p: late(p) or p == (5.0,), [(7.0,)], (6.0,), AS_WRITTEN),
    "it begins with other failures until one holds": (
        (ranged("doors.a", high=15.0),), lambda p: p[0] >= 6.01, [(6.0 + n,) for n in range(1, 9)],
        (12.5,), {"chance": lambda p: 6.0 < p[0] < 12.5}),
    "what is written nowhere is left as it is": (
        (ranged("a", written=None), B), lambda p: p[1] >= 6.0, [(9.0, 8.0)], (9.0, 6.0), {}),
    "what is written outside of its range is still brought back to that": (
        (ranged("a", 4.0, 9.0, written=1.0), ranged("b", written=20.0)), late, [(8.0, 3.0)],
        (6.0, 20.0), {}),
    "a choice that matters stays": (
        (LEADING, B), lambda p: p[0] == "kitchen", [("kitchen", 8.0)], ("kitchen", 5.0), {}),
    "a choice that does not goes back": (
        (LEADING, B), lambda p: p[1] >= 8.0, [("kitchen", 8.0)], ("bedroom", 8.0), {}),
    "without a failure there is none": (TIMES, lambda p: False, [], None, {}),
}  # fmt: skip


@pytest.mark.parametrize("why", NEAREST)
def test_the_nearest_failure(why):
    parameters, fails, points, expected, more = NEAREST[why]
    found = Search(parameters, fails, *points, **more).nearest()
    assert (found and found.result.point) == expected


def test_a_step_before_the_nearest_failure_passes_and_few_runs_find_both():
    search = Search(TIMES, lambda p: p[7] >= 5.37, (6.5,) * 12)
    found = search.nearest()
    assert (found.result.point, found.passes.point) == (changed(t7=5.37), changed(t7=5.36))
    assert found.complete
    assert len(search.run_in("nearest")) <= 20


def test_of_changes_each_of_which_is_enough_the_one_of_most_influence_stays():
    search = Search(TIMES[:3], lambda p: max(p) >= 6.0, (6.5, 6.5, 6.5))
    influence = {"doors.time0": -0.9, "doors.time1": 0.2, "doors.time2": 0.1}
    assert search.nearest(**influence).result.point == (6.0, 5.0, 5.0)


def test_no_more_than_twenty_failures_are_tried():
    many = [(6.0 + 0.1 * n,) for n in range(30)]
    search = Search((A,), lambda point: True, *many, chance=lambda _: True)
    assert search.nearest() is None
    assert len(set(search.run_in("confirm"))) == 20


def test_it_ends_when_its_runs_are_spent():
    search = Search(TIMES, lambda p: sum(value > 5.004 for value in p) >= 7, (6.5,) * 12)
    found = search.nearest()
    assert found.result.fails
    assert not found.complete
    assert len(search.run_in("nearest")) <= NEAREST_POINTS


def test_a_point_that_breaks_a_constraint_is_not_tried():
    def ordered(point):
        return point[0] < point[1]

    search = Search((A, ranged("doors.b", written=5.5)), late, (7.0, 7.5), allowed=ordered)
    assert search.nearest().result.point == (6.0, 6.01)
    assert all(map(ordered, search.run_in("nearest")))


def test_a_run_that_neither_passes_nor_fails_is_no_step_on_the_way():
    found = Search((A,), lambda p: None if 5.0 < p[0] < 6.0 else late(p), (8.0,)).nearest()
    assert (found.result.point, found.passes.point) == ((6.0,), (5.0,))


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


SHIPPED = ("auto", "halton", "random", "tpe", "cma")
CENTRE = np.array([0.75, 0.3, 0.65, 0.8])


def narrow(point):
    """A plateau, and in four of the parameters a narrow region that fails."""
    place = np.array([float(value) for value in point[:4]]) / 10.0
    return min(0.105, 0.24 * float(np.linalg.norm(place - CENTRE)) - 0.045)


def wide_task(method, *, runs=60, **more):
    return make_task(*(ranged(f"p{k}") for k in range(8)), method=method, runs=runs, **more)


@pytest.fixture(autouse=True, scope="module")
def few_places():
    """Estimates draw few places for each that they propose: they find less, but soon."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(methods, "_DRAWN", methods._DRAWN_FEW)
        yield


@functools.cache
def narrow_search(method, seed=0):
    """Sixty pairs of proposal and margin in the narrow space."""
    return searched(wide_task(method, seed=seed), narrow, 60)


def points(task, worth, runs):
    return [proposal.values for proposal, _ in searched(task, worth, runs)]


@pytest.mark.parametrize("method", SHIPPED)
def test_the_scenario_as_written_is_the_first_and_a_longer_search_goes_on_alike(method):
    (first, _), (second, _), *_ = pairs = narrow_search(method)
    assert first == MethodProposal((5.0,) * 8, "written", False)
    assert second.method != "written"
    assert searched(wide_task(method, runs=200), narrow, 30) == pairs[:30]


def test_auto_fills_the_space_then_estimates_then_adapts_a_distribution(monkeypatch, capfd):
    monkeypatch.setattr(methods, "COVARIANCE_FROM", SPACE_FILLING + 10)
    runs = SPACE_FILLING + 20
    proposals = [proposal for proposal, _ in searched(wide_task("auto", runs=200), narrow, runs)]
    names = ["written"] + ["halton"] * (SPACE_FILLING - 1)
    names += ["tpe"] * 10 + ["cma"] * 10
    assert [proposal.method for proposal in proposals] == names
    guided = [False] * SPACE_FILLING + [True] * (runs - SPACE_FILLING)
    assert [proposal.guided for proposal in proposals] == guided
    assert capfd.readouterr() == ("", ""), "optuna prints nothing"


def test_auto_stays_with_estimates_where_there_are_choices(monkeypatch):
    monkeypatch.setattr(methods, "COVARIANCE_FROM", SPACE_FILLING)
    task = make_task(ranged(), ranged("b"), chosen("c", "x", "y"), method="auto", runs=200)
    pairs = searched(task, lambda point: float(point[0]), SPACE_FILLING + 1)
    assert pairs[-1][0].method == "tpe"


def test_a_guided_search_finds_more_than_an_even_one_and_worse_failures():
    failing, lowest = {}, {}
    for method in ("halton", "auto", "cma"):
        for seed in range(3):
            values = [value for _, value in narrow_search(method, seed)]
            failing.setdefault(method, []).append(sum(value < 0.0 for value in values))
            lowest.setdefault(method, []).append(min(values))
    median = {method: statistics.median(counts) for method, counts in failing.items()}
    assert median["auto"] >= 1.5 * max(median["halton"], 1)
    assert median["cma"] > median["halton"]
    assert statistics.median(lowest["auto"]) < statistics.median(lowest["halton"])


def test_estimates_bear_a_plateau_without_anything_else():
    places = np.array(points(wide_task("tpe"), lambda _: 0.1, 60)[SPACE_FILLING:], dtype=float)
    # Nothing is better than anything else: it goes on to look in most of the space.
    assert np.median(np.ptp(places, axis=0)) > 5.0


@pytest.mark.parametrize("method", ["auto", "cma"])
def test_proposals_depend_on_the_window_and_the_seed(method):
    usual = [proposal.values for proposal, _ in narrow_search(method)[:30]]
    assert [proposal.values for proposal, _ in narrow_search(method, 1)[:30]] != usual
    assert points(wide_task(method, window=1), narrow, 30) != usual


def test_choices_logarithms_and_whole_numbers_are_led_too():
    values = points(mixed_task(), mixed, 60)
    assert {b for *_, b in values[:SPACE_FILLING]} == {"left", "middle", "right"}
    assert sum(b == "right" for *_, b in values[40:]) > 10
    assert statistics.median(abs(np.log10(float(a)) - 0.5) for a, *_ in values[40:]) < 0.3


@pytest.mark.parametrize("method", SHIPPED)
def test_constraints_hold_for_everything_that_is_proposed(method):
    parameters = [ranged(f"p{k}") for k in range(3)]
    task = make_task(*parameters, method=method, constraints=("p0 + 2 s < p1", "p2 <= p1"))
    # The best lies where the constraints do not allow it.
    values = points(task, lambda p: abs(float(p[0]) - 8.0) + abs(float(p[1]) - 3.0), 30)
    assert len(values) == 30
    assert all(p0 + 2 < p1 and p2 <= p1 for p0, p1, p2 in values[1:])


@pytest.mark.parametrize("method", SHIPPED)
def test_no_point_is_proposed_twice_and_a_space_ends(method):
    parameters = [ranged(low=1, high=4, step=1, written=2.0), ranged("b", 1, 3, 1, written=2.0)]
    task = make_task(*parameters, method=method, constraints=("a + b < 7 s",))
    values = points(task, lambda p: float(p[0]) * float(p[1]), 40)
    assert sorted(values) == [(a, b) for a in (1, 2, 3, 4) for b in (1, 2, 3) if a + b < 7]


def test_a_space_of_choices_ends_too():
    task = make_task(chosen("a", "x", "y"), chosen("b", "u", "v", "w"), method="tpe")
    assert len(points(task, lambda _: 0.0, 40)) == 6
    assert points(make_task(chosen("a", "x")), lambda _: 0.0, 5) == [("x",)]


@pytest.mark.parametrize("method", ["tpe", "cma"])
def test_runs_without_a_value_are_left_out(method):
    for worth in (lambda p: None if p[0] > 3 else narrow(p), lambda _: None, lambda _: math.nan):
        assert len(points(wide_task(method), worth, 50)) == 50


def test_values_outside_of_the_space_do_not_lead():
    task = make_task(ranged(low=6.0, high=8.0, written=1.0), ranged("b"), method="auto", runs=60)
    first, *rest = points(task, lambda p: float(p[0]), 40)
    assert first == (1.0, 5.0)
    assert all(6.0 <= float(a) <= 8.0 for a, _ in rest)


def circle(point):
    """Fails within 2.7 of (4, 6)."""
    return math.hypot(float(point[0]) - 4.0, float(point[1]) - 6.0) - 2.7


def bounded(worth, runs, *parameters, **more):
    """The proposals and values of a search for the boundary."""
    return searched(make_task(*parameters, method="boundary", runs=runs, **more), worth, runs)


def test_a_boundary_in_one_parameter_is_halved_down_to_its_step():
    pairs = bounded(lambda p: float(p[0]) - 3.337, 60, ranged(step=0.001), window=1)
    failing = max(p.values[0] for p, value in pairs if value < 0.0)
    passing = min(p.values[0] for p, value in pairs if value >= 0.0)
    assert (failing, passing) == (3.336, 3.337)
    pairs = bounded(lambda p: math.sin(float(p[0])), 60, ranged())
    for zero in (math.pi, 2 * math.pi, 3 * math.pi):
        assert min(abs(p.values[0] - zero) for p, _ in pairs) < 0.1


def test_over_two_parameters_points_lie_along_the_boundary():
    pairs = bounded(circle, 120, ranged(), ranged("b"))
    coarse = [abs(value) for p, value in pairs if not p.guided]
    fine = [abs(value) for p, value in pairs if p.guided]
    assert 55 <= len(coarse) <= 70
    assert statistics.mean(fine) < 0.5 * statistics.mean(coarse)
    near = [p.values for p, value in pairs if p.guided and abs(value) < 0.7]
    angles = {round(math.atan2(b - 6.0, a - 4.0)) for a, b in near}
    assert angles == {-3, -2, -1, 0, 1, 2, 3}


def test_without_a_change_of_sign_it_looks_where_the_margin_is_small():
    pairs = bounded(lambda p: circle(p) + 3.0, 80, ranged(), ranged("b"))
    assert statistics.median(circle(p.values) + 2.7 for p, _ in pairs if p.guided) < 2.5


def test_runs_without_a_value_and_constraints_do_not_stop_it():
    pairs = bounded(lambda p: None if p[0] > 5.0 else circle(p), 80, ranged(), ranged("b"))
    assert len(pairs) == 80
    assert sum(p.guided for p, _ in pairs) > 20
    pairs = bounded(circle, 80, ranged(), ranged("b"), constraints=("a < b",))
    assert all(p.values[0] < p.values[1] for p, _ in pairs[1:])
    assert sum(p.guided for p, _ in pairs) > 20


def values_at(parameter, *shares):
    """The values of a range at shares of it."""
    space = SearchSpace(make_task(parameter))
    return [space.at([share])[0] for share in shares]


SEVENTHS = [(k + 0.5) / 7 for k in range(7)]


@pytest.mark.parametrize(
    ("low", "high", "step", "log", "shares", "values"),
    [
        (0.05, 0.32, 0.1, False, (0.0, 0.33, 0.34, 0.66, 0.67, 1.0), "0.1 0.1 0.2 0.2 0.3 0.3"),
        (-0.3, 0.3, 0.1, False, SEVENTHS, "-0.3 -0.2 -0.1 0.0 0.1 0.2 0.3"),
        (0, 1, 0, False, (1 / 3,), "0.3333333333"),
        (0.01, 1.0, 0.0, True, (0.5,), "0.1"),
        (1, 4, 1, True, (0.5,), "2.0"),
    ],
)
def test_values_are_multiples_of_the_step_in_equal_shares(low, high, step, log, shares, values):
    found = values_at(ranged(low=low, high=high, step=step, log=log), *shares)
    assert " ".join(map(str, found)) == values


def test_choices_have_equal_shares():
    assert values_at(chosen("c", "x", "y"), 0.0, 0.49, 0.51, 1.0) == ["x", "x", "y", "y"]


def test_the_written_point_may_lie_outside_and_may_be_missing():
    space = SearchSpace(make_task(ranged(low=6.0, high=8.0, written=5.0), chosen("b", "x", "y")))
    assert space.written == (5.0, "x")
    assert SearchSpace(make_task(ranged(written=None), ranged("b"))).written is None


def test_constraints_compare_different_units_and_no_words():
    opens, closes = ranged("doors.opens", unit="min"), ranged("doors.closes")
    task = make_task(closes, opens, constraints=("doors.closes + 60 s < doors.opens",))
    assert SearchSpace(task).allowed((59.9, 2.0))
    assert not SearchSpace(task).allowed((60.0, 2.0))
    with pytest.raises(InputError, match='"b" is not varied here'):
        SearchSpace(make_task(ranged(), chosen("b", "x", "y"), constraints=("a < b",)))


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        (ranged(low=2.0, high=1.0), "is not a range"),
        (ranged(high=math.inf), "is not a range"),
        (ranged(low=0.0, log=True), "begins above 0"),
    ],
)
def test_a_range_that_makes_no_sense_is_refused(parameter, words):
    with pytest.raises(ValueError, match=words):
        SearchSpace(make_task(parameter))
