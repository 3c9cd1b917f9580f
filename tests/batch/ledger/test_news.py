"""What somebody acknowledges, until there is news; failures that searches found count apart."""

import pytest

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerReader, LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.model.messages import Completion, RetryRequest
from daemon.model.verdicts import Outcome
from tests.make import make_extension, make_result, make_search, make_submission

NOW = 1_000_000.0


class Ledger:
    """A ledger that is written and read, and a worker of it."""

    def __init__(self, writing, reader):
        self.book = LedgerWriter(writing)
        self.reader = reader

    def work(self, *outcomes):
        """Execute the next runs, with these outcomes."""
        for grant, outcome in zip(self.book.lease("w", len(outcomes), NOW), outcomes, strict=True):
            made = make_result(grant.spec, outcome=outcome)
            self.book.complete(Completion("w", grant.run, grant.attempt, grant.token, made), NOW)

    @property
    def acknowledged(self):
        return self.reader.campaign("c").acknowledged


@pytest.fixture
def ledger(tmp_path):
    writing = connect(tmp_path / "ledger.db")
    with LedgerReader.open(StatePaths(tmp_path)) as reader:
        yield Ledger(writing, reader)
    writing.close()


def test_a_campaign_is_acknowledged_until_a_run_of_it_settles_badly(ledger):
    ledger.book.submit(make_submission("c", 4), NOW)
    ledger.work(Outcome.FAIL)
    assert not ledger.acknowledged
    assert ledger.book.acknowledge("c", NOW) == 1
    assert ledger.book.events[-1].state == "acknowledged"
    ledger.work(Outcome.PASS)
    assert ledger.acknowledged
    for number, outcome in enumerate((Outcome.INCONCLUSIVE, Outcome.ERROR), start=2):
        ledger.work(outcome)
        assert not ledger.acknowledged
        assert ledger.book.acknowledge("c", NOW) == number


def test_a_run_that_is_executed_again_is_news_and_the_same_result_is_none(ledger):
    ledger.book.submit(make_submission("c", 1), NOW)
    ledger.work(Outcome.FAIL)
    ledger.book.acknowledge("c", NOW)
    ledger.book.retry(RetryRequest("c", ("fail",)), NOW)
    assert not ledger.acknowledged
    ledger.book.acknowledge("c", NOW)
    ledger.work(Outcome.FAIL)
    assert ledger.acknowledged


def test_a_campaign_that_is_not_there_is_not_acknowledged(ledger):
    with pytest.raises(Refused, match="there is no campaign c"):
        ledger.book.acknowledge("c", NOW)


def test_failures_of_searches_count_apart(ledger):
    ledger.book.submit(make_submission("c", 2), NOW)
    ledger.work(Outcome.FAIL, Outcome.PASS)
    ledger.book.begin_search(make_search("s"), NOW)
    more = make_extension("s", 0, 3)
    ledger.book.extend(more.proposals, more.runs, NOW)
    ledger.work(Outcome.FAIL, Outcome.FAIL, Outcome.ERROR)
    counts = ledger.reader.counts()[1]
    assert (counts["failed"], counts["searched"], counts["errors"]) == (1, 2, 1)
    assert ledger.reader.campaign("s").failed == 2
