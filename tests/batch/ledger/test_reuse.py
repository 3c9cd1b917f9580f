"""Results used again or doubted, repeats in reserve, what campaigns declare."""

from dataclasses import replace

import pytest

from daemon.batch.errors import Refused
from daemon.judging.assessment import assess
from daemon.model.assessments import (
    AssessmentRules,
    Expectation,
    RegressionGate,
    RepeatPolicy,
    ScenarioComparison,
)
from daemon.model.ids import trace_name
from daemon.model.messages import LedgerAnswer
from daemon.model.spec import SutReference, Timing
from daemon.model.submission import CampaignOrigin
from daemon.model.verdicts import Outcome, RunState
from tests.batch.conftest import NOW
from tests.make import make_result, make_spec, submission_of


def specs(count, *, scenario="S1", first=0):
    return [make_spec(repeat, scenario=scenario) for repeat in range(first, first + count)]


def failing(spec):
    return make_result(spec, outcome=Outcome.FAIL, margin=-0.5)


def erring(spec):
    return make_result(spec, outcome=Outcome.ERROR)


def stopped(spec):
    """What a run gives that the wall clock ended, whatever words its note has for that."""
    made = make_result(spec, outcome=Outcome.ERROR, margin=0.1)
    return replace(made, note="notes were cut: its time was up", stopped=True)


def test_what_a_submission_would_reuse_and_take_is_known_before(ledger):
    ledger.submit("first", *specs(3), name="both")
    ledger.work(
        lambda spec: replace(make_result(spec), timing=Timing(2.0 + spec.repeat, 1.0, 10.0))
    )
    other = replace(make_spec(0), sut=SutReference("other", "pilot", {}))
    wanted = (*specs(4), make_spec(0, scenario="S2"), other)
    forecast = ledger.reader.forecast(submission_of("second", *wanted))
    assert sum(forecast.cached) == ledger.submit("second", *wanted, name="both").cached == 3
    assert list(forecast.cached) == [True, True, True, False, False, False]
    assert forecast.seconds == (*(3.0,) * 5, None)  # of the other system nothing is known
    # Nor of all of them, once they wait.
    assert ledger.reader.time_left(NOW, 1, {}).all is None


def test_only_runs_without_a_result_are_executed(ledger):
    ledger.submit("first", *specs(3))
    ledger.work()
    receipt = ledger.submit("second", *specs(2), make_spec(2, speed=1))
    assert (receipt.runs, receipt.cached, ledger.row("second").cached) == (3, 2, 2)
    assert len(ledger.work()) == 1
    rows = ledger.rows("second")
    assert [row.cached for row in rows] == ["first.0", "first.1", ""]
    assert [row.outcome for row in rows] == [Outcome.PASS] * 3
    assert ledger.reader.run("second.0").row.result == ledger.reader.run("first.0").row.result
    assert ledger.row("second").finished_at is not None
    # Of a chain, the one that was executed is named.
    ledger.submit("third", *specs(1))
    assert ledger.rows("third")[0].cached == "first.0"
    assert ledger.submit("fresh", *specs(3), fresh=True).cached == 0
    assert len(ledger.work()) == 3


def test_a_result_used_again_has_its_trace_where_the_first_one_put_it(ledger):
    ledger.submit("first", *specs(1))
    ledger.work()
    ledger.submit("second", *specs(1))
    digest = ledger.reader.run("first.0").row.result.digest
    url = "s3://bucket/first/S1.mcap"
    name = trace_name("first", "S1", "pilot", 0)
    assert not ledger.book.record_move(name, "0" * 64, url)
    assert ledger.book.record_move(name, digest, url)
    ledger.submit("third", *specs(1))
    for campaign in ("first", "second", "third"):
        for results in (False, True):
            assert [row.trace for row in ledger.rows(campaign, results=results)] == [url]


def test_a_campaign_of_known_results_is_finished_at_once(ledger):
    ledger.submit("first", *specs(3))
    ledger.work(failing)
    ledger.book.events = []
    ledger.submit("second", *specs(3))
    assert [event.state for event in ledger.book.events] == ["submitted", "finished"]
    assert (ledger.row("second").failed, ledger.row("second").queued) == (3, 0)
    assert ledger.work() == []


def test_a_fresh_run_that_comes_out_differently_raises_an_alarm(ledger):
    ledger.submit("first", *specs(2))
    ledger.work()
    ledger.submit("second", *specs(2), fresh=True)
    ledger.book.events = []
    ledger.work(lambda spec: make_result(spec, margin=0.5 + 0.1 * spec.repeat))
    (alarm,) = [event for event in ledger.book.events if event.kind == "alarm"]
    assert (alarm.id, alarm.campaign, alarm.state) == ("second.1", "second", "nondeterministic")
    assert [row.nondeterministic for row in ledger.rows("second")] == [False, True]
    assert "first.1 gave" in ledger.rows("second")[1].reason


