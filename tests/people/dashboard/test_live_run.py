"""A run looked at while it goes on: signals, verdicts and log so far, and what is said without."""

from __future__ import annotations

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
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle
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


def shown(pilot):
    return "\n".join(screen_text(pilot))


def running(time=60.0):
    return FakeDaemon(live=tuple(make_live(7, float(t)) for t in np.arange(0.0, time + 1.0, 2.0)))


def opened(fake, size=(120, 40)):
    return make_dashboard(fake).run_test(size=size)


async def look_at(pilot):
    await pilot.pause(0)
    pilot.app.open("run", RUN)
    await settle(pilot)


async def test_signals_verdicts_and_log_so_far_stand_beside_the_live_map():
    fake = running()
    fake.judged[RUN] = make_judgement()
    async with opened(fake) as pilot:
        await look_at(pilot)
        for words in (
            "✓ passing so far  clear  +0.06 m", "nearest at 27.0 s, door-1",
            "? undecided so far  reached  −1 s", "1 of 3 waypoints reached",
            "clearance", "≥ 0.05 m", "1 w1─◇─", "54.0 s  pilot", "robot",
        ):  # fmt: skip
            assert words in shown(pilot)
        assert "elapsed" not in shown(pilot)
        await press(pilot, "e")
        assert "elapsed" in shown(pilot)


async def test_signals_are_drawn_anew_only_when_there_is_a_new_judgement():
    fake = running()
    fake.judged[RUN] = make_judgement()
    async with opened(fake) as pilot:
        await look_at(pilot)
        signals = pilot.app.screen.query_one(TimelineView)
        drawing = signals._drawing
        assert drawing is not None
        fake.watchers[RUN](make_live(7, 60.4))
        await settle(pilot)
        assert signals._drawing is drawing
        fake.judged[RUN] = make_judgement(time=61.0)
        await settle(pilot)
        assert signals._drawing is not drawing


async def test_a_run_that_is_not_judged_any_more_says_so_and_goes_on_to_be_drawn():
    fake = running()
    fake.judged[RUN] = make_judgement()
    async with opened(fake) as pilot:
        await look_at(pilot)
        assert "passing so far" in shown(pilot)
        line = LogLine(60.0, "oracles", "not judged any more while it runs: it broke", "error")
        fake.judged[RUN] = LiveJudgement(RUN, 60.0, (), (), (), (), (line,))
        fake.watchers[RUN](make_live(7, 62.0))
        await settle(pilot)
        assert "passing so far" not in shown(pilot)
        assert "not judged any more" in shown(pilot)
        assert "speed" in shown(pilot)


@pytest.mark.parametrize("size", [(80, 24), (120, 40), (200, 50)])
async def test_while_a_system_starts_the_map_shows_where_it_will(size):
    async with opened(FakeDaemon(live=(make_live(7, waiting=WAITING),)), size) as pilot:
        await look_at(pilot)
        assert WAITING in shown(pilot)
        assert "◆3" in shown(pilot)
        assert pilot.app.screen.query_one(TopView).size.height > size[1] / 2


async def test_what_a_system_waits_for_is_shown_as_it_is_brackets_too():
    waiting = "waiting for [/map] of [amcl]"
    async with opened(FakeDaemon(live=(make_live(7, waiting=waiting),)), (140, 40)) as pilot:
        await look_at(pilot)
        assert waiting in shown(pilot)


@pytest.mark.parametrize("far", [1e6, 1e15, 1e90])
async def test_a_system_that_takes_the_robot_to_be_anywhere_is_watched_all_the_same(far):
    lost = make_live(7, 61.0)
    points = to_centimetres(np.array([(far, -far), (-far, 0.0), (1.0, 2.0)] * 12))
    snapshot = replace(
        lost.snapshot, estimate=Pose2(far, -far, far), spread=(far, 0.0, far), plan=points
    )
    async with opened(running()) as pilot:
        await look_at(pilot)
        told = codec.to_json(replace(lost, snapshot=snapshot))
        pilot.app.tracks.add(read_snapshot(told))
        await settle(pilot)
        assert "61 s of 1200 s" in shown(pilot)
        assert "◆3" in shown(pilot)


async def test_a_failure_for_good_is_a_failure_while_the_run_goes_on():
    fake = running()
    fake.judged[RUN] = make_judgement(contact=True)
    async with opened(fake) as pilot:
        await look_at(pilot)
        lines = screen_text(pilot)
        assert lines[3].startswith(" ✗ fail  no-contact")  # above what passes
        assert "27.0 s  contact    robot touches" in shown(pilot)


async def test_what_decides_is_marked_on_the_live_map_and_at_its_moment():
    fake = running()
    fake.judged[RUN] = make_judgement(contact=True)
    async with opened(fake, (150, 40)) as pilot:
        await look_at(pilot)
        assert "✗ door-1.leaf decides" in shown(pilot)
        assert "✗ no-contact" in shown(pilot)
        await press(pilot, "left")
        assert "✗ no-contact" not in shown(pilot)
        await press(pilot, "n")
        assert "27.0 s of" in shown(pilot)
        assert "✗ no-contact" in shown(pilot)


