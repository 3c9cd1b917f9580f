"""gc, doctor, metrics, units: against a real daemon where it matters."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.daemon.harness import daemon_at, eventually, finished
from tests.daemon.samples import make_submission


def test_traces_go_while_a_daemon_keeps_working(tmp_path: Path, scenario) -> None:
    state = tmp_path / "state"
    with daemon_at(state, 2) as daemon, daemon.client() as client:
        client.submit(make_submission("first", 4))
        eventually(lambda: finished(client, 4))
        client.submit(make_submission("second", 30, sleep=0.02))
        dry = json.loads(scenario("gc", "--keep", "0", "-n", "--state", str(state), "--json").out)
        assert (dry["schema"], dry["dry_run"]) == ("scenario/gc/1", True)
        assert client.runs("first").rows[0].trace
        said = scenario("gc", "--older-than", "0s", "--state", str(state))
        assert said.code == 0
        assert "first  4 traces" in said.out
        assert "removed 4 traces" in said.out
        eventually(lambda: finished(client, 34))
        assert client.runs("first").rows[0].reason == "its trace is gone"
        rows = client.runs("second").rows
        assert all(Path(row.trace).is_file() and row.outcome == "pass" for row in rows)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), "say what to keep"),
        (("--older-than", "soon"), "'soon' is not an age"),
        (("--max-size", "3 bottles"), "'3 bottles' is not a size"),
    ],
)
def test_gc_wants_to_know_what_to_keep(scenario, tmp_path, options, words) -> None:
    said = scenario("gc", "--state", str(tmp_path), *options)
    assert said.code == 2
    assert words in said.err


def test_gc_without_a_ledger_says_so(scenario, tmp_path) -> None:
    said = scenario("gc", "--keep", "3", "--state", str(tmp_path))
    assert said.code == 3
    assert "there is no ledger" in said.err


def test_units_name_everything_by_absolute_paths(scenario, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    unit = scenario("daemon", "--print-unit", "--state", "my state", "--slots", "2").out
    assert f'"daemon" "--state" "{tmp_path}/my state" "--listen"' in unit
    assert scenario("worker", "--print-unit", "--state", "here").out.count(f"{tmp_path}/here") == 1
    far = scenario("worker", "--print-unit", "--connect", "tcp/far:7447").out
    assert '"worker" "--connect" "tcp/far:7447"\n' in far
