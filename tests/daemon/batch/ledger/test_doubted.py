"""Results of specifications that came out differently are not used again."""

from dataclasses import replace

import pytest

from daemon.batch.ledger import LedgerWriter, connect
from daemon.model.messages import Completion, LedgerAnswer, RetryRequest
from tests.daemon.batch.samples import make_result, make_submission

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
