"""The answer of a search, sentence by sentence."""

from dataclasses import replace

import pytest

from daemon.model.proposals import Proposal
from daemon.model.search import SearchParameter
from daemon.model.search_answer import Confirmation, NearestFailure, SearchAnswer, ShrunkScenario
from daemon.model.trials import Trial
from daemon.search.answers.facts import confirmation, make_answer
from daemon.search.answers.sentences import (
    changes_text,
    ending_words,
    failure_sentence,
    percentage,
    point_words,
)
from grammars.text import codec
from tests.analysis.search.pretended import made_trial, make_task, seconds

TASK = make_task(seconds("doors.kitchen_opens"), seconds("doors.swing"), runs=20)


def explored(n, kitchen, margin, guided=False):
    values = (kitchen, 5.0)
    method = "written" if n == 0 else "tpe" if guided else "halton"
    return made_trial(values, margin, n, "kitchen_door", method, guided)


def parameter(name, unit, written):
    key = name.partition(".")[2]
    return SearchParameter(name, "behaviours", 0, key, unit, 0.0, 100.0, 0.01, written=written)


@pytest.mark.parametrize(
    ("confirmed", "often", "end"),
    [
        (Confirmation(5, 5, 0.478, 1.0), " in 5 of 5 repeats", ""),
        (Confirmation(1, 5, 0.005, 0.717), " in 1 of 5 repeats", ""),
        (Confirmation(0, 5, 0.0, 0.522), " once and in none of 5 repeats", ": not reproduced"),
        (None, "", ", not repeated"),
    ],
)
def test_the_headline_says_how_often_a_failure_holds(confirmed, often, end):
    failing = made_trial((8.54, 5.0), -0.0183, near="kitchen_door")
    told = f"keeps-clear fails{often} with kitchen_opens 8.54 s instead of 5 s "
    assert failure_sentence(TASK, failing, confirmed) == (
        f"{told}(margin −0.0183 m near kitchen_door){end}"
    )


def test_a_failure_is_told_with_the_margin_of_the_oracle_that_fails():
    failing = made_trial((5.0, 5.0), -0.5, near="")
    other = replace(failing, value=replace(failing.value, oracle="reached", margin=0.1))
    for trial in (failing, other, replace(failing, value=None)):
        assert failure_sentence(TASK, trial, None) == (
            "keeps-clear fails as written (margin −0.5 m), not repeated"
        )


def test_a_search_that_finds_nothing_says_what_that_is_worth():
    points = [explored(n, 5.0 + 0.01 * n, 0.02, guided=n > 15) for n in range(20)]
    answer = make_answer(TASK, points, ended="budget", executed=20)
    assert answer.sentences == (
        "keeps-clear does not fail in 20 runs, the smallest margin is 0.02 m near kitchen_door",
        "run 0 has the smallest margin, 0.02 m near kitchen_door: as written",
        "15 of the runs are space-filling: with 95 % certainty less than 18.2 % of the space fails",
        "nothing decides clearly: in 15 space-filling runs chance gives rank correlations up to "
        "0.514",
        "the budget of 20 runs is spent",
    )
    assert answer.told_failure is None
    two = replace(TASK, scales=TASK.scales * 2)
    assert make_answer(two, points).sentences[0] == (
        "nothing fails in 20 runs, the smallest margin of keeps-clear is 0.02 m near kitchen_door"
    )
    assert make_answer(TASK, [explored(1, 5.0, None)]).sentences[0] == "no run has a margin"


def test_a_search_that_finds_failures_tells_of_them_in_order():
    points = [
        explored(0, 5.0, 0.1),
        explored(1, 6.0, -0.01),
        explored(2, 7.0, -0.05),
        explored(3, 4.0, 0.1),
        explored(4, 3.0, 0.2),
        explored(5, 2.0, 0.3),
        explored(6, 1.0, None),
        explored(7, 9.0, -0.04, guided=True),
        Trial(Proposal(8, 8, 0, "explore", "tpe", True, (0.0, 0.0))),
    ]
    first, passes = points[1], made_trial((5.99, 5.0), 0.004, 11, "kitchen_door")
    confirmed = confirmation([first for _ in range(5)])
    nearest = NearestFailure(first, passes, 12, False, confirmed)
    story = ("fails with doors", "minimal: kitchen_door (of 3)")
    shrunk = ShrunkScenario(story, True, 31, left="1 of 3 objects are left")
    answer = make_answer(
        TASK,
        points,
        ended="time",
        executed=30,
        reused=2,
        confirmed=confirmed,
        nearest=nearest,
        shrunk=shrunk,
        holding=(True, False),
    )
    assert answer.sentences == (
        "keeps-clear fails in 5 of 5 repeats with kitchen_opens 6 s instead of 5 s "
        "(margin −0.01 m near kitchen_door)",
        "with other noise it fails in 47.8 % to 100 % of runs, with 95 % certainty",
        "of 2 failures that were repeated 1 holds with most noises",
        "it passes with kitchen_opens 5.99 s instead of 5 s (margin 0.004 m near kitchen_door)",
        "there may be a nearer one: 12 runs were spent before nothing could be taken back",
        "shrunk in 31 runs: 1 of 3 objects are left",
        "3 of 8 runs fail, the first is run 1 (margin −0.01 m near kitchen_door): "
        "kitchen_opens 6 s",
        "run 2 has the smallest margin, −0.05 m near kitchen_door: kitchen_opens 7 s",
        "2 of 5 space-filling runs fail: with 95 % certainty 5.2 % to 85.4 % of the space",
        "what decides most, by rank correlation in 5 space-filling runs: kitchen_opens (−1)",
        "1 point could not be composed: no run was made of it",
        "1 run is an error and without a margin",
        "the time of 0 s is over",
    )
    assert answer.told_failure == first
    assert replace(answer, nearest=None).told_failure == answer.first
    unconfirmed = replace(answer, nearest=None, confirmed=None)
    assert unconfirmed.told_failure == answer.first
    assert unconfirmed.told_confirmation is None
    assert codec.from_json(SearchAnswer, codec.to_json(answer)) == answer


