"""Methods on functions instead of runs: what they propose, what they find, what they depend on."""

import functools
import math
import statistics

import numpy as np
import pytest

from daemon.model.search import SPACE_FILLING
from daemon.search.methods import COVARIANCE_FROM, METHODS, MethodProposal, method_problem
from daemon.search.space import SearchSpace
from grammars.text.diagnostics import InputError
from tests.analysis.search.searches import chosen, make_task, mixed, mixed_task, ranged, searched

SHIPPED = ("auto", "halton", "random", "tpe", "cma")
CENTRE = np.array([0.75, 0.3, 0.65, 0.8])


def narrow(point):
    """A plateau, and in four of the parameters a narrow region that fails."""
    place = np.array([float(value) for value in point[:4]]) / 10.0
    return min(0.105, 0.24 * float(np.linalg.norm(place - CENTRE)) - 0.045)


def wide_task(method, *, runs=60, **more):
    return make_task(*(ranged(f"p{k}") for k in range(8)), method=method, runs=runs, **more)


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
    assert searched(wide_task(method, runs=200), narrow, 60) == pairs


def test_auto_fills_the_space_then_estimates_then_adapts_a_distribution():
    proposals = [proposal for proposal, _ in searched(wide_task("auto", runs=200), narrow, 160)]
    names = ["written"] + ["halton"] * (SPACE_FILLING - 1)
    names += ["tpe"] * (COVARIANCE_FROM - SPACE_FILLING) + ["cma"] * (160 - COVARIANCE_FROM)
    assert [proposal.method for proposal in proposals] == names
    guided = [False] * SPACE_FILLING + [True] * (160 - SPACE_FILLING)
    assert [proposal.guided for proposal in proposals] == guided


def test_auto_stays_with_estimates_where_there_are_choices():
    task = make_task(ranged(), ranged("b"), chosen("c", "x", "y"), method="auto", runs=200)
    assert searched(task, lambda point: float(point[0]), COVARIANCE_FROM + 1)[-1][0].method == "tpe"


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
    values = points(task, lambda p: abs(float(p[0]) - 8.0) + abs(float(p[1]) - 3.0), 50)
    assert len(values) == 50
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


def test_a_narrow_distribution_goes_on_with_even_points():
    task = make_task(ranged(step=0.1), ranged("b", step=0.1), method="cma")
    values = points(task, lambda p: abs(float(p[0]) - 2.0) + abs(float(p[1]) - 2.0), 400)
    assert len(values) == 400
    assert any(abs(float(a) - 2.0) + abs(float(b) - 2.0) > 2.0 for a, b in values[200:])


def test_optuna_prints_nothing(capfd):
    searched(wide_task("auto"), narrow, 25)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("method", METHODS)
def test_all_methods_take_two_ranges(method):
    assert method_problem(make_task(ranged(), ranged("b"), method=method)) is None


@pytest.mark.parametrize(
    ("method", "parameters", "message", "hint"),
    [
        ("halten", [ranged()], 'there is no method "halten"', 'did you mean "halton"?'),
        ("cma", [ranged(), chosen("b", "x")], "takes ranges alone, b is a list", "tpe"),
        ("cma", [ranged()], "takes two parameters or more", "tpe"),
        ("boundary", [ranged(), chosen("b", "x")], "takes ranges alone, b is a list", "tpe"),
        ("boundary", [ranged(n) for n in "abc"], "one or two parameters, not 3", "method: auto"),
    ],
)
def test_a_method_that_does_not_fit_has_a_remedy(method, parameters, message, hint):
    problem = method_problem(make_task(*parameters, method=method))
    assert message in problem[0]
    assert hint in problem[1]


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


def test_every_value_is_as_likely_as_any_other():
    space = SearchSpace(make_task(ranged(low=1, high=3, step=1), chosen("c", "x", "y")))
    drawn = [space.at([share, share]) for share in (np.arange(600) + 0.5) / 600]
    assert [sum(p[0] == k for p in drawn) for k in (1, 2, 3)] == [200, 200, 200]
    assert sum(p[1] == "x" for p in drawn) == 300


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
        (ranged(low=2.0, high=1.0), "is no range"),
        (ranged(high=math.inf), "is no range"),
        (ranged(low=0.0, log=True), "begins above 0"),
    ],
)
def test_a_range_that_makes_no_sense_is_refused(parameter, words):
    with pytest.raises(ValueError, match=words):
        SearchSpace(make_task(parameter))
