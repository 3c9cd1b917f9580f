"""``judge``, ``plot`` and ``coverage``: what people and scripts are told about old traces."""

from pathlib import Path

import numpy as np
import pytest

from daemon.judging.signals import RunSignal
from daemon.trace import read_trace
from scenario_tui.cli import invoke
from scenario_tui.dashboard.widgets.timeline import draw_signals
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


LAYERS = {
    "slower": "slow: max(speed) <= 0.52 m/s\nfar: final(path.length)\n",
    "fine": "a: max(speed) <= 1 m/s\n",
    "strict": "a: max(speed) <= 0.1 m/s\n",
    "typed": "a: max(sped) <= 1 m/s\n",
    "elsewhere": "a: never(contact(door-9))\n",
    "never": "a: never(contact) when speed > 9 m/s\n",
    "measure": "a: max(speed)\n",
}


def test_traces_are_judged_again(traces, transcript, monkeypatch):
    monkeypatch.chdir(traces.parent)
    # Two runs of one name, of which one cannot be read, and one is told apart by its file.
    for name, text in LAYERS.items():
        Path(f"{name}.oracles.yaml").write_text(text)
    drive(Path("more/again.mcap"), spec(0, seed=9), speed=0.55)
    drive(Path("more/a.mcap"), spec(0))
    Path("more/c.mcap").write_bytes(b"")
    transcript("judge")


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
