"""``scenario plot``: signals of a recorded run, for people and for machines."""

from pathlib import Path

import numpy as np
import pytest

from daemon.judging.signals import RunSignal
from daemon.trace import read_trace
from scenario_tui.cli import invoke
from scenario_tui.dashboard.signal_graphs import draw_signals
from tests.people.cli.outputs import declared
from tests.people.recorded import record_run


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    return str(record_run(tmp_path_factory.mktemp("traces") / "run.mcap"))


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("LINES", "24")


def test_machines_get_every_sample(trace, capsys):
    assert invoke(["plot", trace, "loc.error", "contact", "door-1.angle", "--json"]) == 0
    body = declared(capsys.readouterr().out)
    assert body["schema"] == "scenario/plot/1"
    error, contact, door = body["signals"]
    assert (error["unit"], contact["unit"], door["unit"]) == ("m", "bool", "rad")
    assert len(error["time"]) == len(error["value"]) == 201
    assert sum(contact["value"]) == 1.0
    assert door["value"][-1] == pytest.approx(-1.0)


@pytest.mark.parametrize("values", [[0.0], [3.0, 3.0], [-1e9, 1e9], [1e-9, 2e-9], [np.nan]])
def test_any_signal_can_be_drawn(trace, values):
    read = read_trace(Path(trace))
    value = np.array(values)
    signal = RunSignal("x", "1", np.arange(float(len(values))), value, value)
    drawn = [line.plain for line in draw_signals(read, [signal], 40, 6, marks=(0.0,))]
    assert max(map(len, drawn)) <= 40
    assert len(drawn) == 6
