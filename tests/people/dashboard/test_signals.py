"""Signals of a run along time: which ones, where they spoke against an oracle, how drawn."""

import re
from dataclasses import replace

import numpy as np
import pytest
from textual import events

from daemon.judging.signals import RunSignal
from daemon.model.live_judgement import DoorMotion, SignalLimit
from scenario_tui.dashboard.playback import open_playback
from scenario_tui.dashboard.run_timeline import RunTimeline
from scenario_tui.dashboard.widgets.cell_view import Canvas, changed_spans
from scenario_tui.dashboard.widgets.timeline import ZOOM, TimelineView, at_playhead, draw_frame
from scenario_tui.dashboard.widgets.timeline_drawing import (
    CURSOR,
    TimelineDrawing,
    ranges,
)
from scenario_tui.terminal.limited_terminal import LimitedTerminalApp
from tests.people.recorded import TURNED, record_run


@pytest.fixture(scope="module")
def playback(tmp_path_factory):
    return open_playback(record_run(tmp_path_factory.mktemp("traces") / "run.mcap"))


def drawn_of(timeline, columns=80, rows=24, time=2.0):
    view = TimelineView()
    view.show((timeline,))
    view.move(time)
    codes, _ = view.cells(columns, rows)
    assert codes.shape == (rows, columns)
    return ["".join(map(chr, row)).rstrip() for row in codes]


def test_a_spike_of_one_sample_is_seen_however_long_the_run():
    values = np.zeros(100_000)
    values[77_777] = 5.0
    signal = RunSignal("it", "m", np.linspace(0.0, 1.0, 100_000), values, values)
    _, high = ranges(signal, 0.0, 1.0, 60)
    assert (high.max(), np.count_nonzero(high == 5.0)) == (5.0, 1)
    time = np.array([0.0, 1.0])
    thinned = RunSignal("it", "m", time, np.array([0.1, 0.2]), np.array([0.3, 0.2]))
    low, high = ranges(thinned, 0.0, 2.0, 2)
    assert (low[0], high[0]) == (0.1, 0.3)


def test_the_playhead_hides_nothing(playback):
    still = TimelineDrawing((playback.timeline,), playback.timeline.signals, 80, 24)
    for time in np.arange(0.0, 10.0, 0.1):
        codes, _ = draw_frame(still, time, (time,), CURSOR)
        column = still.gutter + still.span.column(time)
        changed = np.flatnonzero(codes[:, column] != still.codes[:, column])
        assert len(changed) > 4
        assert {chr(code) for code in still.codes[changed, column]} <= set(" ·─░")
        assert set(map(chr, codes[changed, column])) == {"│"}


def test_timelines_look_as_they_did(playback, golden):
    usual, time = playback.timeline, np.array([0.0, 10.0])
    moves = tuple(DoorMotion(float(i), f"door-{i}.hinge", opens=True) for i in range(5))
    shut = DoorMotion(6.0, "door-0.hinge", opens=False)
    doors = replace(usual, doors=(*moves, shut))
    far = replace(usual.signals[1], limits=(SignalLimit(20.0, "above"),))
    names = (
        "clearance(0.35 m, 0.20 m)",
        "clearance(doors)",
        "clearance(0.55 m)",
        "mission.distance",
    )
    long = tuple(RunSignal(name, "m", time, time, time) for name in names)
    first = replace(usual, doors=(moves[2], replace(shut, joint="door-2.hinge", time=8.0)))
    second = replace(first, doors=(moves[2], replace(moves[1], time=4.0)))
    both = TimelineDrawing((first, second), (), 90, 20)
    pictures = {
        "at the moment of a verdict": drawn_of(usual, time=TURNED),
        "in little room": drawn_of(usual, 80, 8),
        "a limit far away": drawn_of(replace(usual, signals=(far,)), 80, 8),
        "a lane for every door that moved": drawn_of(doors, 90, 36),
        "a lane for several doors": drawn_of(doors, 90, 15),
        "a door that was open before": drawn_of(replace(usual, doors=(shut,)), 80, 12),
        "no door that moves": drawn_of(replace(usual, doors=()), 80, 12),
        "long names": drawn_of(RunTimeline(0.0, 10.0, long, None, (), (), ()), 72, 20),
        "doors of two runs": ["".join(map(chr, row)).rstrip() for row in both.codes],
    }
    texts = ("\n".join([f"--- {name}", *lines, ""]) for name, lines in pictures.items())
    golden("screens/timelines.txt", "\n".join(texts))


