"""``scenario plot``: signals of a recorded run, for people and for machines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenario_tui.cli import invoke
from scenario_tui.text.signal_plot import Curve, draw_curve, envelope
from tests.scenario_tui.cli.outputs import declared
from tests.scenario_tui.recorded import record_run


@pytest.fixture(scope="module")
def trace(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(record_run(tmp_path_factory.mktemp("traces") / "run.mcap"))


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("LINES", "24")


def test_graphs_fit_the_terminal_and_say_what_failed(
    trace: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert invoke(["plot", trace, "speed.angular", "path.length"]) == 0
    out = capsys.readouterr().out
    assert "\x1b" not in out
    lines = out.splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert "speed.angular  0 to 0.9 rad/s, at the end 0 rad/s" in lines
    assert "path.length  0 to 5 m, at the end 5 m" in lines
    assert "✗ fail  no-contact at 6.0 s" in lines


def test_machines_get_every_sample(trace: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert invoke(["plot", trace, "loc.error", "contact", "door-1.angle", "--json"]) == 0
    body = declared(capsys.readouterr().out)
    assert body["schema"] == "scenario/plot/1"
    error, contact, door = body["signals"]
    assert (error["unit"], contact["unit"], door["unit"]) == ("m", "bool", "rad")
    assert len(error["time"]) == len(error["values"]) == 201
    assert sum(contact["values"]) == 1.0
    assert door["values"][-1] == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        ("loc.eror", "loc.error"),
        ("door-9.angle", "door-1.angle"),
        ("speed * 2", "is no signal"),
        ("speed) (", "signal speed) ("),
    ],
)
def test_what_is_no_signal_is_explained(
    trace: str, capsys: pytest.CaptureFixture[str], signal: str, words: str
) -> None:
    assert invoke(["plot", trace, signal]) == 2
    assert words in capsys.readouterr().err


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=300), st.integers(1, 20))
def test_the_least_and_the_greatest_are_never_left_out(values: list[float], columns: int) -> None:
    curve = Curve("x", "m", np.arange(float(len(values))), np.array(values))
    time, kept = envelope(curve, columns)
    assert (kept.min(), kept.max()) == (min(values), max(values))
    assert len(kept) <= 2 * columns
    assert np.all(np.diff(time) > 0)


def test_what_is_not_known_is_left_out() -> None:
    curve = Curve("x", "m", np.arange(4.0), np.array([np.nan, 1.0, np.nan, 2.0]))
    time, kept = envelope(curve, 10)
    assert (time.tolist(), kept.tolist()) == ([1.0, 3.0], [1.0, 2.0])


@pytest.mark.parametrize("values", [[0.0], [3.0, 3.0], [-1e9, 1e9], [1e-9, 2e-9]])
def test_any_curve_can_be_drawn(values: list[float]) -> None:
    curve = Curve("x", "1", np.arange(float(len(values))), np.array(values))
    drawn = draw_curve(curve, 40, 6, colour=False, marks=(0.0,)).splitlines()
    assert max(map(len, drawn)) <= 40
    assert "\x1b" not in "".join(drawn)
