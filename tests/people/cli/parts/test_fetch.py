"""Traces of a daemon elsewhere: fetched, and read by the commands that are about recorded runs."""

import json
from pathlib import Path

import pytest

from daemon.batch.paths import StatePaths
from daemon.model.ids import trace_name
from scenario_tui.cli import invoke
from tests.analysis.report.recordings import OPEN, SHUT, SUTS
from tests.parts import daemon_at
from tests.people.cli.outputs import declared
from tests.people.recorded import campaign_at


@pytest.fixture(scope="module")
def far(tmp_path_factory):
    """A daemon with a campaign: two runs with traces, one that waits."""
    places = StatePaths(tmp_path_factory.mktemp("far") / "state")
    campaign_at(places)
    with daemon_at(places.state) as daemon:
        daemon.client().close()
        yield daemon


@pytest.fixture
def here(tmp_path, far, monkeypatch):
    """A folder of another machine, as far as commands can tell: the files are not there."""
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    monkeypatch.setenv("SCENARIO_CONNECT", far.endpoint)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    there = Path.is_file

    def is_file(path):
        return not path.is_relative_to(far.state) and there(path)

    monkeypatch.setattr(Path, "is_file", is_file)
    return tmp_path


def cached(here):
    return sorted((here / "cache" / "scenario" / "traces").glob("*.mcap"))


def test_a_campaign_is_fetched_once_and_verified(here, far, capsys):
    (here / "corr").mkdir()  # as `scenario new corr` leaves it
    assert invoke(["export", "corr", "traces", "-o", "out", "--json"]) == 0
    body = declared(capsys.readouterr().out)
    assert body["missing"] == {}
    names = [trace_name("corr-1", scenario, SUTS[0], 0) for scenario in (SHUT, OPEN)]
    assert body["files"] == [str(Path("out") / name) for name in names]
    for number, name in enumerate(names):
        path = here / "out" / name
        assert path.read_bytes() == StatePaths(far.state).trace(name).read_bytes()
        before = path.stat().st_mtime_ns
        assert invoke(["export", f"corr-1.{number}", "traces", "-o", "out"]) == 0
        assert path.stat().st_mtime_ns == before
        assert capsys.readouterr().out == f"{Path('out') / name}\n"


def test_traces_of_this_machine_are_copied_without_a_daemon(far, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    assert invoke(["export", "corr-1.0", "traces", "--state", str(far.state)]) == 0
    name = trace_name("corr-1", SHUT, SUTS[0], 0)
    assert (tmp_path / name).read_bytes() == StatePaths(far.state).trace(name).read_bytes()


def test_commands_about_recorded_runs_bring_their_traces(here, capsys):
    assert invoke(["plot", "corr-1.1", "speed", "--json"]) == 0
    body = declared(capsys.readouterr().out)
    assert [body["trace"]] == [str(path) for path in cached(here)]
    assert invoke(["replay", "corr.1", "--frame", "1"]) == 0
    invoke(["judge", "corr", "-j", "1", "--json"])
    out = capsys.readouterr().out
    assert len(json.loads(out[out.index('{\n  "schema"') :])["traces"]) == 2
    assert len(cached(here)) == 2
    assert invoke(["report", "corr", "--table", "m.csv", "-j", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["runs"] == 3
    assert invoke(["export", "corr-1.0", "picture", "-o", "run.svg"]) == 0
    assert invoke(["coverage", "corr-1", "-j", "1", "--json"]) == 0


def test_where_one_run_is_wanted_a_campaign_is_refused_before_it_is_brought(here, capsys):
    assert invoke(["plot", "corr", "speed"]) == 2
    said = " ".join(capsys.readouterr().err.replace("│", " ").split())
    assert "corr has 2 traces (corr-1.0, corr-1.1): name one of them" in said
    assert not cached(here)


def test_traces_in_a_store_are_read_without_a_daemon(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    campaign_at(StatePaths(tmp_path / "state"), (tmp_path / "store").as_uri())
    assert invoke(["plot", "corr.1", "speed"]) == 0
    assert len(cached(tmp_path)) == 1
    assert invoke(["report", "corr", "--table", "m.csv", "-j", "1", "--json"]) == 0
    assert len(cached(tmp_path)) == 2
    assert len(Path("m.csv").read_text().splitlines()) > 2
    first, second = sorted((tmp_path / "store").rglob("*.mcap"))
    for trace in (second, *cached(tmp_path)):
        trace.unlink()
    capsys.readouterr()
    invoke(["judge", "corr", "--json"])
    said = capsys.readouterr()
    assert len(declared(said.out)["traces"]) == 1, "one that is gone does not keep the other"
    assert f"{second.name} cannot be used from here" in said.err
    for trace in (first, *cached(tmp_path)):
        trace.unlink()
    assert invoke(["plot", "corr-1.1", "speed"]) == 3
    assert "cannot be used from here: No such file or directory" in capsys.readouterr().err
