"""gc and doctor, against a real daemon where it matters."""

from functools import partial
from pathlib import Path

import pytest

from scenario_tui.cli import invoke
from tests.make import make_submission
from tests.parts import daemon_at, eventually, finished
from tests.people.cli.outputs import declared
from tests.people.conftest import Said


@pytest.fixture
def call(monkeypatch, capsys):
    """Call ``scenario ... --state STATE`` in this process, against whatever daemon there is."""
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)

    def call(state, *arguments):
        code = invoke((*arguments, "--state", str(state)))
        said = capsys.readouterr()
        return Said(code, said.out, said.err)

    return call


def test_a_daemon_is_watched_and_loses_traces_while_it_works(tmp_path, call):
    state = tmp_path / "state"
    scenario = partial(call, state)
    with daemon_at(state, 2) as daemon, daemon.client() as client:
        client.submit(make_submission("first", 2))
        eventually(lambda: finished(client, 2))
        gate = tmp_path / "gate"
        client.submit(make_submission("second", 6, until=str(gate)))
        assert scenario("pause", "second").code == 0
        gate.touch()
        eventually(lambda: client.overview().running == 0)
        assert "second (paused)" in scenario("status").out
        dry = declared(scenario("gc", "--keep", "0", "-n", "--json").out)
        assert (dry["schema"], dry["dry_run"]) == ("scenario/gc/1", True)
        assert client.runs("first").rows[0].trace
        said = scenario("gc", "--older-than", "0s")
        assert said.code == 0
        assert "first  2 traces" in said.out
        assert "removed 2 traces" in said.out
        assert "its trace is gone" in scenario("results", "first", "--runs").out
        assert client.overview().queued > 0
        assert scenario("priority", "second", "3").code == 0
        assert client.campaigns()[0].priority == 3
        assert scenario("pause", "second", "--off").code == 0
        eventually(lambda: finished(client, 8))
        healthy = scenario("doctor", "--json")
        told = declared(healthy.out)
        levels = {finding["subject"]: finding["level"] for finding in told["findings"]}
        assert (healthy.code, told["schema"]) == (0, "scenario/doctor/1")
        assert levels["daemon"] == levels["workers"] == levels["ledger"] == levels["state"] == "ok"
        numbers = declared(scenario("status", "--json").out)
        assert (numbers["overview"]["passed"], numbers["overview"]["workers"]) == (8, 1)
        assert client.runs("first").rows[0].reason == "its trace is gone"
        rows = client.runs("second").rows
        assert all(Path(row.trace).is_file() and row.outcome == "pass" for row in rows)


def test_doctor_shows_problems_with_their_remedy_and_leaves_with_3(call, tmp_path):
    tmp_path.joinpath("ledger.db").write_bytes(b"?" * 5000)
    said = call(tmp_path, "doctor")
    assert said.code == 3
    assert "✗ problem ledger" in said.out
    assert "sqlite3 ledger.db .recover" in said.out
