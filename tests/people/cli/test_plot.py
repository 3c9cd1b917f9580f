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


def test_graphs_fit_the_terminal_and_say_what_failed(trace, capsys):
    assert invoke(["plot", trace, "speed.angular", "path.length"]) == 0
    out = capsys.readouterr().out
    assert "\x1b" not in out
    lines = out.splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert "speed.angular  0 to 0.9 rad/s, at the end 0 rad/s" in lines
    assert "path.length  0 to 5 m, at the end 5 m" in lines
    assert "✗ fail  no-contact at 6.0 s" in lines


def test_machines_get_every_sample(trace, capsys):
    assert invoke(["plot", trace, "loc.error", "contact", "door-1.angle", "--json"]) == 0
    body = declared(capsys.readouterr().out)
    assert body["schema"] == "scenario/plot/1"
    error, contact, door = body["signals"]
    assert (error["unit"], contact["unit"], door["unit"]) == ("m", "bool", "rad")
    assert len(error["time"]) == len(error["value"]) == 201
    assert sum(contact["value"]) == 1.0
    assert door["value"][-1] == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        ("loc.eror", "loc.error"),
        ("door-9.angle", "door-1.angle"),
        ("speed * 2", "is no signal"),
        ("speed) (", "signal speed) ("),
    ],
)
def test_what_is_no_signal_is_explained(trace, capsys, signal, words):
    assert invoke(["plot", trace, signal]) == 2
    assert words in capsys.readouterr().err


def test_limits_and_the_mission_are_drawn_with_the_signals(trace, capsys):
    assert invoke(["plot", trace, "speed.angular", "contact"]) == 0
    out = capsys.readouterr().out
    for words in ("≤ 0.5 rad/s", "0.5┤", "1 w1─◇", "contact no", "┴5 s"):
        assert words in out
    assert sum("│" in line for line in out.splitlines()) > 6  # where oracles were decided against


@pytest.mark.parametrize("values", [[0.0], [3.0, 3.0], [-1e9, 1e9], [1e-9, 2e-9], [np.nan]])
def test_any_signal_can_be_drawn(trace, values):
    read = read_trace(Path(trace))
    value = np.array(values)
    signal = RunSignal("x", "1", np.arange(float(len(values))), value, value)
    drawn = [line.plain for line in draw_signals(read, [signal], 40, 6, marks=(0.0,))]
    assert max(map(len, drawn)) <= 40
    assert len(drawn) == 6
