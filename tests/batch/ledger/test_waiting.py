"""Runs that were given back, and campaigns that lack something: others go before them."""

import pytest

from daemon.batch.ledger import LedgerReader, LedgerWriter, connect
from daemon.batch.ledger.transitions import MOST_LAPSES
from daemon.batch.paths import StatePaths
from daemon.model.messages import ReleaseRequest
from daemon.model.run_state import RunState
from tests.make import make_submission

NOW = 1_000_000.0


@pytest.fixture
def db(tmp_path):
    found = connect(tmp_path / "ledger.db")
    yield found
    found.close()


@pytest.fixture
def book(db):
    made = LedgerWriter(db, attempts=3)
    made.submit(make_submission("c", 3), NOW)
    return made


def rows(tmp_path):
    with LedgerReader.open(StatePaths(tmp_path)) as reader:
        return list(reader.runs("c").rows)


def give_back(book, grant, now, *, blame=False):
    book.release(ReleaseRequest("w", grant.run, grant.token, "no disk", blame), now)


@pytest.mark.parametrize("blame", [False, True])
def test_a_run_that_was_given_back_stands_behind_the_others(book, tmp_path, blame):
    (first,) = book.lease("w", 1, NOW)
    give_back(book, first, NOW, blame=blame)
    assert rows(tmp_path)[0].reason == "no disk"
    assert [grant.run for grant in book.lease("w", 9, NOW)] == ["c.1", "c.2", "c.0"]


def test_a_run_that_takes_its_workers_with_it_is_given_up(book, tmp_path):
    book.lease("w", 2, NOW)
    for _ in range(MOST_LAPSES):
        (grant,) = book.lease("w", 1, NOW)
        assert grant.run == "c.2"
        died = ReleaseRequest("v", grant.run, grant.token, "its worker died", False, died=True)
        book.release(died, NOW)
    row = rows(tmp_path)[2]
    assert (row.state, row.attempt) == (RunState.LOST, MOST_LAPSES)
    assert row.reason.startswith("20 workers in a row died with it or fell silent")


def test_a_lease_that_nobody_began_is_no_failed_attempt(book):
    book.lease("w", 3, NOW)
    book.renew("w", (), NOW)
    assert len(book.lease("w", 9, NOW)) == 3


def test_a_campaign_that_lacks_its_scene_waits_for_it_and_others_go_on_at_once(book, tmp_path):
    book.submit(make_submission("gone", 600, scenario="gone"), NOW)
    book.submit(make_submission("d", 2), NOW)

    def missing(spec):
        return "scene 0123456789abcdef" if spec.scenario == "gone" else ""

    grants = [book.lease("w", 1, NOW, missing=missing) for _ in range(5)]
    assert [grant.campaign for (grant,) in grants] == ["c", "d", "c", "d", "c"]
    assert book.lease("w", 1, NOW, missing=missing) == ()
    with LedgerReader.open(StatePaths(tmp_path)) as reader:
        first, *others = reader.runs("gone").rows
    words = "the scene 0123456789ab is gone or was damaged: submit its campaign again"
    assert (first.attempt, first.reason) == (0, words)
    assert {row.reason for row in others} == {""}
    book.end_holds(lambda lacked: lacked != "scene 0123456789abcdef", NOW)
    assert book.lease("w", 1, NOW) == ()
    book.end_holds(lambda lacked: lacked == "scene 0123456789abcdef", NOW)
    assert len(book.lease("w", 600, NOW)) == 600
    assert rows(tmp_path)[0].reason == ""


def test_what_a_campaign_lacked_is_looked_for_anew_by_the_next_daemon(book):
    assert book.lease("w", 1, NOW, missing=lambda _: "scene 0123") == ()
    assert book.lease("w", 1, NOW) == ()
    book.begin_era()
    assert len(book.lease("w", 1, NOW)) == 1


def test_the_next_run_is_found_by_an_index(db, book):
    asked = []
    db.set_trace_callback(asked.append)
    book.lease("w", 1, NOW)
    db.set_trace_callback(None)
    (query,) = {query for query in asked if "FROM run WHERE state" in query}
    plan = [str(step[3]) for step in db.execute(f"EXPLAIN QUERY PLAN {query}")]
    assert sum("run_ready" in step for step in plan) == 2
    assert not any(step.startswith(("SCAN run", "USE TEMP B-TREE")) for step in plan)
