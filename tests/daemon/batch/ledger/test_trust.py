"""Whose results count: doubted specifications, voided keys, and how much a key may hold."""

from dataclasses import replace

import pytest

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerReader, LedgerWriter, connect
from daemon.batch.ledger.transitions import Completed, ExecutionState, Leased, Voided, advance
from daemon.batch.paths import StatePaths
from daemon.model.messages import Completion, LedgerAnswer, RetryRequest, RunQuery
from daemon.model.run_state import RunState
from daemon.model.status import KeyDeliveries
from tests.daemon.batch.ledger_rules import broken_rules
from tests.daemon.batch.samples import make_result, make_submission

NOW = 1_000_000.0
BAD, GOOD = "worker.bad", "worker.good"


class Ledger:
    """A ledger with both its sides, and workers of several keys."""

    def __init__(self, writing, reader, path):
        self.book, self.reader, self.path = LedgerWriter(writing), reader, path

    def submit(self, name, runs=2):
        submission = replace(make_submission(name, runs), fresh=False)
        return self.book.submit(submission, NOW).cached

    def work(self, holder="", margin=0.5):
        answers = []
        for grant in self.book.lease("w", 100, NOW, holder=holder):
            made = make_result(grant.spec, margin=margin)
            done = Completion("w", grant.run, grant.attempt, grant.token, made)
            answers.append(self.book.complete(done, NOW + 1.0, holder=holder))
        return answers

    def void(self, holder):
        return [name for names in self.book.void_key(holder, NOW) for name in names]

    def states(self, campaign):
        return [row.state for row in self.reader.runs(RunQuery(campaign)).rows]

    def sound(self):
        return broken_rules(self.path) == []


@pytest.fixture
def ledger(tmp_path):
    places = StatePaths(tmp_path)
    writing = connect(places.ledger)
    writing.execute("PRAGMA synchronous = OFF")
    with LedgerReader.open(places) as reader:
        yield Ledger(writing, reader, places.ledger)
    writing.close()


def test_a_specification_that_came_out_differently_is_executed_each_time(ledger):
    ledger.submit("first")
    ledger.work()
    assert ledger.submit("second") == 2
    # The same run executed again gives something else.
    ledger.book.retry(RetryRequest("first", ("all",)), NOW)
    assert ledger.work(margin=0.1) == [LedgerAnswer.DIFFERS] * 2
    assert ledger.submit("third") == 0
    ledger.work()
    assert ledger.submit("fourth") == 0


def test_two_runs_of_one_specification_that_differ_are_both_doubted(ledger):
    ledger.submit("first", 1)
    ledger.submit("second", 1)
    (one,) = ledger.book.lease("a", 1, NOW)
    (other,) = ledger.book.lease("b", 1, NOW)
    for grant, margin in ((one, 0.5), (other, 0.1)):
        made = make_result(grant.spec, margin=margin)
        ledger.book.complete(Completion("a", grant.run, 1, grant.token, made), NOW)
    assert ledger.submit("third", 1) == 0


def test_what_a_key_brought_is_told_by_campaign(ledger):
    ledger.submit("first", 3)
    ledger.work(BAD)
    ledger.submit("second", 4)
    ledger.book.lease("w", 1, NOW, holder=BAD)
    found = ledger.reader.deliveries(BAD)
    assert [(c.campaign, c.runs, c.cached) for c in found.campaigns] == [
        ("first", 3, 0),
        ("second", 3, 3),
    ]
    assert (found.runs, found.held, found.voided_at) == (6, 1, None)
    assert found.campaigns[0].first_at == NOW + 1.0
    assert ledger.reader.deliveries(GOOD) == KeyDeliveries(GOOD, (), 0)


def test_what_a_voided_key_brought_is_run_again(ledger):
    ledger.submit("own", 1)
    ledger.work(GOOD)
    ledger.submit("first", 3)
    ledger.work(BAD)
    ledger.submit("copies", 3)
    ledger.submit("held", 5)
    ledger.book.lease("w", 1, NOW, holder=BAD)
    assert ledger.states("held")[3] is RunState.RUNNING
    names = ledger.void(BAD)
    # The first run of all three is of a specification that another key has executed.
    done, queued = RunState.DONE, RunState.QUEUED
    assert ledger.states("own") == [done]
    for campaign in ("first", "copies"):
        assert ledger.states(campaign) == [done, queued, queued]
    assert ledger.states("held") == [done, queued, queued, queued, queued]
    assert [name for name in names if name] == ["first/S1.pilot.1.mcap", "first/S1.pilot.2.mcap"]
    rows = {row.id: row for row in ledger.reader.campaigns()}
    assert (rows["copies"].cached, rows["copies"].finished_at) == (1, None)
    assert ledger.reader.deliveries(BAD).runs == 0
    assert ledger.reader.deliveries(BAD).voided_at == NOW
    assert ledger.sound()
    assert ledger.void(BAD) == []
    # Another key's take their place, and are used again.
    assert ledger.work(GOOD, margin=0.2) == [LedgerAnswer.RECORDED] * 8
    assert ledger.submit("later", 3) == 3


def test_nothing_is_taken_from_a_voided_key(ledger):
    ledger.submit("first")
    ledger.void(BAD)
    with pytest.raises(Refused, match=r'key "worker\.bad" brings was voided'):
        ledger.book.check_trusted(BAD)
    ledger.book.check_trusted(GOOD)
    ledger.book.check_trusted("")


def test_a_result_is_not_used_again_while_its_key_is_being_voided(ledger):
    ledger.submit("first")
    ledger.work(BAD)
    steps = ledger.book.void_key(BAD, NOW)
    next(steps)
    assert ledger.reader.deliveries(BAD).runs == 2
    assert ledger.submit("second") == 0
    steps.close()


def test_a_repetition_under_way_brings_the_result_that_counts():
    done = advance(
        advance(ExecutionState(), Leased("w", 1, 9.0), attempts=3).run,
        Completed(1, "a"),
        attempts=3,
    ).run
    void = Voided("why")
    queued = advance(done, void, attempts=3).run
    assert (queued.state, queued.result, queued.strikes) == (RunState.QUEUED, "", 0)
    running = replace(done, state=RunState.RUNNING, token=2)
    left = advance(running, void, attempts=3).run
    assert (left.state, left.token, left.result) == (RunState.RUNNING, 2, "")
    assert advance(left, Completed(2, "b"), attempts=3).record
    assert advance(ExecutionState(), void, attempts=3).answer is LedgerAnswer.STALE


def test_no_worker_and_no_key_empties_a_queue(ledger):
    ledger.submit("long", 300)

    def take(worker, holder, slots):
        room = ledger.book.room_for_leases(worker, holder, slots)
        return len(ledger.book.lease(worker, min(1024, room), NOW, holder=holder))

    # Slots are what a worker says: thousands of them are worth nothing before a result.
    assert [take("one", BAD, (1024, 40_000)) for _ in range(2)] == [64, 0]
    assert take("two", BAD, (8, 40_008)) == 0
    assert take("three", GOOD, (8, 8)) == 64
    # The owner's workers are bounded one by one only.
    assert take("mine", "", (8, 8)) == 80


def test_a_key_holds_more_leases_the_more_it_has_brought(ledger):
    ledger.submit("short", 10)
    ledger.work(GOOD)
    assert ledger.book.room_for_leases("one", GOOD, (8, 8)) == 64 + 2 * 8
    assert ledger.book.room_for_leases("one", GOOD, (640, 640)) == 64 + 2 * 10
