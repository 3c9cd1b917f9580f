"""Signals of a run along time: which ones, where they spoke against an oracle, how drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daemon.judging.oracles import SignalSampler, oracle_timeline
from daemon.judging.run_signals import DOOR_CLEARANCE
from daemon.model.spec import OracleText
from scenario_tui.dashboard.playback import Playback, open_playback
from scenario_tui.dashboard.signal_strips import SignalStrip
from scenario_tui.dashboard.widgets.cell_view import Canvas, changed_spans
from scenario_tui.dashboard.widgets.timeline import TimelineView, at_cursor, fit_heights, ranges
from tests.scenario_tui.recorded import TURNED, record_run


@pytest.fixture(scope="module")
def playback(tmp_path_factory: pytest.TempPathFactory) -> Playback:
    return open_playback(record_run(tmp_path_factory.mktemp("traces") / "run.mcap"))


def drawn(playback: Playback, columns: int = 80, rows: int = 24, time: float = 2.0) -> list[str]:
    view = TimelineView()
    view._timelines, view._time = (playback.timeline,), time
    cells = view.cells(columns, rows)
    assert cells is not None
    assert cells[0].shape == (rows, columns)
    return ["".join(map(chr, row)).rstrip() for row in cells[0]]


def test_the_usual_signals_come_first_then_those_oracles_read(playback: Playback) -> None:
    names = [strip.name for strip in playback.timeline.strips]
    assert names == ["loc.error", "clearance", DOOR_CLEARANCE, "speed", "speed.angular", "contact"]
    signals = {strip.name: strip for strip in playback.timeline.strips}
    assert signals["speed"].limits == (0.6,)
    assert signals["speed"].against == ()
    assert signals["speed.angular"].against == (
        (pytest.approx(TURNED), pytest.approx(TURNED + 0.05)),
    )
    assert signals["loc.error"].at(2.0) == pytest.approx(0.2)
    assert signals["contact"].unit == "bool"


@pytest.mark.parametrize(
    ("oracle", "against", "limits"),
    [
        ("always(speed.angular <= 0.5 rad/s)", 1, [("speed.angular", 0.5)]),
        ("never(speed.angular > 0.5 rad/s or contact)", 2, [("speed.angular", 0.5)]),
        ("max(speed.angular) <= 0.5 rad/s", 1, [("speed.angular", 0.5)]),
        ("fraction(speed.angular <= 0.5 rad/s) >= 50 %", 1, [("speed.angular", 0.5)]),
        ("count(contact) <= 0", 1, []),
        ("always(loc.error.yaw >= -0.1 rad)", 0, [("loc.error.yaw", -0.1)]),
        ("eventually(contact)", 0, []),
        ("reached(mission, 0.3 m)", 0, []),
        ("min(clearance)", 0, []),
        ("this is no oracle", 0, []),
    ],
)
def test_a_course_says_when_the_run_spoke_against_an_oracle(
    playback: Playback, oracle: str, against: int, limits: list[tuple[str, float]]
) -> None:
    course = oracle_timeline(OracleText("it", oracle), SignalSampler(playback.trace))
    assert len(course.against) == against
    assert list(course.limits) == limits


def test_until_counts_before_its_release_only(playback: Playback) -> None:
    sampler = SignalSampler(playback.trace)
    before, after = (
        oracle_timeline(
            OracleText("it", f"always(elapsed < 3 s) until (elapsed >= {t} s)"), sampler
        )
        for t in (5, 2)
    )
    assert before.against == ((pytest.approx(3.0), pytest.approx(5.0)),)
    assert after.against == ()


def test_a_spike_of_one_sample_is_seen_however_long_the_run() -> None:
    values = np.zeros(100_000)
    values[77_777] = 5.0
    strip = SignalStrip("it", "m", np.linspace(0.0, 1.0, 100_000), values)
    _, high = ranges(strip, 0.0, 1.0, 60)
    assert (high.max(), np.count_nonzero(high == 5.0)) == (5.0, 1)


def test_the_timeline_shows_values_limits_violations_doors_and_verdicts(playback: Playback) -> None:
    lines = drawn(playback, time=TURNED)
    text = "\n".join(lines)
    assert "speed.angular" in text
    assert "0.9 rad/s" in text
    assert "limit 0.5 rad/s" in text
    assert "░" in text
    assert lines[-3].startswith("doors")
    assert "o" in lines[-3][20:]
    assert lines[-2].startswith("mission")
    assert "◇2" in lines[-2]
    assert lines[-1].count("✗") == 2
    assert sum("│" in line for line in lines) > 10


@pytest.mark.parametrize("size", [(12, 2), (20, 5), (40, 10), (300, 80)])
def test_the_timeline_fits_into_any_room(playback: Playback, size: tuple[int, int]) -> None:
    drawn(playback, *size)


def test_what_does_not_fit_is_counted(playback: Playback) -> None:
    assert any("> 4 more" in line for line in drawn(playback, 80, 8))
    few = [replace(playback.timeline.strips[0])] * 3
    assert fit_heights(few, 7) == [3, 2, 2]
    assert fit_heights(few, 3) == [3]


def test_values_at_the_cursor_are_those_of_the_last_sample() -> None:
    strip = SignalStrip("it", "bool", np.array([1.0, 2.0]), np.array([1.0, 0.0]))
    assert [at_cursor(strip, t) for t in (0.5, 1.0, 1.9, 9.0)] == ["–", "yes", "yes", "no"]


def test_only_changed_parts_of_rows_are_drawn_again() -> None:
    before = np.stack(Canvas(40, 5, 1).cells())
    after = before.copy()
    after[0, 2, [3, 5, 30]] = ord("x")
    after[1, 4, 39] = 0
    found = [(r.x, r.y, r.width) for r in changed_spans(before, after)]
    assert found == [(3, 2, 3), (30, 2, 1), (39, 4, 1)]
    assert changed_spans(before, before) == []
