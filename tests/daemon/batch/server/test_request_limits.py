"""Whose turn it is, who is not heard any more, and how much one name may ask."""

import json
import os
from datetime import UTC, datetime

import pytest

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.security import find_daemon_credentials
from daemon.batch.security.authority import create_authority, revoke_key
from daemon.batch.server import MOST_WAITING, EventLog, RequestLimits, TurnQueue

NOW = datetime.now(UTC).replace(microsecond=0)


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    folder = tmp_path_factory.mktemp("keys") / "all"
    create_authority(folder, ("localhost",), NOW)
    return folder


@pytest.fixture
def log(tmp_path):
    made = EventLog(tmp_path / "log")
    yield made
    made.close()


def words(no, kind):
    assert type(no) is kind
    return str(no)


def test_a_name_asks_so_much_and_not_more(keys, log, tmp_path):
    clock = Clock()
    limits = RequestLimits(log, find_daemon_credentials(keys), clock, rate=10.0, burst=20.0)
    for _ in range(20):
        assert limits.admit("worker", 10) is None
        limits.answered("worker", 10)
    said = words(limits.admit("worker", 10), Unavailable)
    assert said == 'too many requests under the key "worker": ask again in 0.1 s'
    assert limits.admit("operator", 10) is None
    for _ in range(1000):
        assert limits.admit("owner", 10) is None
        limits.admit("worker", 10)
    clock.now += 1.0
    assert [limits.admit("worker", 10) is None for _ in range(11)] == [True] * 10 + [False]
    limits.look()
    limits.look()
    # One line a second, whatever the flood.
    (line,) = [json.loads(text) for text in (tmp_path / "log").read_text().splitlines()]
    assert (line["event"], line["key"], line["turned_away"]) == (
        "too many requests",
        "worker",
        1002,
    )


def test_a_name_has_so_much_waiting_and_not_more(keys, log):
    limits = RequestLimits(log, find_daemon_credentials(keys), Clock())
    for _ in range(MOST_WAITING):
        assert limits.admit("worker", 0) is None
    assert "too many requests" in words(limits.admit("worker", 0), Unavailable)
    limits.answered("worker", 0)
    assert limits.admit("worker", 0) is None
    # However large: one at a time.
    assert limits.admit("operator", 2**30) is None
    assert "too many requests" in words(limits.admit("operator", 1), Unavailable)


def test_who_was_revoked_is_not_heard_any_more(tmp_path, log):
    folder = tmp_path / "keys"
    create_authority(folder, ("localhost",), NOW)
    clock = Clock()
    limits = RequestLimits(log, find_daemon_credentials(folder), clock)
    before = (folder / "register.json").read_bytes()
    limits.look()
    revoke_key(folder, "worker", NOW)
    assert limits.admit("worker", 0) is None
    clock.now += 1.0
    limits.look()
    assert 'the key "worker" was revoked' in words(limits.admit("worker", 0), Refused)
    assert limits.admit("viewer", 0) is None
    # Neither a register of before nor none at all makes anybody come back.
    for spoil in (
        lambda: (folder / "register.json").write_bytes(before),
        (folder / "ca.key").touch,
    ):
        spoil()
        clock.now += 1.0
        limits.look()
        assert "was revoked" in words(limits.admit("worker", 0), Refused)
    os.remove(folder / "register.json")  # noqa: PTH107
    clock.now += 1.0
    limits.look()
    assert "was revoked" in words(limits.admit("worker", 0), Refused)
    assert limits.admit("viewer", 0) is None


def test_without_keys_there_is_nobody_but_the_owner(log):
    limits = RequestLimits(log)
    assert limits.admit("owner", 0) is None
    for name in ("worker", "*", "", "x" * 1000):
        assert words(limits.admit(name, 0), Refused).startswith("this daemon knows no key")


def test_names_take_turns():
    line = TurnQueue()
    for number in range(5):
        line.put(f"flood {number}", "flood")
    for number in range(2):
        line.put(f"calm {number}", "calm")
    line.put("late", "late")
    line.close()
    order = []
    while (item := line.get()) is not None:
        order.append(item)
    assert order == [
        "flood 0", "calm 0", "late", "flood 1", "calm 1", "flood 2", "flood 3", "flood 4",
    ]  # fmt: skip
    assert line.empty()
