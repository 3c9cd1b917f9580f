"""Which workers there are, which of them are away, when one is forgotten, when time stands still.

The state machine of the ledger holds what becomes of leases that lapse.
"""

import pytest

from daemon.batch.server._workers import LeaseClock, LeaseDeadlines, WorkerRegistry
from daemon.model.messages import LeaseRef, WorkerInfo

TICK = 0.5


@pytest.fixture
def clock():
    made = LeaseClock(TICK)
    made.advance(0.0)
    return made


@pytest.fixture
def registry(clock):
    made = WorkerRegistry(30.0, clock)
    assert made.record_contact(WorkerInfo("w", "host", 1, "1", 2, 0))
    return made


def passes(clock, seconds):
    """Let the clock tick for so many seconds."""
    for _ in range(round(seconds / TICK)):
        clock.advance(clock.now + TICK)


def away(registry):
    return {row.id: row.away for row in registry.rows()}


def test_a_worker_that_lost_its_connection_is_away_until_it_is_back(clock, registry):
    registry.disconnected("w")
    registry.disconnected("stranger")
    assert away(registry) == {"w": True}
    passes(clock, 1.0)
    assert registry.absent() == frozenset()  # it may be back at once
    passes(clock, 8.0)
    assert registry.absent() == {"w"}
    registry.connected("w")
    assert away(registry) == {"w": False}
    assert registry.forget(["w", "stranger"]) == ()
    registry.disconnected("w")
    # Its token may come later.
    assert not registry.record_contact(WorkerInfo("w", "host", 1, "1", 2, 0))
    assert away(registry) == {"w": False}
    registry.disconnected("w")
    passes(clock, 8.0)
    assert registry.forget(["w"]) == ("w",)
    assert away(registry) == {}


def test_a_worker_that_is_silent_is_away_whatever_its_connection_says(clock, registry):
    passes(clock, 29.5)
    assert away(registry) == {"w": False}
    passes(clock, 0.5)
    assert (away(registry), registry.absent()) == ({"w": True}, {"w"})


def test_a_tick_that_comes_late_is_a_stall_and_takes_no_more_than_another():
    clock = LeaseClock(TICK)
    assert [clock.advance(at) for at in (10.0, 10.5, 11.2)] == [0.0, 0.0, 0.0]
    assert clock.now == pytest.approx(1.2)
    assert clock.advance(15.2) == pytest.approx(3.0)
    assert clock.now == pytest.approx(2.2)
    assert clock.advance(15.2) == 0.0


def test_a_lease_lapses_after_its_period_and_not_at_its_end(clock):
    deadlines, lease = LeaseDeadlines(30.0, clock), LeaseRef("c.0", 7)
    passes(clock, 100.0)  # of another daemon, say
    for seconds in (0.0, 30.0):
        passes(clock, seconds)
        assert deadlines.overdue((lease,)) == ()
    passes(clock, TICK)
    assert deadlines.overdue((lease,)) == (lease,)
