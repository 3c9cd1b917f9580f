"""A search as a whole, its runs being functions of their points."""

from dataclasses import replace

import pytest

from daemon.search.program import ERRORS_IN_A_ROW, SearchStoppedError, run_search
from tests.analysis.search.local_runs import LocalRuns
from tests.analysis.search.pretended import PretendedCase, make_task, seconds

KITCHEN = seconds("doors.kitchen_opens", 5.0)
BEDROOM = seconds("doors.bedroom_opens", 5.0)


def comment_of(answer):
    lines = answer.found.splitlines()
    return " ".join(line.removeprefix("# ") for line in lines if not line.startswith("scenarios"))


def late_kitchen(point, repeat):
    """Fails where the kitchen opens more than 6 s late."""
    kitchen = float(point[0])
    return 0.1 if kitchen < 5.5 else 6.0 - kitchen


def test_the_scenario_as_written_comes_first_and_the_budget_ends_the_search():
    case = PretendedCase(make_task(KITCHEN, BEDROOM, runs=12, confirm=0, then=()), late_kitchen)
    runs = case.runs()
    answer = run_search(case, runs)
    assert answer.ended == "budget"
    assert (answer.explored, len(runs.proposals)) == (12, 12)
    assert runs.proposals[0].values == (5.0, 5.0)
    assert answer.space_filling == 11, "the scenario as written was not drawn"


@pytest.mark.parametrize("method", ["halton", "random", "auto"])
def test_runs_are_the_same_however_many_run_at_a_time(method):
    lists = []
    for slots in (1, 4):
        case = PretendedCase(make_task(KITCHEN, BEDROOM, runs=24, method=method), late_kitchen)
        runs = case.runs(slots)
        answer = run_search(case, runs)
        lists.append((runs.proposals, runs.digests, answer))
    assert lists[0] == lists[1]


def test_what_was_found_is_confirmed_brought_near_and_handed_on():
    case = PretendedCase(make_task(KITCHEN, BEDROOM), late_kitchen)
    runs = case.runs()
    answer = run_search(case, runs)
    assert answer.first is not None
    assert answer.confirmed is not None
    assert (answer.confirmed.failed, answer.confirmed.runs) == (5, 5)
    nearest = answer.nearest
    assert nearest is not None
    assert nearest.complete
    assert (nearest.result.point, nearest.passes.point) == ((6.01, 5.0), (6.0, 5.0))
    assert nearest.confirmed is not None
    assert answer.sentences[0] in comment_of(answer)
    assert nearest.result.digest == runs.digests[nearest.result.proposal.position]
    phases = list(dict.fromkeys(proposal.phase for proposal in runs.proposals))
    assert phases == ["explore", "confirm", "nearest"]
    assert [p.position for p in runs.proposals] == list(range(len(runs.proposals)))


def test_the_same_search_again_executes_nothing():
    task = make_task(KITCHEN, BEDROOM)
    case, again = PretendedCase(task, late_kitchen), PretendedCase(task, late_kitchen)
    runs = case.runs()
    answer = run_search(case, runs)
    repeated = run_search(again, again.runs(results=runs.results))
    assert again.executed == []
    assert repeated.reused == len(case.executed)
    assert repeated == replace(answer, executed=0, reused=answer.executed)


def test_it_stops_at_the_first_failure_and_takes_in_what_is_out():
    task = make_task(KITCHEN, runs=500, stop="failures", failures=1, window=4, then=(), confirm=0)
    case = PretendedCase(task, late_kitchen)
    answer = run_search(case, case.runs())
    assert answer.ended == "failures"
    assert answer.first is not None
    assert answer.explored == answer.first.number + 4


def test_it_stops_when_nothing_gets_better():
    task = make_task(KITCHEN, runs=500, stop="settled", window=4)
    case = PretendedCase(task, lambda point, repeat: 0.1)
    answer = run_search(case, case.runs())
    assert answer.ended == "settled"
    assert answer.explored == 1 + 20 + 3, "the first, twenty as good, and those that were out"