def test_the_timeline_fits_into_any_room(playback):
    for columns, rows in ((12, 2), (20, 5), (300, 80)):
        drawn_of(playback.timeline, columns, rows)


def test_signals_that_oracles_read_come_first_and_what_only_counts_if_it_is_asked_for(playback):
    clock = replace(playback.timeline.signals[0], name="elapsed", readers=("in-time",))
    view = TimelineView()
    view.show((replace(playback.timeline, signals=(*playback.timeline.signals, clock)),))
    read = [bool(signal.readers) for signal in view.signals]
    assert read == sorted(read, reverse=True)
    assert "elapsed" not in [signal.name for signal in view.signals]
    view.lead("in-time")
    assert view.signals[0].name == "elapsed"
    view.lead("")
    view.toggle_counting()
    assert "elapsed" in [signal.name for signal in view.signals]


VALUES = {
    "a yes or no": ("bool", [0.0, 1.0], [0.0, 1.0], ["no", "no", "yes", "yes"]),
    "a thinned one": ("m", [0.1, 0.2], [0.3, 0.2], ["0.1–0.3 m"] * 2 + ["0.2 m"] * 2),
    "digits of its other end": (
        "m", [0.0000986, -0.00276], [0.0063, 1.19], ["0.0001–0.0063 m"] * 2 + ["0–1.2 m"] * 2
    ),
    "a great one": ("m", [0.03, 0.0], [1.9, 0.0], ["0.03–1.9 m"] * 2 + ["0 m"] * 2),
}  # fmt: skip
"""Unit, least and most of a signal at 1 s and at 2 s, and what is told of 1, 1.9, 2 and 9 s."""


@pytest.mark.parametrize("kind", VALUES)
def test_values_at_the_cursor_are_those_of_the_last_sample(kind):
    unit, least, most, told = VALUES[kind]
    signal = RunSignal("it", unit, np.array([1.0, 2.0]), np.array(least), np.array(most))
    assert [at_playhead(signal, t) for t in (0.5, 1.0, 1.9, 2.0, 9.0)] == ["–", *told]


def test_only_changed_parts_of_rows_are_drawn_again():
    before = np.stack(Canvas(40, 5, 1).cells())
    after = before.copy()
    after[0, 2, [3, 5, 30]] = ord("x")
    after[1, 4, 39] = 0
    found = [(r.x, r.y, r.width) for r in changed_spans(before, after)]
    assert found == [(3, 2, 3), (30, 2, 1), (39, 4, 1)]
    assert changed_spans(before, before) == []


class Plots(LimitedTerminalApp):
    """Shows signals, and goes to the moments that are pointed at."""

    def __init__(self, timeline):
        super().__init__()
        self.timeline = timeline
        self.sought = []

    def compose(self):
        yield TimelineView()

    def on_mount(self):
        self.query_one(TimelineView).show((self.timeline,))

    def on_timeline_view_seek(self, event):
        self.sought.append(event.time)
        self.query_one(TimelineView).move(event.time)


COLUMNS = 90


@pytest.fixture
async def plots(dashboard, playback):
    """The app with the signals, and the first column of their plots."""
    dash = await dashboard(Plots(playback.timeline), (COLUMNS, 24))
    still = TimelineDrawing((playback.timeline,), playback.timeline.signals, COLUMNS, 24)
    return dash, dash.one(TimelineView), still.gutter


