"""A search as a whole, its runs being functions of their points."""

import re
from dataclasses import replace

import pytest

from daemon.model.search import SPACE_FILLING
from daemon.search import nearest, point_runner, program, shrinking
from daemon.search.methods import COVARIANCE_FROM
from daemon.search.program import ERRORS_IN_A_ROW, SearchStoppedError, run_search
from tests.analysis.search.searches import LocalRuns, PretendedCase
from tests.analysis.search.tasks import make_task, ranged
from tests.parts import ROOT

KITCHEN = ranged("doors.kitchen_opens")
BOTH = (KITCHEN, ranged("doors.bedroom_opens"))


def late_kitchen(point, repeat):
    """Fails where the kitchen opens more than 6 s late."""
    kitchen = float(point[0])
    return 0.1 if kitchen < 5.5 else 6.0 - kitchen


def search(*parameters, margin=late_kitchen, slots=2, **changes):
    """Search from the beginning to the end; return the runs and the answer."""
    case = PretendedCase(make_task(*parameters, **changes), margin)
    runs = case.runs(slots)
    return runs, run_search(case, runs)


def phases(runs):
    return list(dict.fromkeys(proposal.phase for proposal in runs.proposals))


def comment_of(answer):
    lines = answer.found.splitlines()
    return " ".join(line.removeprefix("# ") for line in lines if not line.startswith("scenarios"))


def test_the_scenario_as_written_comes_first_and_the_budget_ends_the_search():
    runs, answer = search(*BOTH, runs=12, confirm=0, then=())
    assert (answer.ended, answer.explored, len(runs.proposals)) == ("budget", 12, 12)
    assert runs.proposals[0].values == (5.0, 5.0)
    assert answer.space_filling == 11, "the scenario as written was not drawn"
    assert answer.failed > answer.repeated == 0, "nobody asked for repeats"


@pytest.mark.parametrize("method", ["halton", "random", "auto"])
def test_runs_are_the_same_however_many_run_at_a_time(method):
    (one, answer), (four, same) = (
        search(*BOTH, runs=24, method=method, slots=slots) for slots in (1, 4)
    )
    assert (one.proposals, one.digests, answer) == (four.proposals, four.digests, same)


def test_a_failure_is_confirmed_brought_near_and_handed_on():
    reports = []
    case = PretendedCase(make_task(*BOTH), late_kitchen)
    runs = case.runs(on_report=lambda *report: reports.append(report))
    answer = run_search(case, runs)
    assert (answer.confirmed.failed, answer.confirmed.runs) == (5, 5)
    nearest = answer.nearest
    assert nearest.complete
    assert (nearest.result.point, nearest.passes.point) == ((6.01, 5.0), (6.0, 5.0))
    assert nearest.confirmed is not None
    assert answer.sentences[0] in comment_of(answer)
    assert nearest.result.digest == runs.digests[nearest.result.proposal.position]
    assert [p.position for p in runs.proposals] == list(range(len(runs.proposals)))
    assert reports[0][:2] == ("explore", "1 of 20 runs, best 0.1 m")
    assert list(dict.fromkeys(phase for phase, *_ in reports)) == phases(runs)
    assert phases(runs) == ["explore", "confirm", "nearest"]
    assert {report.ended for *_, report in reports} == {""}


def test_the_same_search_again_executes_nothing():
    runs, answer = search(*BOTH)
    again = PretendedCase(make_task(*BOTH), late_kitchen)
    repeated = run_search(again, again.runs(results=runs.results))
    assert again.executed == []
    assert repeated == replace(answer, executed=0, reused=len(runs.results))


