"""Runs wait after attempts without a result, ever longer, and beside them others go on."""

import pytest

from daemon.batch.ledger import LedgerReader, LedgerWriter, connect, retry_delay
from daemon.batch.paths import StatePaths
from daemon.model.messages import Completion, ReleaseRequest, RetryRequest, RunQuery
from tests.daemon.batch.samples import make_result, make_submission

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
        return list(reader.runs(RunQuery("c")).rows)


def give_back(book, grant, now, *, blame=False):
    book.release(ReleaseRequest("w", grant.run, grant.token, "no disk", blame), now)


def test_the_delay_doubles_up_to_minutes_and_runs_differ():
    delays = [retry_delay("c.0", setbacks) for setbacks in range(1, 20)]
    for setbacks, delay in enumerate(delays):
        whole = min(2.0**setbacks, 300.0)
        assert 0.75 * whole <= delay <= 1.25 * whole
    assert len({retry_delay(f"c.{i}", 3) for i in range(100)}) == 100
    assert delays == [retry_delay("c.0", setbacks) for setbacks in range(1, 20)]


@pytest.mark.parametrize("blame", [False, True])
def test_a_run_without_a_result_waits_while_others_are_leased(book, tmp_path, blame):
    (first,) = book.lease("w", 1, NOW)
    give_back(book, first, NOW, blame=blame)
    assert [grant.run for grant in book.lease("w", 9, NOW)] == ["c.1", "c.2"]
    row = rows(tmp_path)[0]
    assert (row.setbacks, row.not_before) == (1, NOW + retry_delay("c.0", 1))
    assert row.remark.startswith("waits until ")
    assert row.remark.endswith(" after 1 failed attempt: no disk")
    assert book.end_waits(NOW + 0.1) == 0
    (again,) = book.lease("w", 9, row.not_before)
    give_back(book, again, NOW + 10.0)
    assert rows(tmp_path)[0].not_before == NOW + 10.0 + retry_delay("c.0", 2)


def test_a_result_or_a_person_begins_anew(book, tmp_path):
    first, second, _ = book.lease("w", 3, NOW)
    give_back(book, first, NOW)
    book.expire_leases(NOW + 100.0)
    assert [row.setbacks for row in rows(tmp_path)] == [1, 1, 1]
    book.complete(Completion("w", second.run, 1, second.token, make_result(second.spec)), NOW)
    book.cancel("c", NOW)
    assert book.retry(RetryRequest("c", ("cancelled",)), NOW) == 2
    assert [(row.setbacks, row.not_before) for row in rows(tmp_path)] == [(0, 0.0)] * 3
    assert [grant.run for grant in book.lease("w", 9, NOW)] == ["c.0", "c.2"]


def test_a_lease_that_nobody_began_is_no_failed_attempt(book):
    book.lease("w", 3, NOW)
    book.renew("w", (), NOW)
    assert len(book.lease("w", 9, NOW)) == 3


def test_a_clock_that_was_set_lets_nobody_wait_for_ever(book, tmp_path):
    (first,) = book.lease("w", 1, NOW)
    give_back(book, first, NOW)
    book.shift_leases(1000.0)
    assert rows(tmp_path)[0].not_before == NOW + 1000.0 + retry_delay("c.0", 1)
    assert book.end_waits(NOW) == 1  # it was set back while no daemon looked


def test_a_campaign_that_lacks_its_scene_waits_for_it_and_others_go_on_at_once(book, tmp_path):
    book.submit(make_submission("gone", 600, scenario="gone"), NOW)
    book.submit(make_submission("d", 2), NOW)

    def missing(spec):
        return "its scene is gone" if spec.scenario == "gone" else ""

    grants = [book.lease("w", 1, NOW, missing=missing) for _ in range(5)]
    assert [grant.campaign for (grant,) in grants] == ["c", "d", "c", "d", "c"]
    assert book.lease("w", 1, NOW, missing=missing) == ()
    with LedgerReader.open(StatePaths(tmp_path)) as reader:
        first, *others = reader.runs(RunQuery("gone")).rows
    assert (first.attempt, first.setbacks, first.reason) == (0, 0, "its scene is gone")
    assert {row.reason for row in others} == {""}
    assert book.end_hold("its scene is gone", NOW) == 1
    assert len(book.lease("w", 600, NOW)) == 600
    assert rows(tmp_path)[0].reason == ""


def test_what_a_campaign_lacked_is_looked_for_anew_by_the_next_daemon(book):
    assert book.lease("w", 1, NOW, missing=lambda _: "its scene is gone") == ()
    assert book.lease("w", 1, NOW) == ()
    book.begin_era()
    assert len(book.lease("w", 1, NOW)) == 1


def test_runs_that_wait_are_not_looked_through(db, book):
    asked = []
    db.set_trace_callback(asked.append)
    book.lease("w", 1, NOW)
    db.set_trace_callback(None)
    (query,) = {query for query in asked if "FROM run JOIN spec" in query}
    plan = [str(step[3]) for step in db.execute(f"EXPLAIN QUERY PLAN {query}")]
    assert sum("run_ready" in step for step in plan) == 2
    assert not any(step.startswith("SCAN run") for step in plan)
