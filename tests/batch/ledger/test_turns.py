"""Campaigns take turns, wait while they are paused, and go first when they matter more."""

from collections import deque
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerReader, LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.model.messages import Completion, RetryRequest, SteerRequest
from daemon.model.run_state import RunState
from daemon.model.spec import SutReference
from tests.make import make_result, make_spec, make_submission, submission_of

NOW = 1000.0


@pytest.fixture
def book(tmp_path):
    db = connect(tmp_path / "ledger.db")
    yield LedgerWriter(db)
    db.close()


def leased(book, count=100):
    return [grant.run for grant in book.lease("w", count, NOW)]


def test_campaigns_take_turns_however_workers_ask(book):
    for name, runs in (("a", 4), ("b", 2)):
        book.submit(make_submission(name, runs), NOW)
    assert leased(book, 1) + leased(book, 2) + leased(book) == [
        "a.0", "b.0", "a.1", "b.1", "a.2", "a.3",
    ]  # fmt: skip


def test_one_that_comes_later_need_not_wait_for_those_before(book):
    book.submit(make_submission("long", 50), NOW)
    leased(book, 10)
    book.submit(make_submission("short", 2), NOW)
    assert leased(book, 4) == ["short.0", "long.10", "short.1", "long.11"]


def test_higher_priority_goes_first(book):
    for name in ("a", "b", "c"):
        book.submit(make_submission(name, 2), NOW)
    book.steer(SteerRequest("b", priority=5), NOW)
    book.steer(SteerRequest("a", priority=-1), NOW)
    assert leased(book) == ["b.0", "b.1", "c.0", "c.1", "a.0", "a.1"]


def test_runs_a_worker_cannot_execute_wait_for_another_one(book):
    plugged = [replace(make_spec(i), sut=SutReference("mine", "plugged", {})) for i in range(2)]
    book.submit(submission_of("a", *plugged), NOW)
    book.submit(submission_of("b", *plugged[:1], make_spec(1)), NOW)
    grants = book.lease("w", 100, NOW, lacks=("plugged", "other"))
    assert [grant.run for grant in grants] == ["b.1"]
    assert leased(book) == ["a.0", "b.0", "a.1"]


def test_a_paused_campaign_waits_and_finishes_what_runs(book):
    book.submit(make_submission("a", 3), NOW)
    (running,) = book.lease("w", 1, NOW)
    assert book.steer(SteerRequest("a", paused=True), NOW) == 2
    assert leased(book) == []
    done = ("w", running.run, 1, running.token, make_result(running.spec))
    book.complete(Completion(*done), NOW)
    assert leased(book) == []
    assert book.steer(SteerRequest("a", paused=True), NOW) == 2
    assert [event.state for event in book.events].count("paused") == 1
    assert book.steer(SteerRequest("a", paused=False), NOW) == 2
    assert leased(book) == ["a.1", "a.2"]


def test_a_paused_campaign_can_be_cancelled_and_tried_again(book):
    book.submit(make_submission("a", 2), NOW)
    book.steer(SteerRequest("a", paused=True), NOW)
    assert book.cancel("a", NOW) == 2
    assert book.retry(RetryRequest("a", ("cancelled",)), NOW) == 2
    assert leased(book) == []
    book.steer(SteerRequest("a", paused=False), NOW)
    assert leased(book) == ["a.0", "a.1"]


def test_rows_say_so(tmp_path, book):
    book.submit(make_submission("a", 1), NOW)
    book.steer(SteerRequest("a", paused=True), NOW)
    book.steer(SteerRequest("a", priority=7), NOW)
    db = connect(tmp_path / "ledger.db")
    (row,) = LedgerReader(db, StatePaths(tmp_path)).campaigns()
    db.close()
    assert (row.paused, row.priority, row.queued) == (True, 7, 1)


def test_unknown_campaigns_are_refused(book):
    with pytest.raises(Refused, match="no campaign x"):
        book.steer(SteerRequest("x", paused=True), NOW)
    with pytest.raises(Refused, match="no campaign x"):
        book.steer(SteerRequest("x", priority=1), NOW)


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("lease"), st.integers(1, 3)),
        st.tuples(st.sampled_from(["pause", "resume"]), st.integers(0, 2)),
        st.tuples(st.just("priority"), st.integers(0, 2)),
    ),
    max_size=12,
)


@given(sizes=st.lists(st.integers(1, 4), min_size=3, max_size=3), steps=STEPS)
def test_leases_follow_the_plain_rule(sizes, steps):
    """Against queues in memory: unpaused, highest priority, served longest ago, in order."""
    db = connect(Path(":memory:"))
    book = LedgerWriter(db)
    names = ("a", "b", "c")
    for name, size in zip(names, sizes, strict=True):
        book.submit(make_submission(name, size), NOW)
    queues = {n: deque(f"{n}.{i}" for i in range(s)) for n, s in zip(names, sizes, strict=True)}
    paused, rank, served = set(), dict.fromkeys(names, 0), dict.fromkeys(names, 0)
    turn = 0
    for step, number in steps:
        if step == "lease":
            expected = []
            while len(expected) < number:
                able = [n for n in names if queues[n] and n not in paused]
                if not able:
                    break
                name = min(able, key=lambda n: (-rank[n], served[n], n))
                turn += 1
                served[name] = turn
                expected.append(queues[name].popleft())
            assert leased(book, number) == expected
        elif step == "priority":
            rank[names[number]] += 1
            book.steer(SteerRequest(names[number], priority=rank[names[number]]), NOW)
        else:
            (paused.add if step == "pause" else paused.discard)(names[number])
            book.steer(SteerRequest(names[number], paused=step == "pause"), NOW)
    running = db.execute("SELECT count(*) FROM run WHERE state = ?", (RunState.RUNNING,))
    assert running.fetchone()[0] == turn
    db.close()
