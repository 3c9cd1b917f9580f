"""``scenario verify``: what people and scripts are told about executions of a recorded run."""

from daemon.model.spec import SutReference
from daemon.stacks import registry
from scenario_tui.cli import invoke
from tests.analysis.old_runs import EXTERNAL, IDLE, erratic, recorded
from tests.people.cli.outputs import declared
from tests.people.cli.parts.test_run_limits import campaign, plugged

__all__ = ["erratic", "plugged"]


def test_the_same_bytes_are_what_is_expected(tmp_path, capsys):
    path, run = recorded(tmp_path, sut=IDLE)
    assert invoke(["verify", str(path), "--repeats", "2"]) == 0
    assert capsys.readouterr().out == f"{run.label}: 2 of 2 executions have the same bytes\n"


def test_other_bytes_are_a_finding(tmp_path, capsys):
    path, run = recorded(tmp_path, sut=IDLE)
    data = path.read_bytes()
    path.write_bytes(data.replace(b"scenario", b"Scenario", 1))
    assert invoke(["verify", str(path)]) == 1
    out = capsys.readouterr().out
    assert f"{run.label}: 0 of 2 executions have the same bytes; they differ " in out
    assert "the executions agree with each other: the recording comes from other code" in out
    assert "path driven" in out


def test_the_spread_of_an_external_system_is_told(tmp_path, capsys, erratic):
    path, run = recorded(tmp_path, sut=EXTERNAL)
    assert invoke(["verify", str(path), "-n", "2"]) == 0
    out = capsys.readouterr().out
    assert f"{run.label}: theirs is not repeatable; 2 more executions" in out
    assert "including the recording: " in out
    assert {"duration", "path driven", "far"} <= {line.split("  ")[0] for line in out.splitlines()}


def test_a_system_that_is_not_here_is_infrastructure(tmp_path, capsys, erratic, monkeypatch):
    path, _ = recorded(tmp_path, sut=EXTERNAL)
    monkeypatch.setattr(registry, "installed", lambda group: {})
    assert invoke(["verify", str(path), "-n", "1"]) == 3
    assert 'execution 1: SutMissing: no system under test of kind "erratic"' in (
        capsys.readouterr().out
    )


def test_campaign_files_are_verified_whole(tmp_path, campaigns, capsys, plugged):
    file = campaign(tmp_path, campaigns, "seeded", "random")
    assert invoke(["verify", str(file)]) == 1
    out = capsys.readouterr().out
    assert "house/seeded/0: 2 of 2 executions have the same bytes\n" in out
    assert "house/random/0: random is not deterministic, executions differ on /cmd_vel at " in out
    assert "must come from briefing.seed" in " ".join(out.split())
    assert invoke(["verify", str(campaign(tmp_path, campaigns, "seeded")), "-n", "1"]) == 4
    said = "house/seeded/0: executed once, so nothing to compare; use --repeats 2 or more\n"
    assert capsys.readouterr().out == said


def test_folders_are_verified_whole(tmp_path, capsys):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        recorded(tmp_path / name, sut=SutReference(name, "idle", {}))
    assert invoke(["verify", str(tmp_path), "-n", "1", "--json"]) == 0
    runs = declared(capsys.readouterr().out)["runs"]
    assert [(run["sut"], run["same_bytes"]) for run in runs] == [("one", 1), ("two", 1)]