async def stretch(dash):
    """The stretch of time that the axis names, without one all of it."""
    await dash.settle()
    named = re.search(r"([\d.]+)–([\d.]+) s of 10\.0 s", dash.lines[-1])
    return tuple(map(float, named.groups())) if named else (0.0, 10.0)


async def test_a_click_seeks_and_a_drag_seeks_all_along_also_beyond_the_plot(plots, playback):
    dash, view, gutter = plots
    pilot, sought = dash.pilot, dash.app.sought
    columns = COLUMNS - gutter
    await pilot.click(view, offset=(gutter + columns // 2, 5))
    assert sought == [pytest.approx(5.0, abs=0.1)]
    await pilot.mouse_down(view, offset=(gutter, 5))
    for x in (gutter + 10, gutter + 20, COLUMNS - 1):
        await pilot.hover(view, offset=(x, 9))
    await pilot.mouse_up(view, offset=(COLUMNS - 1, 5))
    assert sought[1] == 0.0
    assert sought[1:] == sorted(sought[1:])
    assert sought[-1] == 10.0
    count = len(sought)
    await pilot.hover(view, offset=(gutter + 30, 5))  # the button is not held any more
    await pilot.click(view, offset=(3, 5))  # beside the plots
    assert len(sought) == count
    await pilot.click(view, offset=(dash.lines[-1].index("✗"), 23))
    assert sought[-1] == playback.timeline.decided[0]  # that very moment


async def wheel(dash, view, kind, x, turns):
    for _ in range(turns):
        await dash.pilot._post_mouse_events([kind], view, offset=(x, 5))
        await dash.pilot.pause()
    return await stretch(dash)


async def test_the_wheel_shows_less_of_the_time_around_the_pointer_and_all_again(plots):
    dash, view, gutter = plots
    at = gutter + (COLUMNS - gutter) // 2
    start, end = await wheel(dash, view, events.MouseScrollUp, at, 3)
    assert end - start == pytest.approx(10.0 * ZOOM**3, abs=0.1)
    assert (start + end) / 2.0 == pytest.approx(5.0, abs=0.2)
    assert dash.app.sought == []
    assert await wheel(dash, view, events.MouseScrollDown, at, 3) == (0.0, 10.0)
    start, end = await wheel(dash, view, events.MouseScrollUp, at, 20)
    assert end - start == pytest.approx(0.1, abs=0.02)
    view.fit_time()
    assert await stretch(dash) == (0.0, 10.0)


async def test_only_what_happens_in_a_stretch_is_drawn(plots):
    dash, view, _ = plots
    for _ in range(2):
        view.zoom_time(nearer=True, around=0.0)  # 0 to 4.9 s: before anything went wrong
    await dash.settle()
    assert not set("✗░◇") & set(dash.text)
    assert dash.lines[-2].endswith("1 w1")  # the leg goes on beyond the stretch
    view.fit_time()
    await dash.settle()
    assert {"✗", "░", "◇"} <= set(dash.text)


async def test_a_stretch_goes_along_with_the_playhead_that_was_in_it(plots, playback):
    dash, view, _ = plots
    for _ in range(2):
        view.zoom_time(nearer=True)
    for time, shown in ((4.8, (0.0, 4.9)), (5.0, (4.51, 9.41)), (1.0, (0.0, 4.9))):
        view.move(time)
        assert await stretch(dash) == pytest.approx(shown, abs=0.05)
    view.zoom_time(nearer=True, around=4.9)
    looked = await stretch(dash)
    assert looked[0] > 1.0
    view.move(1.1)  # somebody looks at another stretch: it stays
    assert await stretch(dash) == looked
    view.reveal()  # a key has moved the playhead
    start, end = await stretch(dash)
    assert start <= 1.1 <= end
    # A run that begins anew is shown as a whole.
    view.zoom_time(nearer=True, around=10.0)
    view.show((replace(playback.timeline, end=1.0),))
    view.move(0.5)
    await dash.settle()
    assert " s of " not in dash.text
