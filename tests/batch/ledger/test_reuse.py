"""Results used again, repeats in reserve, what campaigns declare."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import pytest

from daemon.batch.errors import Refused
from daemon.batch.ledger import (
    LedgerReader,
    LedgerWriter,
    PlannedRun,
    connect,
)
from daemon.batch.paths import StatePaths
from daemon.batch.server._submissions import admit_submission
from daemon.judging.assessment import assess
from daemon.model.assessments import (
    AssessmentRules,
    Expectation,
    RegressionGate,
    RepeatPolicy,
    ScenarioComparison,
)
from daemon.model.ids import trace_name
from daemon.model.messages import (
    Completion,
    LedgerAnswer,
    ReleaseRequest,
    RetryRequest,
)
from daemon.model.run_state import RunState
from daemon.model.spec import RunResult, RunSpec, SutReference, Timing
from daemon.model.submission import CampaignOrigin
from daemon.model.verdicts import Outcome
from tests.make import make_result, make_spec, submission_of

NOW = 1_000_000.0
Make = Callable[[RunSpec], RunResult]


@dataclass
class Ledger:
    """A ledger with both its sides."""

    book: LedgerWriter
    reader: LedgerReader
    places: StatePaths

    def submit(self, name, *specs, reserve=(), **changes):
        submission = submission_of(name, *specs, reserve=reserve)
        submission = replace(submission, **{"fresh": False} | changes)
        self.book.submit(submission, NOW)
        return submission

    def work(self, make=make_result):
        """Execute what is queued until nothing is."""
        done = 0
        while grants := self.book.lease("w", 100, NOW):
            for grant in grants:
                path = self.places.trace(grant.trace)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(b"trace")
                done_by = ("w", grant.run, grant.attempt, grant.token)
                self.book.complete(Completion(*done_by, make(grant.spec)), NOW)
            done += len(grants)
        return done

    def rows(self, campaign):
        return self.reader.runs(campaign).rows

    def records(self, campaign):
        return self.reader.runs(campaign, limit=1000, results=True).rows

    def row(self, campaign):
        return next(row for row in self.reader.campaigns() if row.id == campaign)


@pytest.fixture
def ledger(tmp_path):
    places = StatePaths(tmp_path)
    places.make_folders()
    writing = connect(places.ledger)
    writing.execute("PRAGMA synchronous = OFF")  # power cuts are tested elsewhere
    with LedgerReader.open(places) as reader:
        yield Ledger(LedgerWriter(writing), reader, places)
    writing.close()


def specs(count, *, scenario="S1", first=0):
    return [make_spec(repeat, scenario=scenario) for repeat in range(first, first + count)]


def failing(spec):
    return make_result(spec, outcome=Outcome.FAIL, margin=-0.5)


def test_what_a_submission_would_reuse_and_take_is_known_before(ledger):
    first = ledger.submit("first", *specs(3))
    ledger.work(
        lambda spec: replace(make_result(spec), timing=Timing(2.0 + spec.repeat, 1.0, 10.0))
    )
    other = replace(make_spec(0), sut=SutReference("other", "pilot", {}))
    wanted = (*specs(4), make_spec(0, scenario="S2"), other)
    forecast = ledger.reader.forecast([planned(spec) for spec in wanted])
    submission = replace(submission_of("second", *wanted), name=first.name, fresh=False)
    receipt = ledger.book.submit(submission, NOW)
    assert sum(forecast.cached) == receipt.cached == 3
    assert list(forecast.cached) == [True, True, True, False, False, False]
    assert forecast.seconds == (*(3.0,) * 5, None)  # of the other system nothing is known
    # Nor of all of them, once they wait.
    assert ledger.reader.time_left(NOW, 1, {}).all is None


def test_nothing_is_said_of_how_long_the_first_runs_of_all_take(ledger):
    assert ledger.reader.forecast([planned(make_spec(0))]).seconds == (None,)


def test_runs_of_systems_that_are_not_repeatable_are_not_reused(ledger):
    ledger.submit("first", *specs(1))
    ledger.work()
    (spec,) = specs(1)
    assert ledger.reader.forecast([planned(spec)]).cached == (True,)
    assert ledger.reader.forecast([replace(planned(spec), repeatable=False)]).cached == (False,)


def planned(spec):
    return PlannedRun(spec.digest, spec.scenario, spec.sut.name, spec.limit, spec.sut.repeatable)


def test_only_runs_without_a_result_are_executed(ledger):
    ledger.submit("first", *specs(3))
    ledger.work()
    changed = make_spec(2, speed=1)
    receipt = ledger.book.submit(
        replace(submission_of("second", *specs(2), changed), fresh=False), NOW
    )
    assert (receipt.runs, receipt.cached) == (3, 2)
    assert ledger.row("second").cached == 2
    assert ledger.work() == 1
    rows = ledger.rows("second")
    assert [row.cached for row in rows] == ["first.0", "first.1", ""]
    assert [row.outcome for row in rows] == [Outcome.PASS] * 3
    assert ledger.reader.run("second.0").row.result == ledger.reader.run("first.0").row.result
    assert ledger.row("second").finished_at is not None


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
        assert [row.trace for row in ledger.rows(campaign)] == [url]
        assert [record.trace for record in ledger.records(campaign)] == [url]


def test_a_campaign_of_known_results_is_finished_at_once(ledger):
    ledger.submit("first", *specs(3))
    ledger.work(failing)
    ledger.book.events = []
    ledger.submit("second", *specs(3))
    assert [event.state for event in ledger.book.events] == ["submitted", "finished"]
    assert (ledger.row("second").failed, ledger.row("second").queued) == (3, 0)
    assert ledger.work() == 0


def test_whoever_asks_for_fresh_runs_gets_them(ledger):
    ledger.submit("first", *specs(3))
    ledger.work()
    ledger.submit("second", *specs(3), fresh=True)
    assert ledger.work() == 3
    assert not any(row.cached for row in ledger.rows("second"))


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
    (grant,) = ledger.book.lease("w", 1, NOW)
    words = "nondeterministic: so says the executor that plugs in"
    ledger.book.release(ReleaseRequest("w", grant.run, grant.token, words, blame=True), NOW)
    (row,) = ledger.rows("first")
    assert (row.reason, row.nondeterministic) == (words, False)


def test_a_chain_of_cached_results_leads_to_the_run_that_was_executed(ledger):
    for name in ("first", "second", "third"):
        ledger.submit(name, *specs(1))
        ledger.work()
    (row,) = ledger.rows("third")
    assert row.cached == "first.0"
    assert row.trace == str(ledger.places.traces / "first" / "S1.pilot.0.mcap")


def test_a_result_stays_when_its_trace_is_deleted_and_says_so(ledger):
    ledger.submit("first", *specs(1))
    ledger.work()
    (ledger.places.traces / "first" / "S1.pilot.0.mcap").unlink()
    ledger.submit("second", *specs(1))
    (row,), (record,) = ledger.rows("second"), ledger.records("second")
    assert (row.state, row.outcome, row.trace) == (RunState.DONE, Outcome.PASS, "")
    assert row.reason == record.note == "the trace of first.0 is gone"
    assert record.trace == ""
    ledger.book.retry(RetryRequest("second", ("all",)), NOW)
    assert ledger.work() == 1
    (row,) = ledger.rows("second")
    assert row.trace == str(ledger.places.traces / "second" / "S1.pilot.0.mcap")
    assert row.reason == ""


def test_what_broke_is_executed_again(ledger):
    ledger.submit("first", *specs(2))
    ledger.work(lambda spec: make_result(spec, outcome=Outcome.ERROR))
    ledger.submit("second", *specs(2))
    assert ledger.work() == 2


PATIENT = AssessmentRules(RepeatPolicy(2, "rate", 0.5, until_decided=True, at_most=16))


def submit_patiently(ledger, name="c"):
    """Two scenarios of two repeats each, and fourteen more in reserve for each."""
    runs = [spec for scenario in ("S1", "S2") for spec in specs(2, scenario=scenario)]
    reserve = [s for scenario in ("S1", "S2") for s in specs(14, scenario=scenario, first=2)]
    ledger.submit(name, *runs, declared=PATIENT, reserve=reserve)


def test_undecided_cells_get_more_repeats_and_decided_ones_do_not(ledger):
    def make(spec):
        # S1 always passes, which shows itself soon; S2 is a coin, which never does.
        coin = spec.scenario == "S2" and spec.repeat % 2
        return failing(spec) if coin else make_result(spec)

    submit_patiently(ledger)
    assert ledger.work(make) == 8 + 16
    counts = {s: sum(r.scenario == s for r in ledger.rows("c")) for s in ("S1", "S2")}
    assert counts == {"S1": 8, "S2": 16}
    row = ledger.row("c")
    assert (row.total, row.finished_at) == (24, NOW)
    verdicts = {c.scenario: c.verdict for c in assess(PATIENT, ledger.records("c")).cells}
    assert verdicts == {"S1": Outcome.PASS, "S2": Outcome.INCONCLUSIVE}
    states = [event.state for event in ledger.book.events if event.kind == "campaign"]
    assert states == ["submitted", "extended", "extended", "extended", "finished"]


def test_added_repeats_are_those_of_the_campaign_and_reused_too(ledger):
    submit_patiently(ledger)
    ledger.work()
    submit_patiently(ledger, "again")
    assert ledger.work() == 0
    again = ledger.row("again")
    assert (again.total, again.cached, again.queued) == (16, 16, 0)
    first, second = ({(r.scenario, r.repeat, r.digest, r.seed) for r in ledger.records(name)}
                     for name in ("c", "again"))  # fmt: skip
    assert first == second


def test_a_cancelled_campaign_is_not_extended(ledger):
    submit_patiently(ledger)
    for grant in ledger.book.lease("w", 3, NOW):
        done_by = ("w", grant.run, grant.attempt, grant.token)
        ledger.book.complete(Completion(*done_by, make_result(grant.spec)), NOW)
    assert ledger.book.cancel("c", NOW) == 1
    assert ledger.row("c").total == 4
    ledger.book.retry(RetryRequest("c", ("cancelled",)), NOW)
    assert ledger.work() == 13


def test_a_campaign_keeps_what_it_declares(ledger):
    declared = AssessmentRules(
        RepeatPolicy(5, "rate", 0.8),
        (ScenarioComparison("d", "delay", "S1", "S2", "goal", "<=", 30.0, "s", "delay(...)", "m"),),
        (Expectation("S1", "*", ("a", "b"), "mixed", "so it is", "x.yaml:3"),),
        RegressionGate("last-green", 0.1),
    )
    ledger.submit("c", *specs(1), declared=declared)
    assert ledger.reader.declared("c") == declared
    with pytest.raises(Refused, match="no campaign x"):
        ledger.reader.declared("x")


def test_a_campaign_keeps_where_it_was_written_the_first_time(ledger):
    first = CampaignOrigin("c.yaml", "0" * 64, 7, "a" * 40, "main", changed=False)
    submission = replace(submission_of("c", *specs(1)), origin=first)
    ledger.book.submit(submission, NOW)
    later = replace(submission, origin=replace(first, commit="b" * 40))
    assert ledger.book.submit(later, NOW).known
    assert ledger.reader.origin("c") == first
    with pytest.raises(Refused, match="no campaign x"):
        ledger.reader.origin("x")


def test_rows_have_results_where_they_are_asked_for(ledger):
    ledger.submit("c", *specs(3))
    ledger.work(lambda spec: make_result(spec, margin=spec.repeat))
    ledger.book.submit(submission_of("d", *specs(1)), NOW)
    last = ledger.reader.runs("c", offset=2, limit=9, results=True).rows
    assert [(r.id, r.seed, r.verdicts[0].margin) for r in last] == [("c.2", 2, 2.0)]
    assert last[0].result.timing.simulated > 0.0
    assert ledger.rows("c")[2].result is None
    (waiting,) = ledger.records("d")
    assert (waiting.outcome, waiting.state, waiting.trace) == (None, "queued", "")


def external(spec):
    """The same run with a system that is not repeatable."""
    return replace(spec, sut=replace(spec.sut, parameters={"repeatable": False}))


def differing(spec):
    """A result that no other execution gave."""
    differing.calls += 1
    return make_result(spec, margin=0.001 * differing.calls)


differing.calls = 0


def test_results_of_what_is_not_repeatable_are_never_used_again(ledger):
    runs = [external(specs(1)[0]), specs(2)[1]]
    ledger.submit("first", *runs)
    ledger.work()
    ledger.submit("second", *runs)
    assert ledger.row("second").cached == 1
    assert [(row.cached, row.repeatable) for row in ledger.rows("second")] == [
        ("", False),
        ("first.1", True),
    ]
    assert [record.repeatable for record in ledger.records("second")] == [False, True]
    assert ledger.work() == 1


def test_repeats_in_reserve_of_what_is_not_repeatable_are_executed_too(ledger):
    runs = tuple(external(spec) for spec in specs(16))
    for name in ("first", "second"):
        ledger.submit(name, *runs[:2], declared=PATIENT, reserve=runs[2:])
        assert ledger.work() == 8
    assert ledger.row("second").cached == 0


def test_what_is_not_repeatable_may_come_out_differently_without_an_alarm(ledger):
    run = external(specs(1)[0])
    for name in ("first", "second"):
        ledger.submit(name, run)
        ledger.work(differing)
    first, second = ledger.rows("first")[0], ledger.rows("second")[0]
    assert first.margin != second.margin
    assert [first.nondeterministic, second.nondeterministic] == [False, False]
    assert [event for event in ledger.book.events if event.kind == "alarm"] == []


def test_of_two_executions_of_one_run_the_first_stays(ledger):
    ledger.submit("first", external(specs(1)[0]))
    (slow,) = ledger.book.lease("slow", 1, NOW)
    ledger.book.lapse(ledger.book.leases(), NOW + 3600.0)
    (fast,) = ledger.book.lease("fast", 1, NOW)
    answers = [
        ledger.book.complete(
            Completion("w", grant.run, grant.attempt, grant.token, differing(grant.spec)), NOW
        )
        for grant in (fast, slow)
    ]
    assert answers == [LedgerAnswer.RECORDED, LedgerAnswer.REDUNDANT]
    (row,) = ledger.rows("first")
    assert (row.state, row.nondeterministic) == (RunState.DONE, False)
    assert [event for event in ledger.book.events if event.kind == "alarm"] == []


def test_executed_again_on_request_it_has_the_new_result(ledger):
    ledger.submit("first", external(specs(1)[0]), specs(2)[1])
    ledger.work(lambda spec: make_result(spec, outcome=Outcome.ERROR))
    assert ledger.book.retry(RetryRequest("first", ("error",)), NOW) == 2
    waiting = ledger.rows("first")[0]
    assert (waiting.state, waiting.outcome, waiting.trace) == (RunState.QUEUED, None, "")
    ledger.work()
    external_run, other = ledger.rows("first")
    assert (external_run.outcome, external_run.nondeterministic) == (Outcome.PASS, False)
    assert (other.outcome, other.nondeterministic) == (Outcome.ERROR, True)
    assert ledger.row("first").passed == 1


def test_what_the_wall_clock_ended_may_come_out_otherwise_on_request(ledger):
    ledger.submit("first", *specs(1))
    ended = {"note": "notes were cut: its time was up", "stopped": True}
    ledger.work(lambda spec: replace(make_result(spec, outcome=Outcome.ERROR), **ended))
    assert ledger.book.retry(RetryRequest("first", ("error",)), NOW) == 1
    ledger.work()
    (row,) = ledger.rows("first")
    assert (row.outcome, row.nondeterministic) == (Outcome.PASS, False)


def test_repeats_in_reserve_are_held_to_the_same_rules(tmp_path):
    places = StatePaths(tmp_path)
    places.make_folders()
    submission = submission_of("c", *specs(2), reserve=specs(2, first=1))
    with pytest.raises(Refused, match="S1/pilot/1 is there twice"):
        admit_submission(submission, places)
    admit_submission(submission_of("c", *specs(2), reserve=specs(2, first=2)), places)
