"""``judge``, ``plot`` and ``coverage``: what people and scripts are told about old traces."""

from pathlib import Path

import numpy as np
import pytest

from daemon.judging.signals import RunSignal
from daemon.trace import read_trace
from scenario_tui.cli import invoke
from scenario_tui.dashboard.signal_graphs import draw_signals
from tests.analysis.old_runs import drive, spec
from tests.people.cli.outputs import declared
from tests.people.recorded import record_run


@pytest.fixture(autouse=True)
def _state(tmp_path, monkeypatch):
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))


@pytest.fixture
def traces(tmp_path):
    """Two runs, the second one faster."""
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
    invoke(["judge", str(traces), "-o", layer(traces.parent, "slow: max(speed) <= 0.55 m/s\n")])
    out = capsys.readouterr().out.replace("\n", "")
    assert "again.mcap" in out


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    return str(record_run(tmp_path_factory.mktemp("traces") / "run.mcap"))


def test_machines_get_every_sample(driven, capsys):
    assert invoke(["plot", driven, "loc.error", "contact", "door-1.angle", "--json"]) == 0
    body = declared(capsys.readouterr().out)
    assert body["schema"] == "scenario/plot/1"
    error, contact, door = body["signals"]
    assert (error["unit"], contact["unit"], door["unit"]) == ("m", "bool", "rad")
    assert len(error["time"]) == len(error["value"]) == 201
    assert sum(contact["value"]) == 1.0
    assert door["value"][-1] == pytest.approx(-1.0)


@pytest.mark.parametrize("values", [[0.0], [3.0, 3.0], [-1e9, 1e9], [1e-9, 2e-9], [np.nan]])
def test_any_signal_can_be_drawn(driven, values):
    read = read_trace(Path(driven))
    value = np.array(values)
    signal = RunSignal("x", "1", np.arange(float(len(values))), value, value)
    drawn = [line.plain for line in draw_signals(read, [signal], 40, 6, marks=(0.0,))]
    assert max(map(len, drawn)) <= 40
    assert len(drawn) == 6


def test_before_running_a_campaign_file_is_enough(campaigns, capsys):
    assert invoke(["coverage", str(campaigns / "demo" / "campaign.yaml")]) == 0
    out = capsys.readouterr().out
    assert out.startswith("15 runs, as planned")
    assert "hinged 15, sliding 15" in out
    assert "driven on" not in out