def test_errors_in_a_row_end_it():
    case = PretendedCase(make_task(KITCHEN, runs=100, window=1), lambda point, repeat: None)
    answer = run_search(case, case.runs())
    assert (answer.ended, answer.errors) == ("errors", ERRORS_IN_A_ROW)
    assert answer.space_filling == 0


def test_points_that_make_no_run_are_told_and_are_no_errors():
    def refuses(point):
        return float(point[0]) < 4.0

    case = PretendedCase(make_task(KITCHEN, runs=30, then=()), late_kitchen, refuses)
    runs = case.runs()
    answer = run_search(case, runs)
    assert answer.ended == "budget"
    assert answer.refused > 3
    assert answer.errors == 0
    explored = [p for p in runs.proposals if p.phase == "explore"]
    assert answer.explored == 30 == len(explored) + answer.refused
    assert f"{answer.refused} points could not be composed: no run was made of them" in (
        answer.sentences
    )


def test_a_small_space_is_exhausted():
    few = replace(KITCHEN, low=4.98, high=5.02)
    case = PretendedCase(make_task(few, runs=100), late_kitchen)
    assert run_search(case, case.runs()).ended == "exhausted"


def test_a_scenario_that_fails_as_written_is_its_own_nearest_failure():
    case = PretendedCase(make_task(KITCHEN, BEDROOM), lambda point, repeat: -0.25)
    answer = run_search(case, case.runs())
    assert answer.nearest is not None
    assert answer.nearest.result.point == (5.0, 5.0)
    assert answer.sentences[0] == (
        "keeps-clear fails in 5 of 5 repeats as written (margin −0.25 m near door)"
    )
    assert answer.nearest.confirmed == answer.confirmed


def test_of_a_system_that_is_not_repeatable_the_median_of_three_counts():
    def noisy(point, repeat):
        return (-1.0, 0.2, 0.3)[repeat % 3]

    case = PretendedCase(make_task(KITCHEN, runs=12, repeatable=False), noisy)
    runs = case.runs()
    answer = run_search(case, runs)
    assert answer.explored == 4, "twelve runs, three of each point"
    assert len(runs.proposals) == 12
    assert answer.failed == 0
    assert answer.best is not None
    assert answer.best.value is not None
    assert answer.best.value.margin == 0.2


class Limited(LocalRuns):
    """Runs of which no more are executed after a while."""

    def __init__(self, case, most):
        super().__init__(executor=case.execute)
        self.most = most

    def result(self, position):
        if position >= self.most:
            raise SearchStoppedError
        return super().result(position)


@pytest.mark.parametrize("most", [3, 18, 24, 30])
def test_what_was_found_before_it_is_cancelled_is_told(most):
    case = PretendedCase(make_task(KITCHEN, BEDROOM), late_kitchen)
    with pytest.raises(SearchStoppedError) as caught:
        run_search(case, Limited(case, most))
    answer = caught.value.answer
    assert answer is not None
    assert not answer.ended
    assert answer.explored == min(most, 20)
    assert bool(answer.found) == bool(answer.failed)


class Resumed(LocalRuns):
    """Runs of a search whose time was over when it went down, begun again much later."""

    def __init__(self, case, before):
        super().__init__(executor=case.execute)
        self.before = before

    def issued(self, position):
        return self.before[position] if position < len(self.before) else None

    def elapsed(self):
        return 1000.0


class Clocked(LocalRuns):
    """Every run takes a second."""

    def elapsed(self):
        return float(len(self.proposals))


def test_a_search_that_went_down_after_its_time_issues_the_same_runs_again():
    task = make_task(KITCHEN, BEDROOM, runs=500, seconds=15.0)
    case = PretendedCase(task, late_kitchen)
    first = Clocked(executor=case.execute)
    answer = run_search(case, first)
    assert (answer.ended, answer.explored) == ("time", 15)
    assert len(first.proposals) > 20
    for survived in (len(first.proposals), 15, 17):
        again = Resumed(case, first.proposals[:survived])
        repeated = run_search(case, again)
        assert again.digests == first.digests
        assert repeated == answer
    early = Resumed(case, first.proposals[:9])
    assert run_search(case, early).explored == 9


