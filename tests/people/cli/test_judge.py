"""``scenario judge``: what people and scripts are told about old traces."""

import pytest

from daemon.model.spec import OracleText
from scenario_tui.cli import invoke
from tests.analysis.old_runs import drive, spec
from tests.people.cli.outputs import declared


@pytest.fixture
def traces(tmp_path, monkeypatch):
    """Two runs, the second one faster."""
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    folder = tmp_path / "traces"
    drive(folder / "a.mcap", spec(0))
    drive(folder / "b.mcap", spec(1), speed=0.55)
    return folder


def layer(folder, text):
    path = folder / "new.oracles.yaml"
    path.write_text(text)
    return str(path)


def told(capsys, *arguments):
    invoke(["judge", *arguments, "--json"])
    return declared(capsys.readouterr().out)


def test_verdicts_that_changed_are_listed_with_their_reason(traces, capsys):
    oracles = layer(traces.parent, "slow: max(speed) <= 0.52 m/s\nfar: final(path.length)\n")
    assert invoke(["judge", str(traces), "--oracles", oracles]) == 1
    out = capsys.readouterr().out
    (line,) = [line for line in out.splitlines() if "→" in line]
    assert line.startswith("✓ pass → ✗ fail  S1/pilot/1  slow: −0.03 m/s at 0.0 s")
    assert "1 m to 1.1 m" in out
    assert "2 traces judged, 1 as before" in out


def test_scripts_get_everything(traces, capsys):
    oracles = layer(traces.parent, "slow: max(speed) <= 0.52 m/s\n")
    body = told(capsys, str(traces), "-o", oracles)
    assert body["schema"] == "scenario/judge/1"
    first, second = body["traces"]
    assert (first["outcome_before"], first["outcome"]) == ("pass", "pass")
    assert second["verdicts"][0]["evidence"]["value"] == 0.55
    assert second["changes"][0] == {
        "oracle": "slow",
        "kind": "verdict",
        "before": second["before"][0],
        "now": second["verdicts"][0],
    }
    assert second["before"][0]["lower"] == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("a: max(speed) <= 1 m/s", 0),
        ("a: max(speed) <= 0.1 m/s", 1),
        ("a: max(sped) <= 1 m/s", 2),
        ("a: never(contact(door-9))", 3),
        ("a: never(contact) when speed > 9 m/s", 4),
        ("a: max(speed)", 4),
    ],
)
def test_the_exit_code_says_how_it_ended(traces, text, code):
    assert invoke(["judge", str(traces), "-o", layer(traces.parent, text)]) == code


def test_what_cannot_be_used_is_said_and_the_rest_is_judged(traces, capsys):
    (traces / "c.mcap").write_bytes(b"")
    assert invoke(["judge", str(traces)]) == 3
    out = capsys.readouterr().out.replace("\n", "")
    assert f"{traces / 'c.mcap'}: error: is empty" in out
    assert "2 traces judged, 2 as before" in out
    assert "1 not readable" in out


def test_runs_of_one_name_are_told_apart_by_their_files(traces, capsys):
    drive(traces / "again.mcap", spec(0, seed=9), speed=0.7)
    oracles = (OracleText("slow", "max(speed) <= 0.6 m/s"),)
    text = "".join(f"{o.name}: max(speed) <= 0.55 m/s\n" for o in oracles)
    invoke(["judge", str(traces), "-o", layer(traces.parent, text)])
    out = capsys.readouterr().out.replace("\n", "")
    assert "again.mcap" in out
