"""What runs say about the oracle in question."""

from dataclasses import replace

from daemon.model.proposals import Proposal
from daemon.model.run_state import RunState
from daemon.model.search import ANY, OracleScale
from daemon.model.spec import LeadingMargin
from daemon.model.trials import (
    first_failure,
    median_trial,
    read_trial,
)
from daemon.model.verdicts import Outcome, Verdict
from daemon.search.answers.facts import confirmation
from tests.analysis.search.pretended import ORACLE, made_trial, make_task, seconds
from tests.make import run_result, run_row

TASK = make_task(seconds("doors.a"))
SEVERAL = replace(
    TASK, minimise=ANY, scales=(OracleScale("clear", 0.25, "m"), OracleScale("in-time", 60.0, "s"))
)


def row(*verdicts, leads=None, ended="finished", **more):
    proposal = Proposal(3, 2, 0, "explore", "halton", False, (5.0,))
    if leads is None:
        leads = tuple(LeadingMargin(v.oracle, v.lower, v.unit) for v in verdicts)
    result = run_result(*verdicts, leads=leads, ended=ended)
    return run_row("s.3", "s.2", result=result, proposal=proposal, **more)


def verdict(oracle, margin, unit="m"):
    outcome = Outcome.FAIL if margin < 0.0 else Outcome.PASS
    return Verdict(oracle, "", outcome, margin, margin, unit)


def told(task, found):
    result = read_trial(task, found)
    value = None if result.value is None else result.value.value
    return result.outcome, value, "" if result.verdict is None else result.verdict.oracle


def test_only_the_oracle_in_question_counts():
    found = row(verdict(ORACLE, 0.2), verdict("other", -1.0), outcome=Outcome.FAIL)
    assert told(TASK, found) == (Outcome.PASS, 0.2, ORACLE)
    assert read_trial(TASK, found).unsought == ("other",)


def test_of_any_the_smallest_share_counts_and_a_failure_wins():
    passing = row(verdict("clear", 0.1), verdict("in-time", 12.0, "s"))
    assert told(SEVERAL, passing) == (Outcome.PASS, 0.2, "in-time")
    failing = row(verdict("clear", -0.025), verdict("in-time", 12.0, "s"))
    assert told(SEVERAL, failing) == (Outcome.FAIL, -0.1, "clear")
    without_lead = row(*failing.verdicts, leads=failing.leads[1:])
    assert told(SEVERAL, without_lead) == (Outcome.FAIL, 0.2, "clear")


def test_what_cannot_be_trusted_is_an_error_without_a_value():
    nothing = (Outcome.ERROR, None, "")
    assert told(TASK, row(verdict(ORACLE, -0.2), ended="crashed")) == nothing
    assert told(TASK, row(verdict(ORACLE, -0.2), state=RunState.LOST)) == nothing
    assert told(TASK, row(verdict("other", 0.2))) == nothing
    broken = Verdict(ORACLE, "", Outcome.ERROR, None, None, "m")
    assert told(TASK, row(broken)) == (Outcome.ERROR, None, ORACLE)
    unsure = Verdict(ORACLE, "", Outcome.INCONCLUSIVE, None, None, "m")
    assert told(TASK, row(unsure)) == (Outcome.INCONCLUSIVE, None, ORACLE)


def test_the_median_is_one_of_the_runs():
    results = [made_trial((5.0,), margin, n) for n, margin in enumerate((0.3, -0.1, None, 0.2))]
    assert median_trial(results).number == 3
    assert median_trial(results[:2]).number == 1, "of two, the worse one"
    assert median_trial(results[2:3]).outcome is Outcome.ERROR


def test_repeats_without_a_verdict_confirm_nothing():
    results = [made_trial((5.0,), margin, n) for n, margin in enumerate((0.3, -0.1, None))]
    found = confirmation(results)
    assert found is not None
    assert (found.failed, found.runs) == (1, 2)
    assert found.low < 0.5 < found.high
    assert confirmation(results[2:]) is None
    first = first_failure(results)
    assert first is not None
    assert first.number == 1
