"""What runs say about a search: trials, findings, and the answer sentence by sentence."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.model.search import ANY, OracleScale, Proposal
from daemon.model.search_answer import (
    Confirmation,
    Influence,
    NearestFailure,
    SearchAnswer,
    ShrunkScenario,
)
from daemon.model.spec import LeadingMargin
from daemon.model.trials import Trial, first_failure, median_trial, read_trial
from daemon.model.verdicts import Outcome, RunState, Verdict
from daemon.search.answers.facts import (
    confirmation,
    correlation_ratio,
    distinct_failures,
    make_answer,
    parameter_influence,
    rank_correlation,
)
from daemon.search.answers.sentences import (
    changes_text,
    failure_sentence,
    finding_words,
    is_by_chance,
    percentage,
    point_words,
)
from grammars.text import codec
from tests.analysis.search.searches import made_trial, verdict_of
from tests.analysis.search.tasks import ORACLE, chosen, make_task, ranged
from tests.make import run_result, run_row

TASK = make_task(ranged("doors.kitchen_opens"), ranged("doors.swing"))
SEVERAL = replace(
    TASK, minimise=ANY, scales=(OracleScale("clear", 0.25, "m"), OracleScale("in-time", 60.0, "s"))
)


def row(*verdicts, leads=None, ended="finished", **more):
    """The row of a run with these verdicts."""
    proposal = Proposal(3, 2, 0, "explore", "halton", False, (5.0, 5.0))
    if leads is None:
        leads = tuple(LeadingMargin(v.oracle, v.lower, v.unit) for v in verdicts)
    result = run_result(*verdicts, leads=leads, ended=ended)
    return run_row("s.3", "s.2", result=result, proposal=proposal, **more)


def open_verdict(outcome):
    return Verdict(ORACLE, "", outcome, None, None, "m")


FAILS = verdict_of(ORACLE, -0.2)
CLEAR, IN_TIME = verdict_of("clear", -0.025), verdict_of("in-time", 12.0, unit="s")


@pytest.mark.parametrize(
    ("task", "run", "outcome", "value", "oracle"),
    [
        (TASK, row(verdict_of(ORACLE, 0.2), verdict_of("other", -1.0), outcome=Outcome.FAIL),
         Outcome.PASS, 0.2, ORACLE),
        # Of any the smallest share counts, and a failure wins.
        (SEVERAL, row(verdict_of("clear", 0.1), IN_TIME), Outcome.PASS, 0.2, "in-time"),
        (SEVERAL, row(CLEAR, IN_TIME), Outcome.FAIL, -0.1, "clear"),
        (SEVERAL, row(CLEAR, IN_TIME, leads=(LeadingMargin("in-time", 12.0, "s"),)),
         Outcome.FAIL, 0.2, "clear"),
        # What cannot be trusted is an error without a value.
        (TASK, row(FAILS, ended="crashed"), Outcome.ERROR, None, ""),
        (TASK, row(FAILS, state=RunState.LOST), Outcome.ERROR, None, ""),
        (TASK, row(verdict_of("other", 0.2)), Outcome.ERROR, None, ""),
        (TASK, row(open_verdict(Outcome.ERROR)), Outcome.ERROR, None, ORACLE),
        (TASK, row(open_verdict(Outcome.INCONCLUSIVE)), Outcome.INCONCLUSIVE, None, ORACLE),
    ],
)  # fmt: skip
def test_a_trial_is_about_the_oracle_in_question(task, run, outcome, value, oracle):
    trial = read_trial(task, run)
    assert trial.outcome is outcome
    assert (trial.value and trial.value.value) == value
    assert (trial.verdict.oracle if trial.verdict else "") == oracle


def test_a_failure_of_another_oracle_is_unsought():
    run = row(verdict_of(ORACLE, 0.2), verdict_of("other", -1.0))
    assert read_trial(TASK, run).unsought == ("other",)


def test_the_median_is_one_of_the_runs():
    trials = [made_trial((5.0,), margin, n) for n, margin in enumerate((0.3, -0.1, None, 0.2))]
    assert median_trial(trials).number == 3
    assert median_trial(trials[:2]).number == 1, "of two, the worse one"
    assert median_trial(trials[2:3]).outcome is Outcome.ERROR
    assert first_failure(trials).number == 1


def test_repeats_without_a_verdict_confirm_nothing():
    trials = [made_trial((5.0,), margin) for margin in (0.3, -0.1, None)]
    found = confirmation(trials)
    assert (found.failed, found.runs) == (1, 2)
    assert found.low < 0.5 < found.high
    assert confirmation(trials[2:]) is None


def at(waypoint, trial, **changes):
    """A trial that fails on the way to a waypoint."""
    return replace(trial, value=replace(trial.value, waypoint=waypoint, **changes))


def test_failures_at_the_same_door_on_the_same_way_are_one():
    found = distinct_failures([
        made_trial((1.0,), -0.01, 1, "kitchen_door"),
        made_trial((2.0,), 0.3, 2, "kitchen_door"),
        made_trial((3.0,), -0.05, 3, "kitchen_door"),
        made_trial((4.0,), -0.9, 4, "bedroom_door"),
        at("w2", made_trial((5.0,), -0.02, 5, "kitchen_door")),
        made_trial((6.0,), None, 6),
    ])  # fmt: skip
    assert [(f.oracle, f.object, f.waypoint, f.count, f.example.number) for f in found] == [
        ("keeps-clear", "kitchen_door", "", 2, 3),
        ("keeps-clear", "bedroom_door", "", 1, 4),
        ("keeps-clear", "kitchen_door", "w2", 1, 5),
    ]


def test_a_failure_is_about_what_its_margin_is_about():
    missed = at("kitchen", made_trial((1.0,), -8.53, 8, "window"), object="kitchen")
    (found,) = distinct_failures([missed])
    assert (found.object, found.waypoint) == ("kitchen", "kitchen")
    assert finding_words(found) == "keeps-clear on the way to kitchen (1 run)"
    assert at("", missed, oracle="other").about == "window"
    assert at("", missed, object="").about == "window"
    assert replace(missed, value=None).about == "window"
    assert replace(missed, value=None, verdict=None).about == ""


def test_correlations_are_one_where_a_value_decides_and_nought_where_nothing_varies():
    values = np.arange(40.0)
    assert rank_correlation(values, np.minimum(values, 30.0)) == pytest.approx(
        0.9922306062528966, rel=1e-12
    )
    assert rank_correlation(values, np.full(40, 0.1)) == 0.0
    margins = np.array([0.1, 0.1, -0.2, -0.2])
    assert correlation_ratio(["a", "a", "b", "b"], margins) == pytest.approx(1.0)
    assert correlation_ratio(["a", "b", "a", "b"], margins) == pytest.approx(0.0)
    assert correlation_ratio(["a", "b", "a", "b"], np.zeros(4)) == 0.0


@pytest.mark.parametrize(
    ("name", "correlation", "runs", "by_chance"),
    [
        ("doors.t", 0.552, 10, True),
        ("doors.t", -0.552, 10, True),
        ("doors.t", -0.552, 16, False),
        ("doors.t", -0.65, 10, False),
        # Three groups differ more by chance than two ends of a line.
        ("doors.who", 0.7, 10, True),
        ("doors.who", 0.8, 10, False),
        ("doors.t", 1.0, 2, True),
        ("doors.t", float("nan"), 100, True),
    ],
)
def test_fewer_runs_give_larger_correlations_by_chance(name, correlation, runs, by_chance):
    task = make_task(ranged("doors.t"), chosen("doors.who", "a", "b", "c"))
    assert is_by_chance(task, Influence(name, correlation, runs)) is by_chance


def test_influence_is_of_the_points_that_were_drawn():
    task = make_task(ranged("doors.t"), chosen("doors.who", "a", "b"))
    drawn = [made_trial((float(n), "ab"[n % 2]), 0.1 * n, n) for n in range(1, 7)]
    misleading = [
        made_trial((5.0, "a"), -9.0, 0, method="written"),
        made_trial((9.0, "a"), -5.0, 9, method="tpe", guided=True),
    ]
    door, who = parameter_influence(task, [*misleading, *drawn])
    assert [(one.parameter, one.runs) for one in (door, who)] == [("doors.t", 6), ("doors.who", 6)]
    assert door.correlation == pytest.approx(1.0)
    assert 0.0 < who.correlation < 0.5
    assert parameter_influence(task, drawn[:4]) == ()


def explored(n, kitchen, margin, guided=False):
    method = "written" if n == 0 else "tpe" if guided else "halton"
    return made_trial((kitchen, 5.0), margin, n, "kitchen_door", method, guided)


def failing(count):
    return [explored(n, 6.0, -0.1) for n in range(1, count + 1)]


def unsought(*oracles):
    """Points that pass, while others fail that the search is not about."""
    points = [explored(n, 5.0 + n, 0.1) for n in range(8)]
    return [*map(lambda p, o: replace(p, unsought=o), points, oracles), *points[len(oracles) :]]


NOTHING = [explored(n, 5.0 + 0.01 * n, 0.02, guided=n > 15) for n in range(20)]
FOUND = [
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
FAILURES = replace(TASK, stop="failures", failures=2)
RANDOM = replace(TASK, method="random")
CONFIRMED = confirmation([FOUND[1]] * 5)
PASSES = made_trial((5.99, 5.0), 0.004, 11, "kitchen_door")
WHOLE = make_answer(
    TASK,
    FOUND,
    ended="time",
    executed=30,
    reused=2,
    confirmed=CONFIRMED,
    nearest=NearestFailure(FOUND[1], PASSES, 12, False, CONFIRMED),
    shrunk=ShrunkScenario(("fails with doors",), True, 31, left="1 of 3 objects are left"),
    holding=(True, False),
)
REPEATS = [made_trial((6.0, 5.0), margin, 1) for margin in (-0.01, -0.01, 0.2)]
NEARER = NearestFailure(made_trial((5.5, 5.0), -0.01, 7), None, 12, True, confirmation(REPEATS[:2]))
ANSWERS = {
    "nothing found": make_answer(TASK, NOTHING, ended="budget", executed=20),
    "nothing found of several": make_answer(replace(TASK, scales=TASK.scales * 2), NOTHING),
    "no margin": make_answer(TASK, [explored(1, 5.0, None)]),
    "no run": make_answer(TASK, []),
    "failures": WHOLE,
    "a first failure that is not the nearest": make_answer(
        TASK, FOUND[:2], confirmed=confirmation(REPEATS), nearest=NEARER
    ),
    "more failures than asked for": make_answer(FAILURES, failing(5), ended="failures"),
    "failures as asked for": make_answer(FAILURES, failing(2), ended="failures"),
    "others fail": make_answer(TASK, unsought(("reached",), ("reached",), ("in-time",))),
    "random": make_answer(RANDOM, [explored(n, n, 0.1) for n in range(1, 9)]),
    "random failures": make_answer(RANDOM, [explored(n, n, -0.1) for n in range(1, 9)]),
    "guided alone": make_answer(TASK, [FOUND[0], explored(1, 6.0, 0.1, guided=True)]),
}  # fmt: skip


KITCHEN = made_trial((8.54, 5.0), -0.0183, near="kitchen_door")
HEADLINES = [
    failure_sentence(TASK, KITCHEN, confirmed)
    for confirmed in (
        Confirmation(5, 5, 0.478, 1.0),
        Confirmation(1, 5, 0.005, 0.717),
        Confirmation(0, 5, 0.0, 0.522),
        None,
    )
]


MOVED = make_task(
    ranged("doors.kitchen_opens", high=100.0, written=8.0),
    ranged("mission.start.y", high=100.0, unit="m", written=0.0),
    ranged("doors.trigger", unit="m", written=None),
    chosen("doors.leading", "one", "two"),
)
MANY = make_task(*(ranged(f"doors.t{i}") for i in range(6)))
CHANGES = [
    changes_text(MOVED, (8.0, 0.0, 1.5, "one")),
    changes_text(MOVED, (8.54, -12.0, 1.5, "two")),
    changes_text(MANY, (5.1, 5.2, 5.3, 5.4, 5.5, 5.0)),
    changes_text(MANY, (5.0,) * 6),
    point_words(MANY, (5.0,) * 6),
    point_words(MANY, (9.0,) * 6, most=2),
]


def test_answers_are_sentences(golden):
    lines = [line for name, one in ANSWERS.items() for line in (f"--- {name}", *one.sentences)]
    golden(
        "answers.txt", "\n".join([*lines, "--- headlines", *HEADLINES, "--- changes", *CHANGES, ""])
    )


def test_an_answer_tells_the_nearest_failure_or_the_first():
    assert WHOLE.reported_failure == FOUND[1]
    assert replace(WHOLE, nearest=None).reported_failure == WHOLE.first
    unconfirmed = replace(WHOLE, nearest=None, confirmed=None)
    assert unconfirmed.reported_failure == WHOLE.first
    assert unconfirmed.reported_confirmation is None
    assert ANSWERS["nothing found"].reported_failure is None
    assert ANSWERS["guided alone"].space_filling == 0
    assert codec.from_json(SearchAnswer, codec.to_json(WHOLE)) == WHOLE


def test_a_failure_is_told_with_the_margin_of_the_oracle_that_fails():
    trial = made_trial((5.0, 5.0), -0.5, near="")
    other = replace(trial, value=replace(trial.value, oracle="reached", margin=0.1))
    for one in (trial, other, replace(trial, value=None)):
        assert failure_sentence(TASK, one, None) == (
            "keeps-clear fails as written (margin −0.5 m), not repeated"
        )


def test_a_name_keeps_its_layer_where_two_layers_have_it():
    names = ["doors.pause", "people.pause", "people.opens"]
    task = make_task(*map(ranged, names))
    assert [task.short_name(name) for name in names] == ["doors.pause", "people.pause", "opens"]


def test_bounds_are_no_narrower_than_shown():
    assert percentage(0.18104) == "18.2 %"
