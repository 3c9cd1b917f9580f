"""The answer of a search, sentence by sentence."""

from dataclasses import replace

import pytest

from daemon.model.proposals import Proposal
from daemon.model.search_answer import NearestFailure, SearchAnswer, ShrunkScenario
from daemon.model.trials import Trial
from daemon.search.answers.facts import confirmation, make_answer
from daemon.search.answers.sentences import ending_words
from grammars.text import codec
from tests.daemon.search.pretended import made_trial, make_task, seconds

TASK = make_task(seconds("doors.kitchen_opens"), seconds("doors.swing"), runs=20)


def explored(n, kitchen, margin, guided=False):
    values = (kitchen, 5.0)
    method = "written" if n == 0 else "tpe" if guided else "halton"
    return made_trial(values, margin, n, "kitchen_door", method, guided)


def test_a_search_that_finds_nothing_says_what_that_is_worth():
    points = [explored(n, 5.0 + 0.01 * n, 0.02, guided=n > 15) for n in range(20)]
    answer = make_answer(TASK, points, ended="budget", executed=20)
    assert answer.sentences == (
        "the smallest margin is 0.02 m (keeps-clear near kitchen_door), in run 0: as written",
        "20 runs, nothing below 0.02 m",
        "15 of the runs are space-filling: with 95 % certainty less than 18.2 % of the space fails",
        "nothing decides clearly: in 15 space-filling runs chance gives rank correlations up to "
        "0.514",
        "the budget of 20 runs is spent",
    )
    assert answer.told_failure is None


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
    first = points[1]
    confirmed = confirmation([first for _ in range(5)])
    nearest = NearestFailure(first, (), None, 12, False, "kitchen_opens 6 s and …", confirmed)
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
    )
    assert answer.sentences == (
        "3 of 8 runs fail, the first is run 1: keeps-clear fails by 0.01 m near kitchen_door",
        "run 1 has kitchen_opens 6 s",
        "the smallest margin is −0.05 m (keeps-clear near kitchen_door), in run 2: "
        "kitchen_opens 7 s",
        "run 1 fails in 5 of 5 repeats with other noise (47.8 % to 100 % with 95 % certainty)",
        "nearest failure, run 1: kitchen_opens 6 s and …",
        "there may be a nearer one: 12 runs were spent before nothing could be taken back",
        "shrunk in 31 runs: 1 of 3 objects are left",
        "1 distinct failure: keeps-clear near kitchen_door (3 runs)",
        "2 of 5 space-filling runs fail: with 95 % certainty 5.2 % to 85.4 % of the space",
        "what decides most, by rank correlation in 5 space-filling runs: kitchen_opens (−1)",
        "1 point could not be composed: no run was made of it",
        "1 run is an error and without a margin",
        "the time of 0 s is over",
    )
    assert answer.told_failure == first
    assert replace(answer, nearest=None).told_failure == answer.first
    assert replace(answer, nearest=None, confirmed=None).told_failure == answer.best
    assert codec.from_json(SearchAnswer, codec.to_json(answer)) == answer


def test_the_repeats_of_another_nearest_failure_are_told_as_well():
    points = [explored(0, 5.0, 0.1), explored(1, 6.0, -0.01)]
    repeats = [made_trial((6.0, 5.0), margin, 1) for margin in (-0.01, -0.01, 0.2)]
    all_of_them, some = confirmation(repeats[:2]), confirmation(repeats)
    nearer = made_trial((5.5, 5.0), -0.01, 7)
    nearest = NearestFailure(nearer, (), None, 12, True, "kitchen_opens 5.5 s", all_of_them)
    told = make_answer(TASK, points, confirmed=some, nearest=nearest).sentences
    assert [sentence for sentence in told if "repeats" in sentence or "nearest" in sentence] == [
        "run 1 fails in 2 of 3 repeats with other noise (9.4 % to 99.2 % with 95 % certainty)",
        "nearest failure: kitchen_opens 5.5 s",
        "the nearest failure fails in 2 of 2 repeats with other noise "
        "(15.8 % to 100 % with 95 % certainty)",
    ]


def test_a_scenario_that_fails_as_written_is_told_once():
    failing = explored(0, 5.0, -0.1)
    confirmed = confirmation([failing] * 4)
    nearest = NearestFailure(
        failing, (), None, 0, True, "the scenario as written: keeps-clear fails", confirmed
    )
    told = make_answer(TASK, [failing], confirmed=confirmed, nearest=nearest).sentences
    assert told[1] == "run 0 is the scenario as written"
    assert "nearest failure, run 0: the scenario as written: keeps-clear fails" in told
    assert sum("repeats" in sentence for sentence in told) == 1


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
