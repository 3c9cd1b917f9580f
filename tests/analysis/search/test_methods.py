"""Methods on functions instead of runs: what they propose, what they find, what they depend on."""

import json
import statistics
import subprocess
import sys

import numpy as np
import pytest

from daemon.model.search import SPACE_FILLING
from daemon.search.methods import COVARIANCE_FROM, METHODS, MethodProposal, method_problem
from tests.analysis.search.spaces import chosen, ranged, search_task, searched

SHIPPED = ("auto", "halton", "random", "tpe", "cma")
CENTRE = np.array([0.75, 0.3, 0.65, 0.8])


def narrow(point):
    """A plateau, and in four of the parameters a narrow region that fails."""
    place = np.array([float(value) for value in point[:4]]) / 10.0
    return min(0.105, 0.24 * float(np.linalg.norm(place - CENTRE)) - 0.045)


def wide_task(method, *, dimensions=8, **more):
    return search_task(*(ranged(f"p{k}") for k in range(dimensions)), method=method, **more)


def points(task, worth, runs):
    return [proposal.values for proposal, _ in searched(task, worth, runs)]


@pytest.mark.parametrize("method", SHIPPED)
def test_the_scenario_as_written_is_the_first(method):
    (first, _), (second, _) = searched(wide_task(method), narrow, 2)
    assert first == MethodProposal((5.0,) * 8, "written", False)
    assert second.method != "written"


def test_auto_fills_the_space_before_it_is_guided():
    done = [proposal for proposal, _ in searched(wide_task("auto"), narrow, 30)]
    names = [proposal.method for proposal in done]
    rest = 30 - SPACE_FILLING
    assert names == ["written", *["halton"] * (SPACE_FILLING - 1), *["tpe"] * rest]
    assert [proposal.guided for proposal in done] == [False] * SPACE_FILLING + [True] * rest


def test_auto_adapts_a_normal_distribution_in_long_searches():
    names = [p.method for p, _ in searched(wide_task("auto", runs=200), narrow, 160)]
    assert names[COVARIANCE_FROM - 1 :] == ["tpe", *["cma"] * (160 - COVARIANCE_FROM)]


def test_auto_stays_with_estimates_where_there_are_choices():
    task = search_task(ranged(), ranged("b"), chosen("c", "x", "y"), runs=200)
    assert searched(task, lambda point: float(point[0]), 155)[-1][0].method == "tpe"


@pytest.mark.parametrize("method", SHIPPED)
def test_a_longer_search_begins_with_the_runs_of_a_shorter_one(method):
    few, many = wide_task(method, runs=60), wide_task(method, runs=200)
    assert points(few, narrow, 60) == points(many, narrow, 60)


def test_a_guided_search_finds_more_than_an_even_one_and_worse_failures():
    failing = {}
    lowest = {}
    for method in ("halton", "auto", "cma"):
        for seed in range(5):
            done = searched(wide_task(method, seed=seed), narrow, 60)
            values = [value for _, value in done if value is not None]
            failing.setdefault(method, []).append(sum(value < 0.0 for value in values))
            lowest.setdefault(method, []).append(min(values))
    median = {method: statistics.median(counts) for method, counts in failing.items()}
    assert median["auto"] >= 1.5 * max(median["halton"], 1)
    assert median["cma"] > median["halton"]
    assert statistics.median(lowest["auto"]) < statistics.median(lowest["halton"])


def test_estimates_bear_a_plateau_without_anything_else():
    done = points(wide_task("tpe"), lambda _: 0.1, 60)
    places = np.array(done[SPACE_FILLING:], dtype=float)
    # Nothing is better than anything else: it goes on to look in most of the space.
    assert np.median(np.ptp(places, axis=0)) > 5.0


@pytest.mark.parametrize("method", ["auto", "cma"])
def test_proposals_depend_on_the_window_and_the_seed(method):
    usual = points(wide_task(method), narrow, 40)
    assert points(wide_task(method, seed=1), narrow, 40) != usual
    assert points(wide_task(method, window=1), narrow, 40) != usual
    assert points(wide_task(method), narrow, 40) == usual


