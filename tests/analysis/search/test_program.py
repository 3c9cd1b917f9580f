"""A search as a whole, its runs being functions of their points."""

import re
from dataclasses import replace

import pytest

from daemon.model.search import SPACE_FILLING
from daemon.search import nearest, point_runner, program
from daemon.search.methods import COVARIANCE_FROM
from daemon.search.program import SearchStoppedError, run_search
from tests.analysis.search.searches import LocalRuns, PretendedCase
from tests.analysis.search.tasks import make_task, ranged
from tests.parts import ROOT

KITCHEN = ranged("doors.kitchen_opens")
BOTH = (KITCHEN, ranged("doors.bedroom_opens"))


def late_kitchen(point, repeat):
    """Fails where the kitchen opens more than 6 s late."""
    kitchen = float(point[0])
    return 0.1 if kitchen < 5.5 else 6.0 - kitchen


def search(*parameters, margin=late_kitchen, slots=2, refuses=lambda point: False, **changes):
    """Search from the beginning to the end; return the runs and the answer."""
    case = PretendedCase(make_task(*parameters, **changes), margin, refuses)
    runs = case.runs(slots)
    return runs, run_search(case, runs)


def phases(runs):
    return list(dict.fromkeys(proposal.phase for proposal in runs.proposals))


def comment_of(answer):
    lines = answer.found.splitlines()
    return " ".join(line.removeprefix("# ") for line in lines if not line.startswith("scenarios"))


def noisy(point, repeat):
    """Noise moves the edge by up to 1 s; the run that is searched has the lowest one."""
    return 6.0 + 0.2 * repeat - float(point[0])


def lucky(point, repeat):
    return 0.1 if repeat else 6.0 - float(point[0])


FEW = {"confirm": 0, "then": ()}
SEARCHES = {
    "the budget ends it, and nobody asked for repeats": (BOTH, {"runs": 12} | FEW),
    "it settles": ((KITCHEN,), {"stop": "settled", "window": 4, "margin": lambda p, r: 0.1}),
    "errors in a row end it": ((KITCHEN,), {"window": 1, "margin": lambda p, r: None}),
    "errors between other runs are none in a row": (
        (KITCHEN,),
        {"runs": 12, "window": 1, "margin": lambda p, r: None if 100 * p[0] % 2 < 1 else 0.1},
    ),
    "the space is exhausted": ((replace(KITCHEN, low=4.98, high=5.02),), {}),
    "it stops at the first failure and takes in those that are out": (
        (KITCHEN,),
        {"stop": "failures", "failures": 1, "window": 4} | FEW,
    ),
    "points that make no run are no errors": (
        (KITCHEN,),
        {"runs": 30, "then": (), "refuses": lambda point: point[0] < 4.0},
    ),
    "a scenario that fails as written is its own nearest failure": (
        BOTH,
        {"runs": 20, "margin": lambda p, r: -0.25},
    ),
    "of a system that is not repeatable the median of three counts": (
        (KITCHEN,),
        {"margin": lambda p, r: (-1.0, 0.2, 0.3)[r % 3], "runs": 12, "repeatable": False},
    ),
    "so it does on the way to the nearest failure": ((KITCHEN,), {"runs": 60, "repeatable": False}),
    "a failure holds that three of five repeats have": (BOTH, {"runs": 20, "margin": noisy}),
    "noise beyond these changes nothing": (BOTH, {"runs": 20, "margin": noisy, "confirm": 9}),
    "no failure holds": (BOTH, {"runs": 20, "margin": lucky}),
    "of no failure that is repeated once either": (
        BOTH,
        {"runs": 20, "margin": lucky, "confirm": 1},
    ),
}


def journal(runs, answer):
    """What a search did and what it says, line by line."""
    repeats = {}
    for proposal in runs.proposals:
        repeats.setdefault(proposal.phase, []).append(proposal.repeat)
    for phase, made in repeats.items():
        yield f"{phase}: {len(made)} runs, repeats {sorted(set(made))}"
    near = answer.nearest
    if near is not None:
        passes = near.passes and near.passes.point
        holds = f"fails in {near.confirmed.failed} of {near.confirmed.runs}"
        yield f"nearest {near.result.point} {holds}, passes {passes}"
    names = ["explored", "failed", "errors", "refused", "space_filling", "repeated", "holding"]
    yield f"{answer.ended}: " + ", ".join(f"{name} {getattr(answer, name)}" for name in names)
    yield from answer.sentences
    told = comment_of(answer)
    yield f"found: {'as told first' if answer.sentences[0] in told else told}"


def test_searches_from_beginning_to_end(golden):
    lines = []
    for name, (parameters, changes) in SEARCHES.items():
        runs, answer = search(*parameters, **({"runs": 500} | changes))
        assert runs.proposals[0].values == tuple(p.written for p in parameters)
        lines += [f"--- {name}", *journal(runs, answer)]
    golden("searches.txt", "\n".join([*lines, ""]))


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


def test_runs_that_leave_no_result_are_errors():
    case = PretendedCase(make_task(KITCHEN, window=1), late_kitchen)
    answer = run_search(case, LocalRuns(lambda candidates: [None for _ in candidates]))
    assert (answer.ended, answer.errors, answer.space_filling) == ("errors", 5, 0)


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


PAGE = " ".join((ROOT / "docs" / "searches.md").read_text("utf-8").split())
WORDS = {"two": 2, "three": 3, "five": 5}


@pytest.mark.parametrize(
    ("pattern", "value"),
    [
        (r"[Aa]t most (\d+) points; one that fails", nearest.NEAREST_POINTS),
        (r"its (\d+) points were spent", nearest.NEAREST_POINTS),
        (r"At most (\d+) runs\.", program.SHRINK_RUNS),
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