def test_what_a_worker_says_of_a_run_it_gives_back_raises_no_alarm(ledger):
    ledger.submit("first", *specs(1))
    (grant,) = ledger.lease()
    words = "nondeterministic: so says the executor that plugs in"
    ledger.release(grant, words, blame=True)
    (row,) = ledger.rows("first")
    assert (row.reason, row.nondeterministic) == (words, False)


def test_a_result_stays_when_its_trace_is_deleted_and_says_so(ledger):
    ledger.submit("first", *specs(1))
    ledger.work()
    (ledger.places.traces / "first" / "S1.pilot.0.mcap").unlink()
    ledger.submit("second", *specs(1))
    (row,), (record,) = ledger.rows("second"), ledger.rows("second", results=True)
    assert (row.state, row.outcome, row.trace) == (RunState.DONE, Outcome.PASS, "")
    assert (row.reason, record.note, record.trace) == (*["the trace of first.0 is gone"] * 2, "")
    ledger.retry("second", "all")
    assert len(ledger.work()) == 1
    (row,) = ledger.rows("second")
    assert row.trace == str(ledger.places.traces / "second" / "S1.pilot.0.mcap")
    assert row.reason == ""


def test_what_broke_is_executed_again(ledger):
    ledger.submit("first", *specs(2))
    ledger.work(erring)
    ledger.submit("second", *specs(2))
    assert len(ledger.work()) == 2


# --- results that are doubted


def test_a_specification_that_came_out_differently_is_executed_each_time(ledger):
    ledger.submit("first", 2)
    ledger.work()
    assert ledger.submit("second", 2).cached == 2
    # The same run executed again gives something else.
    ledger.retry("first", "all")
    answers = ledger.work(lambda spec: make_result(spec, margin=0.1))
    assert answers == [LedgerAnswer.DIFFERS] * 2
    assert ledger.happened("alarm") == ["nondeterministic"] * 2
    for name in ("third", "fourth"):
        assert ledger.submit(name, 2).cached == 0
        ledger.work()


def test_two_runs_of_one_specification_that_differ_are_both_doubted(ledger):
    ledger.submit("first", 1)
    ledger.submit("second", 1)
    for grant, margin in zip(ledger.lease(), (0.5, 0.1), strict=True):
        ledger.complete(grant, make_result(grant.spec, margin=margin))
    ledger.book.delete(("second",), NOW)
    assert ledger.submit("third", 1).cached == 0


@pytest.mark.parametrize("order", [(stopped, make_result), (make_result, stopped)])
def test_a_run_that_the_wall_clock_ended_says_nothing_about_others(ledger, order):
    for name, make in zip(("first", "second"), order, strict=True):
        ledger.submit(name, 1, fresh=True)
        assert ledger.work(make) == [LedgerAnswer.RECORDED]
    assert ledger.happened("alarm") == []
    assert ledger.submit("third", 1).cached == 1


@pytest.mark.parametrize("order", [(stopped, make_result), (make_result, stopped)])
def test_nor_about_another_attempt_at_the_same_run(ledger, order):
    ledger.submit("first", 1)
    (grant,) = ledger.lease()
    ledger.lapse()
    (again,) = ledger.lease(worker="b")
    answers = [
        ledger.complete(one, make(one.spec))
        for one, make in zip((grant, again), order, strict=True)
    ]
    assert answers == [LedgerAnswer.RECORDED, LedgerAnswer.REDUNDANT]
    assert ledger.happened("alarm") == []


# --- systems that are not repeatable


def external(spec):
    """The same run with a system that is not repeatable."""
    return replace(spec, sut=replace(spec.sut, parameters={"repeatable": False}))


def test_results_of_what_is_not_repeatable_are_never_used_again(ledger):
    runs = [external(specs(1)[0]), specs(2)[1]]
    ledger.submit("first", *runs)
    ledger.work()
    assert ledger.reader.forecast(submission_of("second", *runs)).cached == (False, True)
    assert ledger.submit("second", *runs).cached == 1
    rows = [(row.cached, row.repeatable) for row in ledger.rows("second")]
    assert rows == [("", False), ("first.1", True)]
    assert [record.repeatable for record in ledger.rows("second", results=True)] == [False, True]
    # They may come out differently without an alarm.
    ledger.work(failing)
    assert [ledger.rows(name)[0].outcome for name in ("first", "second")] == ["pass", "fail"]
    assert ledger.happened("alarm") == []


