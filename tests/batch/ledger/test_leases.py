"""Leases: who holds what, in which order runs are given out, what waits, what others hear of it."""

from collections import deque
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.batch.errors import OtherLedger, Refused
from daemon.batch.ledger import LedgerWriter, connect
from daemon.batch.ledger.transitions import MOST_LAPSES
from daemon.batch.paths import StatePaths
from daemon.model.messages import LedgerAnswer, SteerRequest
from daemon.model.spec import SutReference
from daemon.model.verdicts import RunState
from tests.batch.conftest import NOW, refs
from tests.make import make_spec, make_submission

LATER = NOW + 100.0


@pytest.fixture
def contested(ledger):
    """A run that is leased anew since the first lease has lapsed."""
    ledger.submit("c", 1)
    (first,) = ledger.lease(worker="cut")
    ledger.lapse()
    (second,) = ledger.lease(worker="other", at=LATER)
    return ledger, first, second


def hints(ledger):
    """What the daemon passes on as a hint that something is not needed any more."""
    return [event.id for event in ledger.book.events if event.state == "superseded"]


def test_whoever_comes_second_is_told_to_stop_and_gets_a_hint(contested):
    ledger, first, second = contested
    assert ledger.renew(first, worker="cut") == ledger.renew(second, worker="other") == ()
    assert ledger.complete(first, worker="cut") is LedgerAnswer.RECORDED
    assert (hints(ledger), ledger.reader.run("c.0").row.worker) == (["c.0"], "cut")
    assert ledger.renew(second, worker="other") == refs(second)
    assert ledger.complete(second, worker="other") is LedgerAnswer.KNOWN
    assert hints(ledger) == ["c.0"]


@pytest.mark.parametrize("back", [True, False])
def test_only_who_came_back_gets_a_hint(contested, back):
    ledger, first, second = contested
    if back:
        ledger.renew(first, worker="cut")
    assert ledger.complete(second, worker="other") is LedgerAnswer.RECORDED
    assert hints(ledger) == ["c.0"] * back
    assert ledger.renew(first, worker="cut") == refs(first)


def test_a_worker_that_holds_nothing_any_more_is_not_busy(contested):
    ledger, first, _ = contested
    assert ledger.book.busy_workers() == {"other"}
    ledger.lapse()
    assert ledger.book.busy_workers() == frozenset()
    # The next worker of the machine has taken over what the first one finished.
    assert ledger.renew(first, worker="heir") == ()
    assert ledger.book.busy_workers() == {"heir"}


def test_what_a_worker_does_not_claim_it_never_got(ledger):
    ledger.submit("c", 1)
    (grant,) = ledger.lease()
    ledger.renew(worker="v")
    assert ledger.book.busy_workers() == {"w"}
    ledger.renew()
    assert ledger.book.busy_workers() == frozenset()
    (again,) = ledger.lease(worker="v")
    assert (again.attempt, again.token > grant.token) == (2, True)


def test_why_an_attempt_failed_is_told_once(ledger):
    ledger.submit("c", 1)
    (grant,) = ledger.lease()
    ledger.release(grant, "it crashed", blame=True)
    ledger.lease(at=LATER)
    steps = [(state, note) for _, state, note in ledger.reader.steps("c.0")]
    assert steps == [("running", ""), ("queued", "it crashed"), ("running", "")]


@pytest.mark.parametrize("blame", [False, True])
def test_a_run_that_was_given_back_stands_behind_the_others(ledger, blame):
    ledger.submit("c", 3)
    (first,) = ledger.lease(1)
    ledger.release(first, "no disk", blame=blame)
    assert ledger.rows("c")[0].reason == "no disk"
    assert ledger.leased() == ["c.1", "c.2", "c.0"]


def test_a_run_that_takes_its_workers_with_it_is_given_up(ledger):
    ledger.submit("c", 3)
    ledger.lease(2)
    for _ in range(MOST_LAPSES):
        (grant,) = ledger.lease(1)
        assert grant.run == "c.2"
        ledger.release(grant, "its worker died", died=True, worker="v")
    row = ledger.rows("c")[2]
    assert (row.state, row.attempt) == (RunState.LOST, MOST_LAPSES)
    assert row.reason.startswith("20 workers in a row died with it or fell silent")


