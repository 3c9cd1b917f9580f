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
from scenario_tui.dashboard.live_run import LiveRun, live_text
from scenario_tui.dashboard.live_tracks import Tracks
from scenario_tui.dashboard.run_timeline import clearance_along, heard_timeline, live_timeline
from scenario_tui.dashboard.run_watch import RunNews
from scenario_tui.dashboard.transport import ReplayTransport
from scenario_tui.dashboard.widgets.tables import VerdictList
from scenario_tui.dashboard.widgets.timeline import TimelineView
from tests.people.fake import (
    CAMPAIGN,
    WAITING,
    FakeDaemon,
    make_judgement,
    make_live,
    make_row,
    make_scene,
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


def tracked(*news, clock=lambda: 0.0):
    """Return the track of the run after some news."""
    tracks = Tracks(clock=clock)
    for one in news:
        tracks.add(one)
    return tracks.get(RUN)


def heard(*news):
    """Return the run as who looks at it has heard of it."""
    live = LiveRun()
    live.hear(RunNews(FakeDaemon().run(RUN), make_scene()), tracked(*news))
    return live


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


async def test_what_decides_is_marked_on_the_live_map_at_its_moment_and_at_the_end(dashboard):
    dash = await dashboard(judged(contact=True), (150, 40), run=RUN)
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


async def test_the_list_keeps_its_cursor_and_only_enter_goes_to_the_moment_of_a_verdict(dashboard):
    fake = judged()
    dash = await dashboard(fake, WIDE, run=RUN)
    await dash.press("down")
    listed = dash.one(VerdictList)
    assert listed.chosen().oracle == "clear"
    assert dash.one(TimelineView).signals[0].name == "clearance"
    assert dash.screen.transport.follows
    fake.judged[RUN] = make_judgement(time=61.0, contact=True)
    await dash.settle()
    assert listed.chosen().oracle == "clear"
    await dash.press("enter")
    assert dash.screen.transport.time == 27.0


async def test_the_log_follows_its_end_unless_somebody_scrolled_up(dashboard):
    fake = judged()
    dash = await dashboard(fake, WIDE, run=RUN)
    log = dash.one("#log", VerticalScroll)
    lines = make_judgement().log

    async def say(count):
        said = tuple(LogLine(60.0, "pilot", f"line {i}") for i in range(count))
        fake.judged[RUN] = replace(make_judgement(time=61.0 + count), log=(*lines, *said))
        await dash.settle()

    await say(40)
    assert log.is_vertical_scroll_end
    assert "line 39" in dash.text
    log.scroll_to(y=3, animate=False)
    await dash.settle()
    await say(60)
    assert log.scroll_offset.y == 3


@pytest.mark.parametrize(
    ("news", "waited", "words"),
    [
        ((), 99.0, "Nothing was heard of this run yet: its worker prepares it."),
        (
            (make_live(7, waiting=WAITING),), 99.0,
            f"{WAITING}\n\nSignals begin with simulated time, when it is up.",
        ),
        ((make_live(7, 0.5),), 30.0, "Signals and verdicts so far come in a moment."),
        (
            (make_live(7, 0.5),), 30.1,
            "Its worker tells no signals: they are drawn when the run is over.",
        ),
    ],
)  # fmt: skip
def test_before_there_are_signals_it_is_said_what_is_waited_for(news, waited, words):
    assert heard(*news).why_untold(waited) == words


async def test_a_worker_that_falls_silent_is_said_to_be(dashboard):
    fake = running()
    dash = await dashboard(fake, WIDE, run=RUN)
    assert "last heard" not in dash.text
    fake.now += 72.0
    await dash.settle()
    assert "last heard 1 min 12 s ago" in dash.text
    assert "Its worker tells no signals" in dash.text


def test_the_worst_margin_so_far_stands_in_the_first_line():
    live = make_live(7, 60.0)
    snapshot = replace(live.snapshot, margin=-0.02, unit="m", oracle="clear")
    track = tracked(replace(live, snapshot=snapshot))
    assert live_text(track, 5.0, wide=True).plain == "  1/3 wp  60 s of 1200 s  ✗ −0.02 m clear"
    assert live_text(track, 5.0, wide=False).plain == "  1/3 wp  60 s  ✗ −0.02 m clear"


async def test_what_was_never_said_is_not_shown_and_brackets_are_shown_as_they_are(dashboard):
    waiting = "waiting for [/map] of [amcl]"
    fake = FakeDaemon(live=(make_live(7, waiting=waiting),))
    dash = await dashboard(fake, (140, 40), run=RUN)
    assert waiting in dash.text
    fake.live = (make_live(7, 60.0),)
    fake.judged[RUN] = replace(make_judgement(), verdicts=())
    await dash.settle()
    assert "S2/pilot/2" in dash.text
    assert "clearance" in dash.text
    assert "so far" not in dash.text
    assert "elapsed" not in dash.text
    await dash.press("e")
    assert "elapsed" in dash.text


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


def test_the_trail_is_known_by_its_clearance():
    heard_of = (make_live(7, float(t)) for t in range(0, 122, 2))
    view = heard(*heard_of, make_judgement()).view(120.0)
    assert len(view.clearances) == len(view.trail)
    assert view.clearances[0] > 0.5
    assert np.isnan(view.clearances[-1])  # later than what was judged
    known, limit = clearance_along(live_timeline(make_judgement(), SPEC).signals, [27.0, -1.0, 1e6])
    assert limit == view.limit == 0.05  # of an oracle that reads it
    assert known[0] == pytest.approx(0.11)
    assert np.isnan(known[1:]).all()


def test_a_worker_that_tells_of_more_waypoints_than_there_are_is_not_believed():
    snapshots = [replace(make_live(7, float(t)).snapshot, reached=10**9) for t in range(3)]
    timeline = heard_timeline(snapshots, SPEC)
    assert timeline.reached == (0.0,) * len(SPEC.mission.waypoints)


def test_the_axis_of_time_stands_still_while_a_run_grows():
    ends = [live_timeline(make_judgement(time=t), SPEC).horizon for t in np.arange(1.0, 200.0)]
    assert all(end > now for now, end in zip(np.arange(1.0, 200.0), ends, strict=True))
    assert len(set(ends)) < 25


async def test_the_cursor_goes_back_in_a_run_that_goes_on_and_follows_again_at_the_end(dashboard):
    fake = judged()
    dash = await dashboard(fake, WIDE, run=RUN)
    assert dash.screen.transport.time == 60.0
    await dash.press("shift+left", "shift+left", "shift+left")
    for time, at in ((62.0, 30.0), (64.0, 64.0)):
        if at == time:
            await dash.press("end")
        fake.watchers[RUN](make_live(7, time))
        fake.judged[RUN] = make_judgement(time=time)
        await dash.settle()
        assert f"{at} s of {time} s" in dash.text or at == time
        assert dash.screen.transport.time == at
        assert dash.map.robot_pose == make_live(7, at).snapshot.pose
        assert ("end follows again" in dash.text) == (at < time)


async def test_space_stays_at_a_moment_of_a_run_that_goes_on_and_plays_from_there(dashboard):
    fake = judged()
    dash = await dashboard(fake, WIDE, run=RUN)
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


def test_a_run_that_begins_anew_is_followed_from_its_start():
    transport = ReplayTransport(0.0, 50.0, 50.0, playing=False, live=True, follows=True)
    transport.go(20.0)
    transport.grow(0.0, 3.0)
    assert (transport.time, transport.follows) == (3.0, True)


def test_a_run_that_begins_anew_has_not_failed_yet():
    live = heard(make_live(7, 60.0), make_judgement(contact=True))
    assert [one.oracle for one in live.moments] == ["no-contact"]
    live.hear(RunNews(FakeDaemon().run(RUN), make_scene()), tracked(make_live(7, 0.0)))
    assert not live.moments


async def test_where_all_is_in_view_tab_goes_to_the_log_and_back(dashboard):
    dash = await dashboard(judged(), WIDE, run=RUN)
    focused = []
    for _ in range(3):
        await dash.press("tab")
        focused.append(dash.screen.focused.id)
    assert focused == ["log", "decided", "log"]


def test_a_trail_grows_with_the_way_and_starts_anew_with_a_new_attempt():
    way = [make_live(7, time) for time in (0.0, 0.1, 20.0, 40.0)]
    assert len(tracked(*way).trail) == 3  # 5 mm are no step
    assert len(tracked(*way, way[0]).trail) == 1


def test_of_a_long_run_a_coarser_trail_and_moments_all_along_are_remembered():
    track = tracked(*(make_live(7, step * 2.0) for step in range(20_000)))
    assert 500 < len(track.trail) <= 2000
    assert track.trail[0] == (1.0, 2.0)
    assert track.trail[-1][0] == pytest.approx(2001.0, abs=2.0)
    assert 200 < len(track.heard_of) <= 600
    assert (track.heard_of[0].time, track.heard_of[-1].time) == (0.0, 39_998.0)
    assert track.heard_of[300].time - track.heard_of[100].time > 400.0  # thinner, the older


def test_contacts_flash_for_a_while():
    touched = make_live(7, 1.0)
    touched = replace(touched, snapshot=replace(touched.snapshot, contacts=(100, 200)))
    for passed, flashes in ((0.4, [(1.0, 2.0)]), (0.6, [])):
        times = iter((0.0, passed))
        track = tracked(touched, make_live(7, 2.0), clock=lambda times=times: next(times))
        assert list(track.flashes) == flashes


def test_the_runs_longest_unheard_of_are_forgotten():
    tracks = Tracks()
    for index in range(65):
        tracks.add(make_live(index))
    assert tracks.get(make_live(0).run) is None
    assert tracks.get(make_live(1).run) is not None