def test_the_repeats_of_a_first_failure_that_is_not_the_nearest_are_told_as_well():
    points = [explored(0, 5.0, 0.1), explored(1, 6.0, -0.01)]
    repeats = [made_trial((6.0, 5.0), margin, 1) for margin in (-0.01, -0.01, 0.2)]
    all_of_them, some = confirmation(repeats[:2]), confirmation(repeats)
    nearer = made_trial((5.5, 5.0), -0.01, 7)
    nearest = NearestFailure(nearer, None, 12, True, all_of_them)
    sentences = make_answer(TASK, points, confirmed=some, nearest=nearest).sentences
    assert sentences[0].startswith("keeps-clear fails in 2 of 2 repeats with kitchen_opens 5.5 s")
    assert "the first failure, run 1, fails in 2 of 3 repeats" in sentences


def test_failures_beyond_those_asked_for_are_explained():
    task = replace(TASK, stop="failures", failures=2)
    points = [explored(n, 6.0, -0.1) for n in range(1, 6)]
    assert make_answer(task, points, ended="failures").sentences[-1] == (
        "it ends after 2 failures, as asked; 3 others came of runs that were out by then"
    )
    assert make_answer(task, points[:2], ended="failures").sentences[-1] == (
        "it ends after 2 failures, as asked"
    )


def test_failures_that_are_not_searched_for_are_told():
    points = [explored(n, 5.0 + n, 0.1) for n in range(8)]
    assert make_answer(TASK, points).unsought == ()

    def failing(point, *oracles):
        return replace(point, unsought=oracles)

    points[:3] = [failing(p, "reached") for p in points[:2]] + [failing(points[2], "in-time")]
    assert (
        "fails as well, which this search is not about: reached in 2 of 8 runs, as written too; "
        "in-time in 1 of 8 runs"
    ) in make_answer(TASK, points).sentences


def test_random_runs_are_not_called_space_filling():
    task = replace(TASK, method="random")
    for margin in (0.1, -0.1):
        told = "; ".join(make_answer(task, [explored(n, n, margin) for n in range(1, 9)]).sentences)
        assert "space-filling" not in told
        assert "in 8 random runs" in told
    assert "8 of 8 random runs fail" in told


def test_nothing_is_said_of_the_space_when_nothing_was_drawn():
    answer = make_answer(TASK, [explored(0, 5.0, 0.1), explored(1, 6.0, 0.1, guided=True)])
    assert answer.space_filling == 0
    assert "no run was drawn without looking at results: how much fails is not known" in (
        answer.sentences
    )
    assert make_answer(TASK, []).sentences == ()


@pytest.mark.parametrize("ended", ["budget", "time", "failures", "settled", "errors", "exhausted"])
def test_every_ending_has_words(ended):
    assert ending_words(TASK, ended)
    assert ending_words(TASK, "") == ""


def test_the_largest_change_is_told_first_and_of_many_only_some():
    task = make_task(
        parameter("doors.kitchen_opens", "s", 8.0),
        parameter("mission.start.y", "m", 0.0),
        parameter("doors.trigger", "m", None),
        replace(parameter("doors.leading", "", "one"), choices=("one", "two")),
    )
    assert changes_text(task, (8.0, 0.0, 1.5, "one")) == "with trigger 1.5 m"
    assert changes_text(task, (8.54, -12.0, 1.5, "two")) == (
        "with leading two instead of one, start.y −12 m instead of 0 m, "
        "kitchen_opens 8.54 s instead of 8 s and trigger 1.5 m"
    )
    many = make_task(*(seconds(f"doors.t{i}", 5.0) for i in range(6)))
    assert changes_text(many, (5.1, 5.2, 5.3, 5.4, 5.5, 5.0)) == (
        "with t4 5.5 s instead of 5 s, t3 5.4 s instead of 5 s, t2 5.3 s instead of 5 s and 2 more"
    )
    assert point_words(many, (9.0,) * 6, most=2) == "t0 9 s, t1 9 s and 4 more"
    assert changes_text(many, (5.0,) * 6) == point_words(many, (5.0,) * 6) == "as written"


def test_a_name_keeps_its_layer_where_two_layers_have_it():
    task = make_task(seconds("doors.pause"), seconds("people.pause"), seconds("people.opens"))
    assert [task.short_name(p.name) for p in task.parameters] == [
        "doors.pause",
        "people.pause",
        "opens",
    ]


def test_bounds_are_no_narrower_than_shown():
    assert percentage(0.18104) == "18.2 %"