@pytest.mark.parametrize(
    ("changes", "margin", "ended", "explored"),
    [
        # The first, twenty as good, and those that were out.
        ({"stop": "settled", "window": 4}, lambda point, repeat: 0.1, "settled", 1 + 20 + 3),
        ({"window": 1}, lambda point, repeat: None, "errors", ERRORS_IN_A_ROW),
        # Errors between other runs are none in a row.
        (
            {"runs": 12, "window": 1},
            lambda p, repeat: None if 100 * p[0] % 2 < 1 else 0.1,
            "budget",
            12,
        ),
        ({"parameters": (replace(KITCHEN, low=4.98, high=5.02),)}, late_kitchen, "exhausted", 5),
    ],
)
def test_a_search_ends_before_its_budget(changes, margin, ended, explored):
    case = PretendedCase(replace(make_task(KITCHEN, runs=500), **changes), margin)
    answer = run_search(case, case.runs())
    assert (answer.ended, answer.explored) == (ended, explored)


def test_it_stops_at_the_first_failure_and_takes_in_those_that_are_out():
    more = {"stop": "failures", "failures": 1, "window": 4, "then": (), "confirm": 0}
    _, answer = search(KITCHEN, runs=500, **more)
    assert (answer.ended, answer.explored) == ("failures", answer.first.number + 4)


def test_runs_that_leave_no_result_are_errors():
    case = PretendedCase(make_task(KITCHEN, window=1), late_kitchen)
    answer = run_search(case, LocalRuns(lambda candidates: [None for _ in candidates]))
    assert (answer.ended, answer.errors, answer.space_filling) == ("errors", 5, 0)


def test_points_that_make_no_run_are_told_and_are_no_errors():
    task = make_task(KITCHEN, runs=30, then=())
    case = PretendedCase(task, late_kitchen, lambda point: point[0] < 4.0)
    runs = case.runs()
    answer = run_search(case, runs)
    assert (answer.ended, answer.errors, answer.explored) == ("budget", 0, 30)
    assert answer.refused > 3
    assert len([p for p in runs.proposals if p.phase == "explore"]) == 30 - answer.refused
    sentence = f"{answer.refused} points could not be composed: no run was made of them"
    assert sentence in answer.sentences


def test_a_scenario_that_fails_as_written_is_its_own_nearest_failure():
    _, answer = search(*BOTH, margin=lambda point, repeat: -0.25)
    assert answer.nearest.result.point == (5.0, 5.0)
    assert answer.nearest.confirmed == answer.confirmed
    assert answer.sentences[0] == (
        "keeps-clear fails in 5 of 5 repeats as written (margin −0.25 m near door)"
    )