async def test_a_judgement_is_asked_for_only_while_the_run_is_on_the_screen():
    fake = running()
    async with opened(fake, (140, 40)) as pilot:
        await pilot.pause(0)
        pilot.app.open("runs", CAMPAIGN)
        await settle(pilot)
        await press(pilot, *["j"] * 7)
        assert list(fake.watchers) == [RUN]  # the map beside the table is live, and no more
        assert fake.judges == {}
        await look_at(pilot)
        assert list(fake.judges) == [RUN]
        await press(pilot, "escape")
        assert fake.judges == {}


async def test_the_list_keeps_its_cursor_when_the_order_changes():
    fake = running()
    fake.judged[RUN] = make_judgement()
    async with opened(fake) as pilot:
        await look_at(pilot)
        await press(pilot, "down")
        listed = pilot.app.screen.query_one(VerdictList)
        chosen = listed.chosen()
        assert chosen.oracle == "clear"
        assert pilot.app.screen.query_one(TimelineView).signals[0].name == "clearance"
        fake.judged[RUN] = make_judgement(time=61.0, contact=True)
        await settle(pilot)
        assert listed.chosen().oracle == "clear"


async def test_the_log_follows_its_end_unless_somebody_scrolled_up():
    fake = running()
    fake.judged[RUN] = make_judgement()
    async with opened(fake) as pilot:
        await look_at(pilot)
        log = pilot.app.screen.query_one("#log", VerticalScroll)
        lines = make_judgement().log

        async def say(*words):
            said = tuple(LogLine(60.0, "pilot", word) for word in words)
            fake.judged[RUN] = replace(make_judgement(time=61.0 + len(words)), log=(*lines, *said))
            await settle(pilot)

        await say(*[f"line {i}" for i in range(40)])
        assert log.is_vertical_scroll_end
        assert "line 39" in shown(pilot)
        log.scroll_to(y=3, animate=False)
        await settle(pilot)
        await say(*[f"line {i}" for i in range(60)])
        assert log.scroll_offset.y == 3


@pytest.mark.parametrize("size", [(80, 24), (120, 40), (200, 50), (40, 10)])
@pytest.mark.parametrize(
    ("live", "words"),
    [
        ((), "Nothing was heard of this run yet"),
        ((make_live(7, waiting=WAITING),), "Signals begin with simulated time"),
        ((make_live(7, 0.5),), "Signals and verdicts so far come in a moment"),
    ],
    ids=["unheard", "starting", "first-second"],
)
async def test_before_there_are_signals_the_screen_says_what_it_waits_for(size, live, words):
    async with opened(FakeDaemon(live=live), size) as pilot:
        await look_at(pilot)
        while size[0] < 110 and "[signals]" not in shown(pilot):
            await press(pilot, "tab")
        assert words.split()[0] in shown(pilot)
        told = str(pilot.app.screen.query_one("#untold").content)
        assert words in told


async def test_before_the_first_judgement_signals_are_those_that_snapshots_tell():
    fake = running()
    async with opened(fake) as pilot:
        await look_at(pilot)
        for words in ("loc.error", "0.141 m", "speed", "0.05 m/s", "come in a moment", "2 w2"):
            assert words in shown(pilot)
        assert "│ doors" not in shown(pilot)  # nothing is known of them yet
        fake.judged[RUN] = make_judgement()
        await settle(pilot)
        assert "clearance" in shown(pilot)
        assert "come in a moment" not in shown(pilot)


def test_of_a_long_run_moments_all_along_are_remembered():
    tracks = Tracks()
    for step in range(5000):
        tracks.add(make_live(7, step * 2.0))
    track = tracks.get(RUN)
    assert track is not None
    assert 200 < len(track.heard_of) <= 600
    assert track.heard_of[0].time == 0.0
    assert track.heard_of[-1].time == 9998.0


async def test_a_worker_that_tells_no_signals_is_said_to_be_one():
    fake = running()
    async with opened(fake) as pilot:
        await look_at(pilot)
        fake.now += 60.0
        await settle(pilot)
        assert "Its worker tells no signals" in shown(pilot)


async def test_a_run_nothing_is_heard_of_any_more_says_for_how_long():
    fake = running()
    clock = [0.0]
    app = make_dashboard(fake)
    # Before it begins: what is live is told once, and taken in as soon as there is a screen.
    app.tracks = Tracks(clock=lambda: clock[0])
    async with app.run_test(size=(120, 40)) as pilot:
        await look_at(pilot)
        assert "last heard" not in shown(pilot)
        clock[0] += 72.0
        await settle(pilot)
        assert "last heard 1 min 12 s ago" in shown(pilot)


async def test_the_worst_margin_so_far_stands_in_the_first_line():
    live = make_live(7, 60.0)
    snapshot = replace(live.snapshot, margin=-0.02, unit="m", oracle="clear")
    async with opened(FakeDaemon(live=(replace(live, snapshot=snapshot),))) as pilot:
        await look_at(pilot)
        assert "▶ running  1/3 wp  60 s of 1200 s  ✗ −0.02 m clear" in shown(pilot)


