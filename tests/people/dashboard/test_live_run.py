"""A run looked at while it goes on: signals, verdicts and log so far, and what is said without."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from textual.containers import VerticalScroll

from daemon.batch.client import read_snapshot
from daemon.model.live_judgement import LiveJudgement, LogLine
from daemon.model.live_view import to_centimetres
from daemon.model.run_state import RunState
from grammars.model.geometry import Pose2
from grammars.text import codec
from scenario_tui.dashboard.live_tracks import Tracks
from scenario_tui.dashboard.run_timeline import clearance_along, heard_timeline, live_timeline
from scenario_tui.dashboard.transport import ReplayTransport
from scenario_tui.dashboard.widgets.tables import VerdictList
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.top_view import TopView
from tests.people.dashboard.inline import make_dashboard
from tests.people.fake import (
    CAMPAIGN,
    WAITING,
    FakeDaemon,
    make_judgement,
    make_live,
    make_row,
    make_spec,
)
from tests.people.recorded import make_run, record_run

RUN = f"{CAMPAIGN}.7"
SPEC = make_spec(make_row(7), "")
WIDE = (120, 40)


def running(time=60.0):
    return FakeDaemon(live=tuple(make_live(7, float(t)) for t in np.arange(0.0, time + 1.0, 2.0)))


def judged(until=60.0, **judgement):
    fake = running(until)
    fake.judged[RUN] = make_judgement(**judgement)
    return fake


async def test_a_key_shows_what_only_counts(dashboard):
    dash = await dashboard(judged(), WIDE, run=RUN)
    assert "elapsed" not in dash.text
    await dash.press("e")
    assert "elapsed" in dash.text


async def test_a_run_that_is_not_judged_any_more_says_so_and_goes_on_to_be_drawn(dashboard):
    fake = judged()
    dash = await dashboard(fake, WIDE, run=RUN)
    assert "passing so far" in dash.text
    line = LogLine(60.0, "oracles", "not judged any more while it runs: it broke", "error")
    fake.judged[RUN] = LiveJudgement(RUN, 60.0, (), (), (), (), (line,))
    fake.watchers[RUN](make_live(7, 62.0))
    await dash.settle()
    assert "passing so far" not in dash.text
    assert "not judged any more" in dash.text
    assert "speed" in dash.text


async def test_what_a_system_waits_for_is_shown_as_it_is_brackets_too(dashboard):
    waiting = "waiting for [/map] of [amcl]"
    dash = await dashboard(FakeDaemon(live=(make_live(7, waiting=waiting),)), (140, 40), run=RUN)
    assert waiting in dash.text


@pytest.mark.parametrize("far", [1e6, 1e15, 1e90])
async def test_a_system_that_takes_the_robot_to_be_anywhere_is_watched_all_the_same(dashboard, far):
    lost = make_live(7, 61.0)
    points = to_centimetres(np.array([(far, -far), (-far, 0.0), (1.0, 2.0)] * 12))
    snapshot = replace(
        lost.snapshot, estimate=Pose2(far, -far, far), spread=(far, 0.0, far), plan=points
    )
    dash = await dashboard(running(), WIDE, run=RUN)
    told = codec.to_json(replace(lost, snapshot=snapshot))
    dash.app.tracks.add(read_snapshot(told))
    await dash.settle()
    assert "61 s of 1200 s" in dash.text
    assert "◆3" in dash.text


async def test_what_decides_is_marked_on_the_live_map_and_at_its_moment(dashboard):
    fake = judged(contact=True)
    dash = await dashboard(fake, (150, 40), run=RUN)
    assert "✗ door-1.leaf decides" in dash.text
    assert "✗ no-contact" in dash.text
    await dash.press("left")
    assert "✗ no-contact" not in dash.text
    await dash.press("n")
    assert "27.0 s of" in dash.text
    assert "✗ no-contact" in dash.text


async def test_a_judgement_is_asked_for_only_while_the_run_is_on_the_screen(dashboard):
    fake = running()
    dash = await dashboard(fake, (140, 40))
    await dash.open("runs", CAMPAIGN)
    await dash.press(*["j"] * 7)
    assert list(fake.watchers) == [RUN]  # the map beside the table is live, and no more
    assert fake.judges == {}
    await dash.open("run", RUN)
    assert list(fake.judges) == [RUN]
    await dash.press("escape")
    assert fake.judges == {}


async def test_the_list_keeps_its_cursor_when_the_order_changes(dashboard):
    fake = judged()
    dash = await dashboard(fake, WIDE, run=RUN)
    await dash.press("down")
    listed = dash.one(VerdictList)
    chosen = listed.chosen()
    assert chosen.oracle == "clear"
    assert dash.one(TimelineView).signals[0].name == "clearance"
    fake.judged[RUN] = make_judgement(time=61.0, contact=True)
    await dash.settle()
    assert listed.chosen().oracle == "clear"


async def test_the_log_follows_its_end_unless_somebody_scrolled_up(dashboard):
    fake = judged()
    dash = await dashboard(fake, WIDE, run=RUN)
    log = dash.one("#log", VerticalScroll)
    lines = make_judgement().log

    async def say(*words):
        said = tuple(LogLine(60.0, "pilot", word) for word in words)
        fake.judged[RUN] = replace(make_judgement(time=61.0 + len(words)), log=(*lines, *said))
        await dash.settle()

    await say(*[f"line {i}" for i in range(40)])
    assert log.is_vertical_scroll_end
    assert "line 39" in dash.text
    log.scroll_to(y=3, animate=False)
    await dash.settle()
    await say(*[f"line {i}" for i in range(60)])
    assert log.scroll_offset.y == 3


@pytest.mark.parametrize(
    ("live", "words"),
    [
        ((), "Nothing was heard of this run yet"),
        ((make_live(7, waiting=WAITING),), "Signals begin with simulated time"),
        ((make_live(7, 0.5),), "Signals and verdicts so far come in a moment"),
    ],
    ids=["unheard", "starting", "first-second"],
)
async def test_before_there_are_signals_the_screen_says_what_it_waits_for(dashboard, live, words):
    dash = await dashboard(FakeDaemon(live=live), WIDE, run=RUN)
    for size in (WIDE, (40, 10)):
        await dash.resize(*size)
        while size[0] < 110 and "[signals]" not in dash.text:
            await dash.press("tab")
        assert words.split()[0] in dash.text
        assert words in str(dash.one("#untold").content)


async def test_before_the_first_judgement_signals_are_those_that_snapshots_tell(dashboard):
    fake = running()
    dash = await dashboard(fake, WIDE, run=RUN)
    for words in ("loc.error", "0.141 m", "speed", "0.05 m/s", "come in a moment", "2 w2"):
        assert words in dash.text
    assert "│ doors" not in dash.text  # nothing is known of them yet
    fake.judged[RUN] = make_judgement()
    await dash.settle()
    assert "clearance" in dash.text
    assert "come in a moment" not in dash.text


def test_of_a_long_run_moments_all_along_are_remembered():
    tracks = Tracks()
    for step in range(5000):
        tracks.add(make_live(7, step * 2.0))
    track = tracks.get(RUN)
    assert track is not None
    assert 200 < len(track.heard_of) <= 600
    assert track.heard_of[0].time == 0.0
    assert track.heard_of[-1].time == 9998.0


async def test_a_worker_that_tells_no_signals_is_said_to_be_one(dashboard):
    fake = running()
    dash = await dashboard(fake, WIDE, run=RUN)
    fake.now += 60.0
    await dash.settle()
    assert "Its worker tells no signals" in dash.text


async def test_a_run_nothing_is_heard_of_any_more_says_for_how_long(dashboard):
    fake = running()
    clock = [0.0]
    app = make_dashboard(fake)
    # Before it begins: what is live is told once, and taken in as soon as there is a screen.
    app.tracks = Tracks(clock=lambda: clock[0])
    dash = await dashboard(app, (120, 40), run=RUN)
    assert "last heard" not in dash.text
    clock[0] += 72.0
    await dash.settle()
    assert "last heard 1 min 12 s ago" in dash.text


async def test_the_worst_margin_so_far_stands_in_the_first_line(dashboard):
    live = make_live(7, 60.0)
    snapshot = replace(live.snapshot, margin=-0.02, unit="m", oracle="clear")
    dash = await dashboard(FakeDaemon(live=(replace(live, snapshot=snapshot),)), WIDE, run=RUN)
    assert "▶ running  1/3 wp  60 s of 1200 s  ✗ −0.02 m clear" in dash.text


async def test_a_run_without_oracles_still_shows_signals_and_what_it_is(dashboard):
    fake = running()
    fake.judged[RUN] = replace(make_judgement(), verdicts=())
    dash = await dashboard(fake, WIDE, run=RUN)
    assert "S2/pilot/2" in dash.text
    assert "clearance" in dash.text
    assert "so far" not in dash.text


class Ending(FakeDaemon):
    """Run 7 goes on until it is ``over``, then it is the recorded one."""

    over = False
    trace: Path = Path()

    def run(self, run):
        if self.over:
            done = make_row(7, state=RunState.DONE, trace=str(self.trace))
            self.rows = tuple(done if row.index == 7 else row for row in self.rows)
        found = super().run(run)
        return replace(found, spec=make_run(7)) if self.over else found


async def test_a_run_that_ends_while_it_is_looked_at_stays_where_one_looked(dashboard, tmp_path):
    fake = Ending(live=tuple(make_live(7, float(t)) for t in range(10)))
    fake.trace = record_run(tmp_path / "run.mcap", index=7)
    fake.judged[RUN] = make_judgement(time=9.0)
    dash = await dashboard(fake, (80, 24), run=RUN)
    await dash.press("shift+tab")
    assert "[signals]" in dash.text
    fake.over = True
    dash.app.update_state()
    await dash.settle()
    assert "clearance" in dash.text  # no empty screen while the trace is read
    await dash.read()
    assert "[signals]" in dash.text
    assert dash.screen.transport.time == 10.0
    assert "10.0 s of 10.0 s" in dash.text


async def test_the_trail_is_known_by_its_clearance(dashboard):
    fake = judged(time=60.0, until=120.0)
    dash = await dashboard(fake, WIDE, run=RUN)
    view = dash.one(TopView)._view
    assert len(view.clearances) == len(view.trail)
    assert view.clearances[0] > 0.5
    assert np.isnan(view.clearances[-1])  # later than what was judged


def test_the_limit_of_the_trail_is_that_of_an_oracle_that_reads_clearance():
    timeline = live_timeline(make_judgement(), SPEC)
    known, limit = clearance_along(timeline.signals, [27.0, -1.0, 1e6])
    assert limit == 0.05
    assert known[0] == pytest.approx(0.11)
    assert np.isnan(known[1:]).all()


def test_a_worker_that_tells_of_more_waypoints_than_there_are_is_not_believed():
    heard = [make_live(7, float(t)).snapshot for t in range(3)]
    heard = [replace(one, reached=10**9) for one in heard]
    timeline = heard_timeline(heard, SPEC)
    assert timeline is not None
    assert timeline.reached == (0.0,) * len(SPEC.mission.waypoints)


def test_the_axis_of_time_stands_still_while_a_run_grows():
    ends = [live_timeline(make_judgement(time=t), SPEC).horizon for t in np.arange(1.0, 200.0)]
    assert all(end > now for now, end in zip(np.arange(1.0, 200.0), ends, strict=True))
    assert len(set(ends)) < 25


async def test_the_cursor_goes_back_in_a_run_that_goes_on_and_follows_again_at_the_end(dashboard):
    fake = judged()
    dash = await dashboard(fake, WIDE, run=RUN)
    screen = dash.screen
    signals = screen.query_one(TimelineView)
    assert signals._time == 60.0
    await dash.press("shift+left", "shift+left", "shift+left")
    fake.watchers[RUN](make_live(7, 62.0))
    fake.judged[RUN] = make_judgement(time=62.0)
    await dash.settle()
    assert signals._time == 30.0
    assert "30.0 s of 62.0 s" in dash.text
    assert "end follows again" in dash.text
    assert screen.query_one(TopView)._view.robot_pose == make_live(7, 30.0).snapshot.pose
    await dash.press("end")
    fake.judged[RUN] = make_judgement(time=64.0)
    fake.watchers[RUN](make_live(7, 64.0))
    await dash.settle()
    assert signals._time == 64.0
    assert screen.query_one(TopView)._view.robot_pose == make_live(7, 64.0).snapshot.pose
    assert "follows again" not in dash.text


async def test_space_stays_at_a_moment_of_a_run_that_goes_on_and_plays_from_there(dashboard):
    fake = judged()
    dash = await dashboard(fake, WIDE, run=RUN)
    assert "space Stay" in dash.text
    await dash.press("space")
    fake.judged[RUN] = make_judgement(time=70.0)
    await dash.settle()
    transport = dash.screen.transport
    assert (transport.time, transport.end, transport.playing) == (60.0, 70.0, False)
    assert "space Play" in dash.text
    await dash.press("space")
    assert transport.playing
    transport.advance(60.0)
    assert transport.follows


async def test_enter_on_a_verdict_so_far_goes_to_its_moment_and_the_list_alone_does_not(dashboard):
    fake = judged()
    dash = await dashboard(fake, WIDE, run=RUN)
    await dash.press("down")
    assert dash.screen.transport.follows
    await dash.press("enter")
    assert dash.one(VerdictList).chosen().oracle == "clear"
    assert dash.screen.transport.time == 27.0


def test_a_run_that_begins_anew_is_followed_from_its_start():
    transport = ReplayTransport(0.0, 50.0, 50.0, playing=False, live=True, follows=True)
    transport.go(20.0)
    transport.grow(0.0, 3.0)
    assert (transport.time, transport.follows) == (3.0, True)


async def test_a_run_that_begins_anew_has_not_failed_yet(dashboard):
    fake = judged(contact=True)
    dash = await dashboard(fake, WIDE, run=RUN)
    assert [one.oracle for one in dash.screen.moments()] == ["no-contact"]
    del fake.judged[RUN]
    fake.watchers[RUN](make_live(7, 0.0))
    await dash.settle()
    assert not dash.screen.moments()


async def test_where_all_is_in_view_tab_goes_to_the_log_and_back(dashboard):
    fake = judged()
    dash = await dashboard(fake, WIDE, run=RUN)
    focused = []
    for _ in range(3):
        await dash.press("tab")
        focused.append(dash.screen.focused.id)
    assert focused == ["log", "decided", "log"]