def test_reports_tell_how_far_it_is():
    told = []

    def listen(phase, note, answer):
        told.append((phase, note))
        assert answer.ended == ""

    case = PretendedCase(make_task(KITCHEN, BEDROOM), late_kitchen)
    run_search(case, case.runs(on_report=listen))
    assert told[0] == ("explore", "1 of 20 runs, best 0.1 m")
    phases = list(dict.fromkeys(phase for phase, _ in told))
    assert phases == ["explore", "confirm", "nearest"]


def test_local_runs_that_leave_no_result_are_lost():
    def executes_nothing(candidates):
        return [None for _ in candidates]

    case = PretendedCase(make_task(KITCHEN, window=1), late_kitchen)
    answer = run_search(case, LocalRuns(executor=executes_nothing))
    assert (answer.ended, answer.errors) == ("errors", 5)


def test_noise_beyond_the_repeats_that_say_what_holds_is_told_and_changes_nothing():
    def noisy(point, repeat):
        # Noise moves the edge by up to 1 s; the run that is searched has the lowest one.
        return 6.0 + 0.2 * repeat - float(point[0])

    for confirm in (5, 9):
        case = PretendedCase(make_task(KITCHEN, BEDROOM, confirm=confirm), noisy)
        nearest = run_search(case, case.runs()).nearest
        assert nearest is not None
        assert nearest.result.point == (6.61, 5.0), "three of five"
        assert (nearest.confirmed.failed, nearest.confirmed.runs) == (3, confirm)


def chance_near_and_solid_far(point, repeat):
    """Fails where the kitchen opens late; a little late it does so in the first noise alone."""
    kitchen = float(point[0])
    if kitchen >= 7.5:
        return -0.02
    return -0.001 if 5.2 <= kitchen < 6.5 and repeat == 0 else 0.1


@pytest.mark.parametrize("slots", [1, 4])
def test_the_failure_that_is_told_holds_whatever_the_noise(slots):
    case = PretendedCase(make_task(KITCHEN, BEDROOM, runs=24), chance_near_and_solid_far)
    runs = case.runs(slots)
    answer = run_search(case, runs)
    assert answer.first is not None
    nearest = answer.nearest
    assert nearest is not None
    assert (nearest.result.point, nearest.passes.point) == ((7.5, 5.0), (7.49, 5.0))
    assert nearest.confirmed is not None
    assert (nearest.confirmed.failed, nearest.confirmed.runs) == (5, 5)
    assert len(runs.digests) == len(set(runs.digests)), "no repeat is run twice"
    spent = [p for p in runs.proposals if p.phase != "explore"]
    assert nearest.runs < len(spent)
    assert answer.repeated > answer.holding > 0
    assert any(s.startswith(f"of {answer.repeated} failures that were") for s in answer.sentences)


@pytest.mark.parametrize("confirm", [5, 1])
def test_where_no_failure_holds_the_first_one_is_told_as_not_reproduced(confirm):
    def lucky(point, repeat):
        return 0.1 if repeat else 6.0 - float(point[0])

    case = PretendedCase(make_task(KITCHEN, BEDROOM, confirm=confirm), lucky)
    answer = run_search(case, case.runs())
    assert answer.nearest is None
    assert answer.told_failure == answer.first
    assert answer.sentences[0].endswith(": not reproduced")
    assert answer.repeated > answer.holding == 0
    assert answer.sentences[0] in comment_of(answer)


def test_of_a_system_that_is_not_repeatable_the_median_says_what_holds():
    task = make_task(KITCHEN, runs=60, repeatable=False)
    case = PretendedCase(task, late_kitchen)
    runs = case.runs()
    answer = run_search(case, runs)
    assert answer.nearest is not None
    assert answer.nearest.result.point == (6.01,)
    near = [p for p in runs.proposals if p.phase == "nearest"]
    assert [p.repeat for p in near] == [0, 1, 2] * (len(near) // 3)
    assert {p.repeat for p in runs.proposals if p.phase == "confirm"} == {3, 4, 5, 6, 7}
