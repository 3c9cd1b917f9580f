"""A run looked at while it goes on: signals, verdicts and log so far, and what is said without."""

from dataclasses import replace

import numpy as np
import pytest
from textual.containers import VerticalScroll

from daemon.model.live_judgement import LogLine
from scenario_tui.dashboard.live_run import LiveRun, live_text
from scenario_tui.dashboard.run_timeline import clearance_along, heard_timeline, live_timeline
from scenario_tui.dashboard.run_watch import RunNews, Tracks
from scenario_tui.dashboard.transport import ReplayTransport
from tests.people.fake import (
    CAMPAIGN,
    FakeDaemon,
    make_judgement,
    make_live,
    make_row,
    make_scene,
    make_spec,
)

RUN = f"{CAMPAIGN}.7"
SPEC = make_spec(make_row(7), "")


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


async def test_the_log_follows_its_end_unless_somebody_scrolled_up(dashboard):
    fake = FakeDaemon(live=(make_live(7, 60.0),), judged={RUN: make_judgement()})
    dash = await dashboard(fake, (120, 40), run=RUN)
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


def test_the_worst_margin_so_far_stands_in_the_first_line():
    live = make_live(7, 60.0)
    snapshot = replace(live.snapshot, margin=-0.02, unit="m", oracle="clear")
    track = tracked(replace(live, snapshot=snapshot))
    assert live_text(track, 5.0, wide=True).plain == "  1/3 wp  60 s of 1200 s  ✗ −0.02 m clear"
    assert live_text(track, 5.0, wide=False).plain == "  1/3 wp  60 s  ✗ −0.02 m clear"


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


def test_a_trail_grows_with_the_way_and_starts_anew_with_a_new_attempt():
    way = [make_live(7, time) for time in (0.0, 0.1, 20.0, 40.0)]
    assert len(tracked(*way).trail) == 3  # 5 mm are no step
    assert len(tracked(*way, way[0]).trail) == 1


def test_of_a_long_run_a_coarser_trail_and_moments_all_along_are_remembered():
    track = tracked(*(make_live(7, step * 2.0) for step in range(8_000)))
    assert 500 < len(track.trail) <= 2000
    assert track.trail[0] == (1.0, 2.0)
    assert track.trail[-1][0] == pytest.approx(801.0, abs=2.0)
    assert 200 < len(track.heard_of) <= 600
    assert (track.heard_of[0].time, track.heard_of[-1].time) == (0.0, 15_998.0)
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
