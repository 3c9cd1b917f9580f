"""show, logs, wait: one run in words, what happened in it, staying until a campaign is over."""

import json
from contextlib import closing
from dataclasses import replace

import pytest

from daemon.batch.ledger import LedgerWriter, connect
from daemon.model.messages import ReleaseRequest
from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from scenario_tui.library import job, watching
from tests.make import make_submission
from tests.people.fake import CAMPAIGN

NOW = 1_000_000.0


@pytest.fixture
def state(tmp_path):
    """A state directory: run 0 was given back once and has a trace, run 1 prints something."""
    folder = tmp_path / "state"
    folder.mkdir()
    with closing(connect(folder / "ledger.db")) as ledger:
        book = LedgerWriter(ledger)
        book.submit(make_submission("c-1", 2), NOW)
        (grant,) = book.lease("w", 1, NOW)
        book.release(
            ReleaseRequest("w", grant.run, grant.token, "the SUT crashed\nsegfault", True), NOW
        )
    output = folder / "spool" / "w" / "c-1.1" / "attempt-1" / "output.txt"
    output.parent.mkdir(parents=True)
    output.write_text("loading the map\n")
    return folder


def test_logs_tell_attempts_and_reasons(scenario, state):
    said = scenario("show", "c.0", "--log", "--state", str(state))
    assert said.code == 0
    assert [line.split()[2:] for line in said.out.splitlines()[:2]] == [
        ["running"],
        ["queued", "the", "SUT", "crashed"],
    ]
    assert said.out.count("the SUT crashed") == 1
    body = json.loads(scenario("show", "c-1.0", "--log", "--state", str(state), "--json").out)
    assert [step["state"] for step in body["steps"]] == ["running", "queued"]


def test_logs_tell_what_an_attempt_prints(scenario, state):
    assert "loading the map" in scenario("show", "c-1.1", "--log", "--state", str(state)).out


def test_logs_need_a_state_directory_or_a_trace(scenario, tmp_path):
    said = scenario("show", "c-1.0", "--log", "--state", str(tmp_path))
    assert said.code == 2
    assert "c-1.0 is no trace, no folder, no campaign or run in" in said.err
    assert scenario("show", str(tmp_path / "none.mcap"), "--log").code == 2


def _finish(daemon):
    daemon.rows = tuple(
        replace(row, state=RunState.DONE, outcome=row.outcome or Outcome.PASS)
        for row in daemon.rows
    )


def test_waiting_leaves_with_the_code_of_the_campaign(scenario, fake, monkeypatch):
    monkeypatch.setattr(watching, "INTERVAL", 0.001)
    looks = iter(range(10))
    fake.before = lambda daemon: next(looks, None) is None and _finish(daemon)
    said = scenario("wait", "first")
    assert (said.code, said.out) == (1, "")
    assert said.err == f"{CAMPAIGN}: ✗ 2 runs unexpected\n"
    assert json.loads(scenario("wait", "first", "--json").out)["assessment"]["exit_code"] == 1


def test_leaving_stops_the_waiting_only(scenario, fake, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(job, "watch", interrupted)
    said = scenario("wait", "first")
    assert said.code == 130
    assert f"{CAMPAIGN} goes on" in said.err
    assert not [call for call in fake.calls if call[0] == "cancel"]


@pytest.fixture
def away(fake, monkeypatch, tmp_path):
    """A state directory of a daemon that does not answer until it was asked four times."""
    monkeypatch.setattr(watching, "INTERVAL", 0.001)
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path))
    asked = iter(range(4))
    fake.reachable = False

    def before(daemon):
        if next(asked, None) is None:
            daemon.reachable = True
            _finish(daemon)

    fake.before = before
    return tmp_path


@pytest.mark.parametrize("by_name", [True, False])
def test_a_daemon_that_is_away_at_first_is_waited_for(scenario, away, by_name):
    if not by_name:
        (away / "ledger.db").touch()
    where = ("--connect", "tcp/127.0.0.1:7447") if by_name else ()
    said = scenario("wait", "first", *where)
    assert said.code == 1
    assert said.err.splitlines() == [
        "the daemon does not answer, waiting for it (Ctrl-C to leave)",
        f"{CAMPAIGN}: ✗ 2 runs unexpected",
    ]


def test_where_there_never_was_a_daemon_nobody_waits(scenario, away):
    said = scenario("wait", "first")
    assert said.code == 3
    assert "waiting" not in said.err
    (away / "ledger.db").touch()
    assert scenario("wait", "first", "--timeout", "0s").code == 3
    assert scenario("wait", "first").code == 1
