"""Leases in the ledger: who holds what, what others hear of it, what a daemon forgets."""

import pytest

from daemon.batch.ledger import LedgerReader, LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.model.messages import Completion, LeaseRef, LedgerAnswer, ReleaseRequest
from tests.make import make_result, make_submission

NOW = 1000.0
LATER = NOW + 100.0


@pytest.fixture
def book(tmp_path):
    db = connect(tmp_path / "ledger.db")
    book = LedgerWriter(db)
    book.submit(make_submission("c", 1), NOW)
    yield book
    db.close()


@pytest.fixture
def reader(book, tmp_path):
    with LedgerReader.open(StatePaths(tmp_path)) as reader:
        yield reader


def refs(*grants):
    return tuple(LeaseRef(grant.run, grant.token) for grant in grants)


def complete(book, worker, grant):
    result = make_result(grant.spec)
    done = Completion(worker, grant.run, grant.attempt, grant.token, result)
    return book.complete(done, LATER)


def heard(book):
    """What the daemon passes on as a hint that something is not needed any more."""
    return [event.id for event in book.events if event.state == "superseded"]


def replaced(book):
    """A run that is leased anew since the first lease has lapsed."""
    (first,) = book.lease("cut", 1, NOW)
    book.lapse(book.leases(), LATER)
    (second,) = book.lease("other", 1, LATER)
    return first, second


def test_whoever_comes_second_is_told_to_stop_and_gets_a_hint(book, reader):
    first, second = replaced(book)
    assert book.renew("cut", refs(first), LATER) == ()
    assert book.renew("other", refs(second), LATER) == ()
    assert complete(book, "cut", first) is LedgerAnswer.RECORDED
    assert (heard(book), reader.run("c.0").row.worker) == (["c.0"], "cut")
    assert book.renew("other", refs(second), LATER) == refs(second)
    assert complete(book, "other", second) is LedgerAnswer.KNOWN
    assert heard(book) == ["c.0"]


def test_who_came_back_gets_a_hint_too(book):
    first, second = replaced(book)
    book.renew("cut", refs(first), LATER)
    assert complete(book, "other", second) is LedgerAnswer.RECORDED
    assert heard(book) == ["c.0"]
    assert book.renew("cut", refs(first), LATER) == refs(first)


def test_nobody_is_told_to_stop_where_nobody_else_is_at_it(book):
    _, second = replaced(book)
    assert complete(book, "other", second) is LedgerAnswer.RECORDED
    assert heard(book) == []


def test_a_worker_that_holds_nothing_any_more_is_not_busy(book):
    first, _ = replaced(book)
    assert book.busy_workers() == {"other"}
    book.lapse(book.leases(), LATER + 100.0)
    assert book.busy_workers() == frozenset()
    # The next worker of the machine has taken over what the first one finished.
    assert book.renew("heir", refs(first), LATER) == ()
    assert book.busy_workers() == {"heir"}


def test_what_a_worker_does_not_claim_it_never_got(book):
    (grant,) = book.lease("w", 1, NOW)
    book.renew("v", (), NOW)
    assert book.busy_workers() == {"w"}
    book.renew("w", (), NOW)
    assert book.busy_workers() == frozenset()
    (again,) = book.lease("v", 1, NOW)
    assert (again.attempt, again.token > grant.token) == (2, True)


def test_why_an_attempt_failed_is_told_once(book, reader):
    (grant,) = book.lease("w", 1, NOW)
    book.release(ReleaseRequest("w", grant.run, grant.token, "it crashed", blame=True), NOW)
    book.lease("w", 1, LATER)
    told = [(state, note) for _, state, note in reader.steps("c.0")]
    assert told == [("running", ""), ("queued", "it crashed"), ("running", "")]