def test_a_campaign_that_lacks_its_scene_waits_for_it_and_others_go_on_at_once(ledger):
    ledger.submit("c", 3)
    ledger.submit("gone", *(make_spec(repeat, scenario="gone") for repeat in range(60)))
    ledger.submit("d", 2)

    def missing(spec):
        return "scene 0123456789abcdef" if spec.scenario == "gone" else ""

    grants = [ledger.lease(1, missing=missing) for _ in range(5)]
    assert [grant.campaign for (grant,) in grants] == ["c", "d", "c", "d", "c"]
    assert ledger.lease(1, missing=missing) == ()
    first, *others = ledger.rows("gone")
    words = "the scene 0123456789ab is gone or was damaged: submit its campaign again"
    assert (first.attempt, first.reason) == (0, words)
    assert {row.reason for row in others} == {""}
    ledger.book.end_holds(lambda lacked: lacked != "scene 0123456789abcdef", NOW)
    assert ledger.lease(1) == ()
    ledger.book.end_holds(lambda lacked: lacked == "scene 0123456789abcdef", NOW)
    assert len(ledger.lease(60)) == 60
    assert ledger.rows("c")[0].reason == ""


def test_what_a_campaign_lacked_is_looked_for_anew_by_the_next_daemon(ledger):
    ledger.submit("c", 3)
    assert ledger.lease(1, missing=lambda _: "scene 0123") == ledger.lease(1) == ()
    ledger.book.begin_era()
    assert len(ledger.lease(1)) == 1


def test_a_copy_of_a_ledger_knows_the_eras_before_it_only(ledger, tmp_path):
    ledger.submit("c", 3)
    first = ledger.book.begin_era()
    (early,) = ledger.lease(1)
    other = StatePaths(tmp_path / "copy")
    other.make_folders()
    ledger.db.execute("VACUUM INTO ?", (str(other.ledger),))
    second = ledger.book.begin_era()
    (late,) = ledger.lease(1)
    assert (early.era, late.era) == (first, second)
    ledger.book.require_era(first, early.token)
    ledger.book.require_era(second, late.token)
    with LedgerWriter.open(other) as copy:
        copy.require_era(first, early.token)
        copy.begin_era()
        # The last lease was granted in an era of the copy, after the copy was made.
        strangers = ((ledger.book, ""), (ledger.book, "0" * 16), (copy, second))
        for book, era, *token in (*strangers, (copy, first, late.token)):
            with pytest.raises(OtherLedger):
                book.require_era(era, *token)


def test_the_next_run_is_found_by_an_index(ledger):
    ledger.submit("c", 3)
    statements = []
    ledger.db.set_trace_callback(statements.append)
    ledger.lease(1)
    ledger.db.set_trace_callback(None)
    (query,) = {query for query in statements if "FROM run WHERE state" in query}
    plan = [str(step[3]) for step in ledger.db.execute(f"EXPLAIN QUERY PLAN {query}")]
    assert sum("run_ready" in step for step in plan) == 2
    assert not any(step.startswith(("SCAN run", "USE TEMP B-TREE")) for step in plan)


# --- turns


def test_runs_a_worker_cannot_execute_wait_for_another_one(ledger):
    plugged = [replace(make_spec(i), sut=SutReference("mine", "plugged", {})) for i in range(2)]
    ledger.submit("a", *plugged)
    ledger.submit("b", *plugged[:1], make_spec(1))
    assert [grant.run for grant in ledger.lease(lacks=("plugged", "other"))] == ["b.1"]
    assert ledger.leased() == ["a.0", "b.0", "a.1"]


def test_a_paused_campaign_finishes_what_runs_and_can_be_cancelled_and_tried_again(ledger):
    ledger.submit("a", 3)
    (running,) = ledger.lease(1)
    assert ledger.steer("a", paused=True) == 2
    ledger.complete(running)
    assert ledger.steer("a", paused=True) == 2
    assert ledger.happened("campaign").count("paused") == 1
    assert ledger.book.cancel("a", NOW) == 2
    assert ledger.retry("a", "cancelled") == 2
    ledger.steer("a", priority=7)
    row = ledger.row("a")
    assert (row.paused, row.priority, row.queued, ledger.leased()) == (True, 7, 2, [])
    assert ledger.steer("a", paused=False) == 2
    assert ledger.leased() == ["a.1", "a.2"]


@pytest.mark.parametrize("how", [{"paused": True}, {"priority": 1}])
def test_unknown_campaigns_are_not_steered(ledger, how):
    with pytest.raises(Refused, match="no campaign x"):
        ledger.steer("x", **how)


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
            assert [grant.run for grant in book.lease("w", number, NOW)] == expected
        elif step == "priority":
            rank[names[number]] += 1
            book.steer(SteerRequest(names[number], priority=rank[names[number]]), NOW)
        else:
            (paused.add if step == "pause" else paused.discard)(names[number])
            book.steer(SteerRequest(names[number], paused=step == "pause"), NOW)
    running = db.execute("SELECT count(*) FROM run WHERE state = ?", (RunState.RUNNING,))
    assert running.fetchone()[0] == turn
    db.close()
