"""Results of specifications that came out differently are not used again."""

from dataclasses import replace

import pytest

from daemon.batch.ledger import LedgerWriter, connect
from daemon.model.messages import Completion, LedgerAnswer, RetryRequest
from daemon.model.verdicts import Outcome
from tests.make import make_result, make_submission

NOW = 1_000_000.0


class Ledger:
    """A ledger, and a worker of it."""

    def __init__(self, db):
        self.book = LedgerWriter(db)

    def submit(self, name, runs=2):
        submission = replace(make_submission(name, runs), fresh=False)
        return self.book.submit(submission, NOW).cached

    def work(self, margin=0.5):
        answers = []
        for grant in self.book.lease("w", 100, NOW):
            made = make_result(grant.spec, margin=margin)
            done = Completion("w", grant.run, grant.attempt, grant.token, made)
            answers.append(self.book.complete(done, NOW + 1.0))
        return answers


@pytest.fixture
def ledger(tmp_path):
    db = connect(tmp_path / "ledger.db")
    yield Ledger(db)
    db.close()


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


def stopped(spec):
    """What a run gives that the wall clock ended, whatever words its note has for that."""
    made = make_result(spec, outcome=Outcome.ERROR, margin=0.1)
    return replace(made, note="notes were cut: its time was up", stopped=True)


@pytest.mark.parametrize("order", [(stopped, make_result), (make_result, stopped)])
def test_a_run_that_the_wall_clock_ended_says_nothing_about_others(ledger, order):
    events = []
    for name, make in zip(("first", "second"), order, strict=True):
        # Submitted to run anew: a result there is would be taken otherwise.
        ledger.book.submit(make_submission(name, 1), NOW)
        (grant,) = ledger.book.lease("w", 1, NOW)
        done = Completion("w", grant.run, 1, grant.token, make(grant.spec))
        assert ledger.book.complete(done, NOW) is LedgerAnswer.RECORDED
        events += [event.kind for event in ledger.book.events]
    assert "alarm" not in events
    assert ledger.submit("third", 1) == 1


@pytest.mark.parametrize("order", [(stopped, make_result), (make_result, stopped)])
def test_nor_about_another_attempt_at_the_same_run(ledger, order):
    ledger.submit("first", 1)
    (grant,) = ledger.book.lease("a", 1, NOW)
    ledger.book.lapse(ledger.book.leases(), NOW + 100.0)
    (again,) = ledger.book.lease("b", 1, NOW + 110.0)
    answers = [
        ledger.book.complete(
            Completion("w", one.run, one.attempt, one.token, make(one.spec)), NOW + 120.0
        )
        for one, make in zip((grant, again), order, strict=True)
    ]
    assert answers == [LedgerAnswer.RECORDED, LedgerAnswer.REDUNDANT]
    assert "alarm" not in {event.kind for event in ledger.book.events}
