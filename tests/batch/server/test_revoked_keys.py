"""Keys that are refused: unknown ones, and those that were revoked."""

import os
from datetime import UTC, datetime

import pytest

from daemon.batch.errors import Refused
from daemon.batch.security import find_daemon_credentials
from daemon.batch.security.authority import create_authority, revoke_key
from daemon.batch.server._revoked_keys import RevokedKeys
from daemon.batch.server._runtime import EventLog

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


def words(problem):
    assert type(problem) is Refused
    return str(problem)


def test_who_was_revoked_is_not_heard_any_more(tmp_path, log):
    folder = tmp_path / "keys"
    create_authority(folder, ("localhost",), NOW)
    clock = Clock()
    revoked = RevokedKeys(log, find_daemon_credentials(folder), clock)
    before = (folder / "register.json").read_bytes()
    revoked.look()
    revoke_key(folder, "worker", NOW)
    assert revoked.problem("worker") is None
    clock.now += 1.0
    revoked.look()
    assert 'the key "worker" was revoked' in words(revoked.problem("worker"))
    assert revoked.problem("viewer") is None
    # Neither a register of before nor none at all makes anybody come back.
    for spoil in (
        lambda: (folder / "register.json").write_bytes(before),
        (folder / "ca.key").touch,
    ):
        spoil()
        clock.now += 1.0
        revoked.look()
        assert "was revoked" in words(revoked.problem("worker"))
    os.remove(folder / "register.json")  # noqa: PTH107
    clock.now += 1.0
    revoked.look()
    assert "was revoked" in words(revoked.problem("worker"))
    assert revoked.problem("viewer") is None


def test_without_keys_there_is_nobody_but_the_owner(log):
    revoked = RevokedKeys(log)
    assert revoked.problem("owner") is None
    for name in ("worker", "*", "", "x" * 1000):
        assert words(revoked.problem(name)).startswith("this daemon knows no key")
