"""Signals of a run along time: which ones, where they spoke against an oracle, how drawn."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.judging.oracles import DOOR_CLEARANCE, SignalSampler, oracle_timeline
from daemon.model.live_judgement import DoorMotion
from daemon.model.spec import OracleText
from scenario_tui.dashboard.playback import open_playback
from scenario_tui.dashboard.signal_strips import RunTimeline, SignalStrip
from scenario_tui.dashboard.widgets.cell_view import Canvas, changed_spans
from scenario_tui.dashboard.widgets.timeline import TimelineView, at_cursor
from scenario_tui.dashboard.widgets.timeline_drawing import TimelineDrawing, fit_heights, ranges
from tests.scenario_tui.recorded import TURNED, record_run


@pytest.fixture(scope="module")
def playback(tmp_path_factory):
    return open_playback(record_run(tmp_path_factory.mktemp("traces") / "run.mcap"))


def drawn(playback, columns=80, rows=24, time=2.0):
    return drawn_of(playback.timeline, columns, rows, time)


def drawn_of(timeline, columns=80, rows=24, time=2.0):
    view = TimelineView()
    view._timelines, view._time = (timeline,), time
    cells = view.cells(columns, rows)
    assert cells is not None
    assert cells[0].shape == (rows, columns)
    return ["".join(map(chr, row)).rstrip() for row in cells[0]]


def test_the_usual_signals_come_first_then_those_oracles_read(playback):
    names = [strip.name for strip in playback.timeline.strips]
    assert names == ["loc.error", "clearance", DOOR_CLEARANCE, "speed", "speed.angular", "contact"]
    signals = {strip.name: strip for strip in playback.timeline.strips}
    assert signals["speed"].limits == (0.6,)
    assert signals["speed"].against == ()
    assert signals["speed.angular"].against == (
        (pytest.approx(TURNED), pytest.approx(TURNED + 0.05)),
    )
    assert signals["loc.error"].between(2.0) == pytest.approx((0.2, 0.2))
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
def test_a_course_says_when_the_run_spoke_against_an_oracle(playback, oracle, against, limits):
    course = oracle_timeline(OracleText("it", oracle), SignalSampler(playback.trace))
    assert len(course.against) == against
    assert list(course.limits) == limits


def test_until_counts_before_its_release_only(playback):
    sampler = SignalSampler(playback.trace)
    before, after = (
        oracle_timeline(
            OracleText("it", f"always(elapsed < 3 s) until (elapsed >= {t} s)"), sampler
        )
        for t in (5, 2)
    )
    assert before.against == ((pytest.approx(3.0), pytest.approx(5.0)),)
    assert after.against == ()


def test_a_spike_of_one_sample_is_seen_however_long_the_run():
    values = np.zeros(100_000)
    values[77_777] = 5.0
    strip = SignalStrip("it", "m", np.linspace(0.0, 1.0, 100_000), values)
    _, high = ranges(strip, 0.0, 1.0, 60)
    assert (high.max(), np.count_nonzero(high == 5.0)) == (5.0, 1)


def test_the_timeline_shows_values_limits_violations_doors_and_verdicts(playback):
    lines = drawn(playback, time=TURNED)
    text = "\n".join(lines)
    assert "speed.angular" in text
    assert "0.9 rad/s" in text
    assert "limit 0.5 rad/s" in text
    assert "░" in text
    assert lines[-3].startswith("door-1 ")
    assert "·━━━" in lines[-3]
    assert lines[-2].startswith("mission")
    assert "─1 w1─◇─" in lines[-2]
    assert lines[-2].endswith("2 w2")
    assert lines[-1].count("✗") == 2
    assert sum("│" in line for line in lines) > 10


@pytest.mark.parametrize("size", [(12, 2), (20, 5), (40, 10), (300, 80)])
def test_the_timeline_fits_into_any_room(playback, size):
    drawn(playback, *size)


def test_rows_fill_the_room_there_is(playback):
    strips = playback.timeline.strips
    assert sum(fit_heights(strips, 60)) == 60
    assert fit_heights(strips[:1], 30) == [30]


def test_limits_are_marked_and_what_lies_beyond_them_is_hatched(playback):
    lines = drawn(playback, 90, 30, time=2.0)
    at = next(i for i, line in enumerate(lines) if line.startswith("speed.angular"))
    limit = next(i for i, line in enumerate(lines[at:]) if "0.5┤" in line)
    beyond = lines[at : at + limit]
    assert all(line.count("╱") > 40 for line in beyond)
    assert not any("╱" in line for line in lines[at + limit + 1 : at + limit + 3])
    assert "limit 0.5 rad/s" in lines[at + 2]


def test_a_limit_far_away_is_named_at_the_edge(playback):
    strip = playback.timeline.strips[1]
    assert strip.name == "clearance"
    far = replace(strip, limits=(20.0,), sides=(1,))
    lines = drawn_of(replace(playback.timeline, strips=(far,)))
    assert "↑20┤" in lines[0]
    assert not any("╱" in line for line in lines)


def test_what_only_counts_is_left_out_unless_it_is_asked_for(playback):
    clock = replace(playback.timeline.strips[0], name="elapsed", readers=("in-time",))
    view = TimelineView()
    view._timelines = (replace(playback.timeline, strips=(*playback.timeline.strips, clock)),)
    assert "elapsed" not in [strip.name for strip in view.signals]
    view._oracle = "in-time"
    assert view.signals[0].name == "elapsed"
    view._oracle, view._ramps = "", True
    assert "elapsed" in [strip.name for strip in view.signals]


def test_signals_that_oracles_read_come_first(playback):
    view = TimelineView()
    view._timelines = (playback.timeline,)
    read = [bool(strip.readers) for strip in view.signals]
    assert read == sorted(read, reverse=True)


def test_every_door_that_moved_has_a_lane_until_they_have_to_share_one(playback):
    moves = tuple(DoorMotion(float(i), f"door-{i}.hinge", opens=True) for i in range(5))
    shut = DoorMotion(6.0, "door-0.hinge", opens=False)
    timeline = replace(playback.timeline, doors=(*moves, shut))
    lines = drawn_of(timeline, 90, 36)
    assert [line.split()[0] for line in lines[-7:-2]] == [f"door-{i}" for i in range(5)]
    assert lines[-7].partition(" ")[2].strip().strip("━") != ""  # shut again before the end
    few = drawn_of(timeline, 90, 15)
    assert few[-4].startswith("door-0 ")
    assert few[-3].startswith("4 more doors")


def test_a_door_that_closes_first_was_open_before(playback):
    timeline = replace(playback.timeline, doors=(DoorMotion(5.0, "door-1.hinge", opens=False),))
    lane = next(line for line in drawn_of(timeline) if line.startswith("door-1"))
    assert lane.split()[1].startswith("━━")
    assert lane.rstrip().endswith("··")


def test_a_thinned_signal_says_what_it_knows_of_a_moment():
    time = np.array([0.0, 1.0])
    strip = SignalStrip("it", "m", time, np.array([0.1, 0.2]), most=np.array([0.3, 0.2]))
    assert [at_cursor(strip, t) for t in (0.5, 1.5)] == ["0.1–0.3 m", "0.2 m"]
    low, high = ranges(strip, 0.0, 2.0, 2)
    assert (low[0], high[0]) == (0.1, 0.3)


def test_an_end_of_a_range_has_no_more_digits_than_the_other():
    time = np.array([0.0, 1.0, 2.0])
    least, most = np.array([0.0000986, 0.03, -0.00276]), np.array([0.0063, 1.9, 1.19])
    strip = SignalStrip("it", "m", time, least, most=most)
    shown = [at_cursor(strip, t) for t in (0.5, 1.5, 2.5)]
    assert shown == ["0.0001–0.0063 m", "0.03–1.9 m", "0–1.2 m"]


def test_of_two_runs_the_doors_of_both_are_drawn(playback):
    opens, shuts = (DoorMotion(at, "door-0.hinge", opens=at < 5.0) for at in (2.0, 8.0))
    first = replace(playback.timeline, doors=(opens, shuts))
    second = replace(first, doors=(opens, DoorMotion(4.0, "door-1.hinge", opens=True)))
    drawing = TimelineDrawing((first, second), (), 90, 20)
    lines = ["".join(map(chr, row)) for row in drawing.codes]
    lanes = {line[:24].strip(): line[24:] for line in lines if "door-" in line}
    assert list(lanes) == ["door-0", "┊ door-0", "door-1", "┊ door-1"]
    assert lanes["┊ door-0"].count("━") > lanes["door-0"].count("━") > 0
    assert "does not move" in lanes["door-1"]
    assert "━" in lanes["┊ door-1"]


def test_doors_of_which_none_moves_are_not_drawn_as_shut(playback):
    lane = next(
        line for line in drawn_of(replace(playback.timeline, doors=())) if line.startswith("doors")
    )
    assert "none moves" in lane


def test_what_does_not_fit_is_counted(playback):
    assert any("> 3 more" in line for line in drawn(playback, 80, 8))
    few = [replace(playback.timeline.strips[0])] * 3
    assert fit_heights(few, 7) == [3, 2, 2]
    assert fit_heights(few, 3) == [3]


def test_values_at_the_cursor_are_those_of_the_last_sample():
    strip = SignalStrip("it", "bool", np.array([1.0, 2.0]), np.array([1.0, 0.0]))
    assert [at_cursor(strip, t) for t in (0.5, 1.0, 1.9, 9.0)] == ["–", "yes", "yes", "no"]


def test_only_changed_parts_of_rows_are_drawn_again():
    before = np.stack(Canvas(40, 5, 1).cells())
    after = before.copy()
    after[0, 2, [3, 5, 30]] = ord("x")
    after[1, 4, 39] = 0
    found = [(r.x, r.y, r.width) for r in changed_spans(before, after)]
    assert found == [(3, 2, 3), (30, 2, 1), (39, 4, 1)]
    assert changed_spans(before, before) == []


def test_a_long_name_is_written_on_two_lines_cut_between_its_words():
    time = np.array([0.0, 10.0])
    strip = SignalStrip("clearance(0.35 m, 0.20 m)", "m", time, time)
    timeline = RunTimeline(0.0, 10.0, (strip,), None, (), 0, ())
    lines = drawn_of(timeline, 72, 8)
    assert lines[0].startswith("clearance(0.35 m, ")
    assert lines[1].startswith("0.20 m) ")


def test_the_names_of_common_signals_are_whole_beside_the_map_of_a_terminal_of_120():
    time = np.array([0.0, 10.0])
    names = ("clearance(doors)", "clearance(0.55 m)", "mission.distance")
    strips = tuple(SignalStrip(name, "m", time, time) for name in names)
    lines = drawn_of(RunTimeline(0.0, 10.0, strips, None, (), 0, ()), 72, 14)
    assert [name for name in names if any(line.startswith(f"{name} ") for line in lines)] == [
        *names
    ]