def test_another_process_proposes_the_same():
    """Hashes of words, and with them the order of sets, differ between processes."""
    code = (
        "import json\n"
        "from tests.analysis.search.test_methods import mixed_task, mixed\n"
        "from tests.analysis.search.spaces import searched\n"
        "print(json.dumps([p.values for p, _ in searched(mixed_task(), mixed, 30)]))\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    here = [list(proposal.values) for proposal, _ in searched(mixed_task(), mixed, 30)]
    assert json.loads(run.stdout) == here


def mixed_task(**more):
    return search_task(
        ranged("a", 0.01, 10.0, 0.001, log=True),
        chosen("b", "left", "middle", "right"),
        ranged("c", 1, 9, 1),
        **more,
    )


def mixed(point):
    a, b, c = point
    return abs(np.log10(float(a)) - 0.5) + (b != "right") + 0.1 * abs(float(c) - 2.0)


def test_choices_logarithms_and_whole_numbers_are_led_too():
    done = searched(mixed_task(), mixed, 60)
    late = [proposal.values for proposal, _ in done[40:]]
    assert sum(b == "right" for _, b, _ in late) > 10
    assert statistics.median(abs(np.log10(float(a)) - 0.5) for a, _, _ in late) < 0.3


def test_every_choice_is_tried_before_the_search_is_guided():
    first = points(mixed_task(), mixed, SPACE_FILLING)
    assert {b for _, b, _ in first} == {"left", "middle", "right"}


@pytest.mark.parametrize("method", SHIPPED)
def test_constraints_hold_for_everything_that_is_proposed(method):
    task = search_task(
        *(ranged(f"p{k}") for k in range(3)),
        method=method,
        constraints=("p0 + 2 s < p1", "p2 <= p1"),
    )
    # The best lies where the constraints do not allow it.
    done = points(task, lambda p: abs(float(p[0]) - 8.0) + abs(float(p[1]) - 3.0), 50)
    assert len(done) == 50
    assert all(p0 + 2 < p1 and p2 <= p1 for p0, p1, p2 in done[1:])


@pytest.mark.parametrize("method", SHIPPED)
def test_no_point_is_proposed_twice_and_a_space_ends(method):
    parameters = [ranged(low=1, high=4, step=1, written=2.0), ranged("b", 1, 3, 1, written=2.0)]
    task = search_task(*parameters, method=method, constraints=("a + b < 7 s",))
    done = points(task, lambda p: float(p[0]) * float(p[1]), 40)
    assert sorted(done) == [(a, b) for a in (1, 2, 3, 4) for b in (1, 2, 3) if a + b < 7]


def test_a_space_of_choices_ends_too():
    task = search_task(chosen("a", "x", "y"), chosen("b", "u", "v", "w"), method="tpe")
    assert len(points(task, lambda _: 0.0, 40)) == 6


def test_a_search_of_one_value_has_one_point():
    assert points(search_task(chosen("a", "x")), lambda _: 0.0, 5) == [("x",)]


@pytest.mark.parametrize("method", ["tpe", "cma"])
def test_runs_without_a_value_are_left_out(method):
    done = searched(wide_task(method), lambda p: None if p[0] > 3 else narrow(p), 50)
    assert len(done) == 50
    assert len(searched(wide_task(method), lambda _: None, 50)) == 50
    assert len(searched(wide_task(method), lambda _: float("nan"), 50)) == 50


def test_what_is_written_outside_of_the_space_does_not_lead():
    task = search_task(ranged(low=6.0, high=8.0, written=1.0), ranged("b"))
    done = points(task, lambda p: float(p[0]), 40)
    assert done[0] == (1.0, 5.0)
    assert all(6.0 <= float(p[0]) <= 8.0 for p in done[1:])


def test_a_narrow_distribution_goes_on_with_even_points():
    task = search_task(ranged(step=0.1), ranged("b", step=0.1), method="cma")
    done = points(task, lambda p: abs(float(p[0]) - 2.0) + abs(float(p[1]) - 2.0), 400)
    far = [abs(float(a) - 2.0) + abs(float(b) - 2.0) > 2.0 for a, b in done[200:]]
    assert len(far) == 200
    assert any(far)


def test_optuna_tells_nothing(capfd):
    searched(wide_task("auto"), narrow, 25)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("method", METHODS)
def test_all_methods_take_two_ranges(method):
    assert method_problem(search_task(ranged(), ranged("b"), method=method)) is None


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
def test_a_method_that_does_not_fit_is_told_with_a_remedy(method, parameters, message, hint):
    problem = method_problem(search_task(*parameters, method=method))
    assert problem is not None
    assert message in problem[0]
    assert hint in problem[1]


def test_even_and_random_searches_do_not_load_optuna():
    code = (
        "import sys\n"
        "from tests.analysis.search.spaces import ranged, search_task, searched\n"
        "for method in ('halton', 'random', 'boundary'):\n"
        "    searched(search_task(ranged(), method=method), lambda p: p[0] - 3.0, 30)\n"
        "assert 'optuna' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
