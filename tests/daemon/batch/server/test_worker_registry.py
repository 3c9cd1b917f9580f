"""Which workers there are, which of them are away, and when one is forgotten."""

from daemon.batch.server import WorkerRegistry
from daemon.model.messages import WorkerInfo


def info(name):
    return WorkerInfo(name, "host", 1, "1", 2, 0)


def away(registry, now):
    return {row.id: row.away for row in registry.rows(now)}


def test_a_worker_that_lost_its_connection_is_away_until_it_is_back():
    registry = WorkerRegistry(silence=30.0)
    assert registry.record_contact(info("w"), 100.0)
    registry.disconnected("w", 101.0)
    registry.disconnected("stranger", 101.0)
    assert away(registry, 101.0) == {"w": True}
    assert registry.absent(102.0) == frozenset()  # it may be back at once
    assert registry.absent(110.0) == {"w"}
    registry.connected("w")
    assert away(registry, 110.0) == {"w": False}
    assert registry.forget(["w", "stranger"], 110.0) == ()
    registry.disconnected("w", 110.0)
    assert not registry.record_contact(info("w"), 111.0)  # its token may come later
    assert away(registry, 111.0) == {"w": False}
    registry.disconnected("w", 112.0)
    assert registry.forget(["w"], 120.0) == ("w",)
    assert away(registry, 120.0) == {}


def test_a_worker_that_is_silent_is_away_whatever_its_connection_says():
    registry = WorkerRegistry(silence=30.0)
    registry.record_contact(info("w"), 100.0)
    registry.shift(3600.0)  # a clock that is set is no silence
    assert away(registry, 3725.0) == {"w": False}
    assert (away(registry, 3731.0), registry.absent(3731.0)) == ({"w": True}, {"w"})
