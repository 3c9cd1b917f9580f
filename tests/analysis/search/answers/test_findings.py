"""Failures that are one, and parameters that decide."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.model.search import SearchParameter
from daemon.model.search_answer import Influence
from daemon.search.answers.facts import (
    correlation_ratio,
    distinct_failures,
    parameter_influence,
    rank_correlation,
)
from daemon.search.answers.sentences import finding_words, is_by_chance
from tests.analysis.search.pretended import made_trial, make_task, seconds


def on_the_way_to(waypoint, result):
    assert result.value is not None
    return replace(result, value=replace(result.value, waypoint=waypoint))


def test_failures_at_the_same_door_on_the_same_way_are_one():
    results = [
        made_trial((1.0,), -0.01, 1, "kitchen_door"),
        made_trial((2.0,), 0.3, 2, "kitchen_door"),
        made_trial((3.0,), -0.05, 3, "kitchen_door"),
        made_trial((4.0,), -0.9, 4, "bedroom_door"),
        on_the_way_to("w2", made_trial((5.0,), -0.02, 5, "kitchen_door")),
        made_trial((6.0,), None, 6),
    ]
    found = distinct_failures(results)
    told = [(f.oracle, f.object, f.waypoint, f.count, f.example.number) for f in found]
    assert told == [
        ("keeps-clear", "kitchen_door", "", 2, 3),
        ("keeps-clear", "bedroom_door", "", 1, 4),
        ("keeps-clear", "kitchen_door", "w2", 1, 5),
    ]


def test_a_failure_is_about_what_its_margin_is_about():
    missed = made_trial((1.0,), -8.53, 8, "window")
    assert missed.value is not None
    value = replace(missed.value, object="kitchen", waypoint="kitchen")
    missed = replace(missed, value=value)
    (found,) = distinct_failures([missed])
    assert (found.object, found.waypoint) == ("kitchen", "kitchen")
    assert finding_words(found) == "keeps-clear on the way to kitchen (1 run)"
    assert replace(missed, value=replace(value, oracle="other")).about == "window"
    assert replace(missed, value=replace(value, object="")).about == "window"
    assert replace(missed, value=None).about == "window"
    assert replace(missed, value=None, verdict=None).about == ""


def test_rank_correlation_of_what_does_not_vary_is_nought():
    values = np.arange(40.0)
    assert rank_correlation(values, np.minimum(values, 30.0)) == pytest.approx(1.0, abs=0.05)
    assert rank_correlation(values, np.full(40, 0.1)) == 0.0


def test_the_correlation_ratio_is_one_where_the_choice_decides():
    margins = np.array([0.1, 0.1, -0.2, -0.2])
    assert correlation_ratio(["a", "a", "b", "b"], margins) == pytest.approx(1.0)
    assert correlation_ratio(["a", "b", "a", "b"], margins) == pytest.approx(0.0)
    assert correlation_ratio(["a", "b", "a", "b"], np.zeros(4)) == 0.0


def test_fewer_runs_give_larger_correlations_by_chance():
    three = SearchParameter("doors.who", "behaviours", 0, "who", choices=("a", "b", "c"))
    task = make_task(seconds("doors.t"), three)

    def chance(name, correlation, runs):
        return is_by_chance(task, Influence(name, correlation, runs))

    assert chance("doors.t", 0.552, 10)
    assert chance("doors.t", -0.552, 10)
    assert not chance("doors.t", -0.552, 16)
    assert not chance("doors.t", -0.65, 10)
    # Three groups differ more by chance than two ends of a line.
    assert chance("doors.who", 0.7, 10)
    assert not chance("doors.who", 0.8, 10)
    assert chance("doors.t", 1.0, 2)
    assert chance("doors.t", float("nan"), 100)


def test_influence_is_of_the_points_that_were_drawn():
    choice = SearchParameter("doors.who", "behaviours", 0, "who", choices=("a", "b"), written="a")
    task = make_task(seconds("doors.t"), choice)

    def explored(n, values, margin, guided, method):
        return made_trial(values, margin, n, method=method, guided=guided)

    drawn = [explored(n, (float(n), "ab"[n % 2]), 0.1 * n, False, "halton") for n in range(1, 7)]
    misleading = [
        explored(0, (5.0, "a"), -9.0, False, "written"),
        explored(9, (9.0, "a"), -5.0, True, "tpe"),
    ]
    influence = parameter_influence(task, [*misleading, *drawn])
    assert [(one.parameter, one.runs) for one in influence] == [("doors.t", 6), ("doors.who", 6)]
    assert influence[0].correlation == pytest.approx(1.0)
    assert 0.0 < influence[1].correlation < 0.5
    assert parameter_influence(task, drawn[:4]) == ()