def test_executed_again_on_request_it_has_the_new_result(ledger):
    ledger.submit("first", external(specs(1)[0]), specs(2)[1])
    ledger.work(erring)
    assert ledger.retry("first", "error") == 2
    waiting = ledger.rows("first")[0]
    assert (waiting.state, waiting.outcome, waiting.trace) == (RunState.QUEUED, None, "")
    ledger.work()
    external_run, other = ledger.rows("first")
    assert (external_run.outcome, external_run.nondeterministic) == (Outcome.PASS, False)
    assert (other.outcome, other.nondeterministic) == (Outcome.ERROR, True)
    assert ledger.row("first").passed == 1


# --- repeats in reserve

PATIENT = AssessmentRules(RepeatPolicy(2, "rate", 0.5, until_decided=True, at_most=16))


def submit_patiently(ledger, name="c", change=lambda spec: spec):
    """Two scenarios of two repeats each, and fourteen more in reserve for each."""
    runs = [change(spec) for scenario in ("S1", "S2") for spec in specs(16, scenario=scenario)]
    first = [spec for spec in runs if spec.repeat < 2]
    reserve = [spec for spec in runs if spec.repeat >= 2]
    return ledger.submit(name, *first, declared=PATIENT, reserve=reserve)


def test_undecided_cells_get_more_repeats_and_decided_ones_do_not(ledger):
    def make(spec):
        # S1 always passes, which shows itself soon; S2 is a coin, which never does.
        coin = spec.scenario == "S2" and spec.repeat % 2
        return failing(spec) if coin else make_result(spec)

    submit_patiently(ledger)
    assert len(ledger.work(make)) == 8 + 16
    counts = {s: sum(r.scenario == s for r in ledger.rows("c")) for s in ("S1", "S2")}
    assert counts == {"S1": 8, "S2": 16}
    assert (ledger.row("c").total, ledger.row("c").finished_at) == (24, NOW)
    cells = assess(PATIENT, ledger.rows("c", limit=1000, results=True)).cells
    verdicts = {cell.scenario: cell.verdict for cell in cells}
    assert verdicts == {"S1": Outcome.PASS, "S2": Outcome.INCONCLUSIVE}
    assert ledger.happened("campaign") == ["submitted", *["extended"] * 3, "finished"]


@pytest.mark.parametrize(("change", "cached"), [(lambda spec: spec, 16), (external, 0)])
def test_added_repeats_are_those_of_the_campaign_and_reused_where_they_may(ledger, change, cached):
    for name in ("c", "again"):
        submit_patiently(ledger, name, change)
        ledger.work()
    again = ledger.row("again")
    assert (again.total, again.cached, again.queued) == (16, cached, 0)
    one, other = (
        {(r.scenario, r.repeat, r.digest, r.seed) for r in ledger.rows(name, results=True)}
        for name in ("c", "again")
    )
    assert one == other


def test_a_cancelled_campaign_is_not_extended(ledger):
    submit_patiently(ledger)
    ledger.work(count=3)
    assert ledger.book.cancel("c", NOW) == 1
    assert ledger.row("c").total == 4
    ledger.retry("c", "cancelled")
    assert len(ledger.work()) == 13


# --- what campaigns keep


def test_a_campaign_keeps_what_it_declares_and_where_it_was_written_first(ledger):
    declared = AssessmentRules(
        RepeatPolicy(5, "rate", 0.8),
        (ScenarioComparison("d", "delay", "S1", "S2", "goal", "<=", 30.0, "s", "delay(...)", "m"),),
        (Expectation("S1", "*", ("a", "b"), "mixed", "so it is", "x.yaml:3"),),
        RegressionGate("last-green", 0.1),
    )
    origin = CampaignOrigin("c.yaml", "0" * 64, 7, "a" * 40, "main", changed=False)
    ledger.submit("c", 1, declared=declared, origin=origin)
    later = replace(origin, commit="b" * 40)
    assert ledger.submit("c", 1, declared=declared, origin=later).known
    assert ledger.reader.declared("c") == declared
    assert ledger.reader.origin("c") == origin
    for question in (ledger.reader.declared, ledger.reader.origin):
        with pytest.raises(Refused, match="no campaign x"):
            question("x")


def test_rows_have_results_where_they_are_asked_for(ledger):
    ledger.submit("c", *specs(3))
    ledger.work(lambda spec: make_result(spec, margin=spec.repeat))
    ledger.book.submit(submission_of("d", *specs(1)), NOW)
    last = ledger.rows("c", offset=2, limit=9, results=True)
    assert [(r.id, r.seed, r.verdicts[0].margin) for r in last] == [("c.2", 2, 2.0)]
    assert last[0].result.timing.simulated > 0.0
    assert ledger.rows("c")[2].result is None
    (waiting,) = ledger.rows("d", results=True)
    assert (waiting.outcome, waiting.state, waiting.trace) == (None, "queued", "")