async def test_a_run_without_oracles_still_shows_signals_and_what_it_is():
    fake = running()
    fake.judged[RUN] = replace(make_judgement(), verdicts=())
    async with opened(fake) as pilot:
        await look_at(pilot)
        assert "S2/pilot/2" in shown(pilot)
        assert "clearance" in shown(pilot)
        assert "so far" not in shown(pilot)


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


async def test_a_run_that_ends_while_it_is_looked_at_stays_where_one_looked(tmp_path):
    fake = Ending(live=tuple(make_live(7, float(t)) for t in range(10)))
    fake.trace = record_run(tmp_path / "run.mcap", index=7)
    fake.judged[RUN] = make_judgement(time=9.0)
    async with opened(fake, (80, 24)) as pilot:
        await look_at(pilot)
        await press(pilot, "shift+tab")
        assert "[signals]" in shown(pilot)
        fake.over = True
        pilot.app.update_state()
        await pilot.pause(0)
        assert "clearance" in shown(pilot)  # no empty screen while the trace is read
        await settle(pilot)
        await pilot.app.workers.wait_for_complete()
        await settle(pilot)
        assert "[signals]" in shown(pilot)
        assert pilot.app.screen.transport.time == 10.0
        assert "10.0 s of 10.0 s" in shown(pilot)


async def test_the_trail_is_known_by_its_clearance():
    fake = running(120.0)
    fake.judged[RUN] = make_judgement(time=60.0)
    async with opened(fake) as pilot:
        await look_at(pilot)
        view = pilot.app.screen.query_one(TopView)._view
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


async def test_the_cursor_goes_back_in_a_run_that_goes_on_and_follows_again_at_the_end():
    fake = running()
    fake.judged[RUN] = make_judgement()
    async with opened(fake) as pilot:
        await look_at(pilot)
        screen = pilot.app.screen
        signals = screen.query_one(TimelineView)
        assert signals._time == 60.0
        await press(pilot, "shift+left", "shift+left", "shift+left")
        fake.watchers[RUN](make_live(7, 62.0))
        fake.judged[RUN] = make_judgement(time=62.0)
        await settle(pilot)
        assert signals._time == 30.0
        assert "30.0 s of 62.0 s" in shown(pilot)
        assert "end follows again" in shown(pilot)
        assert screen.query_one(TopView)._view.robot_pose == make_live(7, 30.0).snapshot.pose
        await press(pilot, "end")
        fake.judged[RUN] = make_judgement(time=64.0)
        fake.watchers[RUN](make_live(7, 64.0))
        await settle(pilot)
        assert signals._time == 64.0
        assert screen.query_one(TopView)._view.robot_pose == make_live(7, 64.0).snapshot.pose
        assert "follows again" not in shown(pilot)


async def test_space_stays_at_a_moment_of_a_run_that_goes_on_and_plays_from_there():
    fake = running()
    fake.judged[RUN] = make_judgement()
    async with opened(fake) as pilot:
        await look_at(pilot)
        assert "space Stay" in shown(pilot)
        await press(pilot, "space")
        fake.judged[RUN] = make_judgement(time=70.0)
        await settle(pilot)
        transport = pilot.app.screen.transport
        assert (transport.time, transport.end, transport.playing) == (60.0, 70.0, False)
        assert "space Play" in shown(pilot)
        await press(pilot, "space")
        assert transport.playing
        transport.advance(60.0)
        assert transport.follows


async def test_enter_on_a_verdict_so_far_goes_to_its_moment_and_the_list_alone_does_not():
    fake = running()
    fake.judged[RUN] = make_judgement()
    async with opened(fake) as pilot:
        await look_at(pilot)
        await press(pilot, "down")
        assert pilot.app.screen.transport.follows
        await press(pilot, "enter")
        assert pilot.app.screen.query_one(VerdictList).chosen().oracle == "clear"
        assert pilot.app.screen.transport.time == 27.0


def test_a_run_that_begins_anew_is_followed_from_its_start():
    transport = ReplayTransport(0.0, 50.0, 50.0, playing=False, live=True, follows=True)
    transport.go(20.0)
    transport.grow(0.0, 3.0)
    assert (transport.time, transport.follows) == (3.0, True)


async def test_a_run_that_begins_anew_has_not_failed_yet():
    fake = running()
    fake.judged[RUN] = make_judgement(contact=True)
    async with opened(fake) as pilot:
        await look_at(pilot)
        assert [one.oracle for one in pilot.app.screen.moments()] == ["no-contact"]
        del fake.judged[RUN]
        fake.watchers[RUN](make_live(7, 0.0))
        await settle(pilot)
        assert not pilot.app.screen.moments()


async def test_where_all_is_in_view_tab_goes_to_the_log_and_back():
    fake = running()
    fake.judged[RUN] = make_judgement()
    async with opened(fake) as pilot:
        await look_at(pilot)
        focused = []
        for _ in range(3):
            await press(pilot, "tab")
            focused.append(pilot.app.screen.focused.id)
        assert focused == ["log", "decided", "log"]