def test_of_a_system_that_is_not_repeatable_the_median_of_three_counts():
    def noisy(point, repeat):
        return (-1.0, 0.2, 0.3)[repeat % 3]

    runs, answer = search(KITCHEN, margin=noisy, runs=12, repeatable=False)
    assert (answer.explored, len(runs.proposals)) == (4, 12), "three of each point"
    assert (answer.failed, answer.best.value.margin) == (0, 0.2)
    runs, answer = search(KITCHEN, runs=60, repeatable=False)
    assert answer.nearest.result.point == (6.01,)
    near = [p.repeat for p in runs.proposals if p.phase == "nearest"]
    assert near == [0, 1, 2] * (len(near) // 3)
    assert {p.repeat for p in runs.proposals if p.phase == "confirm"} == {3, 4, 5, 6, 7}


class Limited(LocalRuns):
    """Runs of which no more than ``most`` are executed."""

    def result(self, position):
        if position >= self.most:
            raise SearchStoppedError
        return super().result(position)


@pytest.mark.parametrize("most", [3, 18, 24, 30])
def test_an_answer_so_far_is_there_when_a_search_is_cancelled(most):
    case = PretendedCase(make_task(*BOTH), late_kitchen)
    runs = Limited(case.execute)
    runs.most = most
    with pytest.raises(SearchStoppedError) as caught:
        run_search(case, runs)
    answer = caught.value.answer
    assert (answer.ended, answer.explored) == ("", min(most, 20))
    assert bool(answer.found) == bool(answer.failed)


class Clocked(LocalRuns):
    """Runs that take a second each; those of a life ``before`` are known, and it is late then."""

    before = None

    def issued(self, position):
        return dict(enumerate(self.before or ())).get(position)

    def elapsed(self):
        return float(len(self.proposals)) if self.before is None else 1000.0


def test_a_search_that_went_down_after_its_time_issues_the_same_runs_again():
    case = PretendedCase(make_task(*BOTH, runs=500, seconds=15.0), late_kitchen)
    first = Clocked(case.execute)
    answer = run_search(case, first)
    assert (answer.ended, answer.explored) == ("time", 15)
    assert len(first.proposals) > 20
    for survived in (len(first.proposals), 15, 17):
        again = Clocked(case.execute)
        again.before = first.proposals[:survived]
        assert run_search(case, again) == answer
        assert again.digests == first.digests
    early = Clocked(case.execute)
    early.before = first.proposals[:9]
    assert run_search(case, early).explored == 9


@pytest.mark.parametrize("confirm", [5, 9])
def test_noise_beyond_the_repeats_that_say_what_holds_is_told_and_changes_nothing(confirm):
    def noisy(point, repeat):
        # Noise moves the edge by up to 1 s; the run that is searched has the lowest one.
        return 6.0 + 0.2 * repeat - float(point[0])

    nearest = search(*BOTH, margin=noisy, confirm=confirm)[1].nearest
    assert nearest.result.point == (6.61, 5.0), "three of five"
    assert (nearest.confirmed.failed, nearest.confirmed.runs) == (3, confirm)


@pytest.mark.parametrize("confirm", [5, 1])
def test_where_no_failure_holds_the_first_one_is_told_as_not_reproduced(confirm):
    def lucky(point, repeat):
        return 0.1 if repeat else 6.0 - float(point[0])

    _, answer = search(*BOTH, margin=lucky, confirm=confirm)
    assert answer.nearest is None
    assert answer.told_failure == answer.first
    assert answer.sentences[0].endswith(": not reproduced")
    assert answer.repeated > answer.holding == 0
    assert answer.sentences[0] in comment_of(answer)


PAGE = " ".join((ROOT / "docs" / "search.md").read_text("utf-8").split())
WORDS = {"two": 2, "three": 3, "five": 5, "twenty": 20}


@pytest.mark.parametrize(
    ("pattern", "value"),
    [
        (r"[Aa]t most (\d+) points; one that fails", nearest.NEAREST_POINTS),
        (r"its (\d+) points were spent", nearest.NEAREST_POINTS),
        (r"looked for at up to (\d+) points", nearest.NEAREST_POINTS),
        (r"for at most (\d+) of the points", nearest._TAKING_BACK),
        (r"the next worst, (\w+) in all", nearest._STARTS),
        (r"until one does, up to (\w+)", nearest._MOST_STARTS),
        (r"At most (\d+) runs\.", shrinking.SHRINK_RUNS),
        (r"candidates are runs of the search, at most (\d+)", shrinking.SHRINK_RUNS),
        (r"that is after (\d+) results", program._SETTLED_RUNS),
        (r"results, or (\w+) windows", program._SETTLED_WINDOWS),
        (r"(\w+) errors in a row", program.ERRORS_IN_A_ROW),
        (r"every point is run (\w+) times", point_runner.MEDIAN_OF),
        (r"of `confirm:`, but (\w+) at least", point_runner._FEWEST_OTHERS),
        (r"at least and (\w+) at most", point_runner._MOST_OTHERS),
        (r"`auto` \| (\d+) runs that fill", SPACE_FILLING),
        (r"from run (\d+) on `cma`", COVARIANCE_FROM),
    ],
)
def test_a_number_of_the_page_about_searches_is_the_programs(pattern, value):
    words = {word.lower() for word in re.findall(pattern, PAGE)}
    assert {WORDS.get(word) or int(word) for word in words} == {value}
