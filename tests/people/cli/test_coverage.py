"""``scenario coverage``: what people and scripts are told."""

from scenario_tui.cli import invoke
from tests.analysis.old_runs import drive, spec
from tests.people.cli.outputs import declared


def test_before_running_a_campaign_file_is_enough(campaigns, capsys):
    assert invoke(["coverage", str(campaigns / "demo" / "campaign.yaml")]) == 0
    out = capsys.readouterr().out
    assert out.startswith("15 runs, as planned")
    assert "hinged 15, sliding 15" in out
    assert "driven on" not in out


def test_afterwards_traces_tell(tmp_path, capsys):
    drive(tmp_path / "a.mcap", spec(0))
    drive(tmp_path / "b.mcap", spec(1))
    assert invoke(["coverage", str(tmp_path), "--json"]) == 0
    body = declared(capsys.readouterr().out)
    assert body["schema"] == "scenario/coverage/1"
    assert body["recorded"] == 2
    assert [door["door"] for door in body["doors"]] == ["door-0"]
    assert invoke(["coverage", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "2 runs, by their traces" in out
    assert "door-0" in out


def test_a_damaged_trace_is_told_and_makes_it_fail(tmp_path, capsys):
    drive(tmp_path / "a.mcap", spec(0))
    (tmp_path / "b.mcap").write_bytes(b"junk")
    assert invoke(["coverage", str(tmp_path)]) == 3
    assert "b.mcap: error:" in capsys.readouterr().err
