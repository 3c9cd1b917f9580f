"""A recorded run at any moment: what was recorded until then; every key of its replay."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from textual.events import MouseScrollDown, MouseScrollUp

from daemon.trace import TraceError
from grammars.model.robot import Mount
from scenario_tui.dashboard.playback import Playback, open_playback, render_frame, timeline_bar
from scenario_tui.dashboard.screens.replay import ReplayScreen
from scenario_tui.dashboard.screens.standalone import StandaloneApp
from scenario_tui.dashboard.transport import next_speed
from scenario_tui.dashboard.widgets.map_frame import draw_view
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.text.run_text import verdict_lines
from tests.people.fake import ROBOT
from tests.people.recorded import HIT, TURNED, record_run


@pytest.fixture(scope="module")
def playback(tmp_path_factory):
    return open_playback(record_run(tmp_path_factory.mktemp("traces") / "run.mcap"))


def test_a_view_shows_what_was_recorded_until_then(playback):
    view = playback.view(4.0)
    assert view.where.x == pytest.approx(3.0)
    assert view.joints == (pytest.approx(-0.4),)
    assert view.estimate is not None
    assert view.estimate.x == pytest.approx(3.2)
    assert view.reached == 0
    assert view.trail[0] == (1.0, 2.0)
    assert view.trail[-1] == (pytest.approx(3.0), 2.0)
    assert max(x for x, _ in view.trail) <= 3.0
    assert view.plan == ((1.0, 2.0), (4.0, 2.0))
    later = playback.view(7.0)
    assert later.plan == ((4.0, 2.0), (8.0, 1.0))
    assert later.reached == 1


def test_laser_returns_stand_around_the_mount_of_the_laser(playback):
    view = playback.view(4.9)  # the last scan was at 4 s, when the robot stood at x = 3
    assert 0 < len(view.returns) <= 120
    eye = (3.0 + 0.2, 2.0)
    assert all(math.dist(eye, p) == pytest.approx(1.5, abs=1e-6) for p in view.returns)
    assert view.returns[0] == (pytest.approx(3.2), pytest.approx(0.5))


def test_returns_of_every_laser_are_shown(playback, tmp_path):
    rear = replace(ROBOT.laser, name="rear", mount=Mount(-1.0, 0.0, math.pi))
    robot = replace(ROBOT, laser=replace(ROBOT.laser, name="front"), other_lasers=(rear,))
    both = open_playback(record_run(tmp_path / "run.mcap", robot=robot)).view(4.9).returns
    front = playback.view(4.9).returns
    assert both[: len(front)] == front
    eye = (3.0 - 1.0, 2.0)
    behind = both[len(front) :]
    assert len(behind) == len(front)
    assert all(math.dist(eye, p) == pytest.approx(1.5, abs=1e-6) for p in behind)


def test_contacts_flash_for_a_moment(playback):
    assert playback.view(HIT - 0.1).contacts == ()
    assert playback.view(HIT + 0.3).contacts == ((pytest.approx(4.35), 2.0),)
    assert playback.view(HIT + 2.0).contacts == ()
    assert len(playback.view(HIT + 2.0, window=3.0).contacts) == 1
    flash = draw_view(playback.view(HIT + 0.1), 60, 20).cells()[0]
    assert ord("✱") in flash
    assert ord("✱") not in draw_view(playback.view(2.0), 60, 20).cells()[0]


def test_the_moment_that_decides_a_verdict_shows_the_object_that_does(playback):
    assert playback.view(HIT - 0.1).decisive is None
    mark = playback.view(HIT + 0.1).decisive
    assert (mark.name, mark.fails) == ("door-1.leaf", True)
    (start, end) = mark.line
    assert start == pytest.approx((4.0 + 0.35, 2.25), abs=0.1)
    assert end[1] > 3.0
    assert playback.view(HIT + 1.0).decisive is None
    turned = playback.view(TURNED).decisive
    assert (turned.name, turned.words) == ("robot", "calm −0.4 rad/s")


def test_a_verdict_that_is_chosen_shows_its_own_object(playback):
    slow = next(verdict for verdict in playback.verdicts if verdict.oracle == "slow")
    mark = playback.view(slow.moment, verdict=slow).decisive
    assert (mark.name, mark.words, mark.fails) == ("robot", "slow +0.1 m/s", False)
    assert playback.view(HIT, verdict=slow).decisive is None


def test_plans_are_dotted_where_trails_are_not(playback):
    view = replace(playback.view(0.0), returns=(), estimate=None)
    with_plan = draw_view(view, 80, 24).cells()[0]
    without = draw_view(replace(view, plan=()), 80, 24).cells()[0]
    assert 0 < np.count_nonzero(with_plan != without) < 3.0 / 12.4 * 80


def test_moments_are_those_oracles_were_decided_against(playback):
    assert [(m.time, m.oracle) for m in playback.moments] == [(HIT, "no-contact"), (TURNED, "calm")]


@pytest.mark.parametrize(
    ("text", "time"), [("3.5", 3.5), ("1e9", 10.0), ("-4", 0.0), ("calm", TURNED)]
)
def test_a_moment_is_named_by_seconds_or_oracle(playback, text, time):
    assert playback.time_of(text) == time


@pytest.mark.parametrize("text", ["nan", "clam", ""])
def test_what_is_no_moment_is_refused(playback, text):
    with pytest.raises(ValueError, match=r"no number of seconds and no\W+oracle"):
        playback.time_of(text)


def test_frames_look_as_they_did(playback, golden):
    slow = next(verdict for verdict in playback.verdicts if verdict.oracle == "slow")
    texts = []
    for time, verdict, size in (
        (6.2, None, (80, 23)),
        (slow.moment, slow, (80, 23)),
        (5.0, None, (40, 10)),
        (5.0, None, (20, 6)),
    ):
        lines = render_frame(playback, time, *size, verdict=verdict)
        assert all(line.cell_len <= size[0] for line in lines)
        assert timeline_bar(playback, time, size[0]).cell_len == size[0]
        texts += [f"--- {time} s, {size}", *(line.plain.rstrip() for line in lines)]
    golden("screens/frames.txt", "\n".join([*texts, ""]))


def test_verdicts_that_do_not_fit_are_counted(playback):
    lines = [line.plain for line in verdict_lines(playback.verdicts, 0.0, most=2)]
    assert len(lines) == 2
    assert lines[1] == "and 1 more not passed, ✓ 1 pass"


def test_a_trace_without_a_robot_is_no_replay(playback, tmp_path):
    way = playback.trace.ground_truth
    nothing = replace(way, **{name: np.empty(0) for name in ("time", "x", "y", "yaw")})
    with pytest.raises(TraceError, match="where the robot was"):
        Playback(replace(playback.trace, ground_truth=nothing), (), {}, {})


def test_speeds_go_from_a_tenth_to_a_thousand():
    assert next_speed(3.0, 1) == 5.0
    assert next_speed(3.0, -1) == 2.0
    assert next_speed(1000.0, 1) == 1000.0
    assert next_speed(0.1, -1) == 0.1


class Replay:
    """The screen of a replay whose clock is turned by hand."""

    def __init__(self, dashboard, playback):
        self._dashboard, self._playback, self._now = dashboard, playback, 0.0

    async def open(self, begin=2.0, size=(80, 24)):
        screen = ReplayScreen(self._playback, begin, clock=lambda: self._now)
        self.dash = await self._dashboard(StandaloneApp(screen), size)
        return self.dash

    @property
    def head(self):
        return self.dash.lines[0].strip()

    async def passes(self, seconds):
        self._now += seconds
        self.dash.screen.tick()
        await self.dash.settle()


@pytest.fixture
def replay(dashboard, playback):
    return Replay(dashboard, playback)


async def test_keys_move_through_the_run(replay):
    dash = await replay.open()
    assert replay.head.startswith("▶ 1x  S2/pilot/0  2.0 s of 10.0 s  reached 0 of 3")
    for key, time in (
        ("right", "3.0"), ("left", "2.0"), ("shift+right", "10.0"), ("shift+left", "0.0"),
        ("end", "10.0"), ("home", "0.0"), ("n", f"{HIT}"), ("n", f"{TURNED}"),
        ("n", f"{HIT}"), ("N", f"{TURNED}"), ("N", f"{HIT}"),
    ):  # fmt: skip
        await dash.press(key)
        assert f"  {time} s of 10.0 s" in replay.head, key
    assert replay.head.startswith("‖")
    await dash.press("q")
    assert dash.app._exit


async def test_it_opens_at_what_decided_and_waits_or_plays_a_run_that_passes(dashboard, playback):
    passed = Playback(playback.trace, (), {}, {})
    for shown, head in (
        (playback, f"‖ 1x  S2/pilot/0  {TURNED} s"),
        (passed, "▶ 1x  S2/pilot/0  0.0 s"),
    ):
        replay = Replay(dashboard, shown)
        await replay.open(None)
        assert replay.head.startswith(f"{head} of 10.0 s")


async def test_time_passes_while_it_plays_and_not_while_it_pauses(replay):
    dash = await replay.open()
    await dash.press("space")
    await replay.passes(1.0)
    assert dash.screen.transport.time == 2.0
    await dash.press("space", "plus")
    await replay.passes(1.0)
    assert dash.screen.transport.time == pytest.approx(4.0)
    assert replay.head.startswith("▶ 2x")
    await dash.press("minus", "minus")
    assert replay.head.startswith("▶ 0.5x")
    await replay.passes(60.0)
    assert replay.head.startswith("‖ 0.5x  S2/pilot/0  10.0 s of 10.0 s")
    await dash.press("space")
    assert replay.head.startswith("▶ 0.5x  S2/pilot/0  0.0 s of 10.0 s")


async def test_contacts_are_not_missed_between_two_frames(replay):
    dash = await replay.open()
    dash.screen.transport.speed = 50.0
    await replay.passes(0.1)  # from 2 s to 7 s, the contact was at 6 s
    assert "✱" in dash.text


async def test_keys_and_the_wheel_come_nearer_to_the_robot_and_go_back(replay):
    dash = await replay.open()
    await dash.press("space")
    seen = []
    for kind in (None, MouseScrollUp, MouseScrollUp, MouseScrollDown, MouseScrollDown):
        if kind:
            await dash.pilot._post_mouse_events([kind], dash.one(TopView), offset=(5, 5))
            await dash.settle()
        seen.append(dash.lines[2:-1])
    for key in ("z", "z", "Z"):
        await dash.press(key)
        seen.append(dash.lines[2:-1])
    assert [seen.index(shown) for shown in seen] == [0, 1, 2, 1, 0, 1, 2, 0]


async def test_it_fits_into_a_small_terminal(replay):
    dash = await replay.open(HIT, (40, 10))
    assert "6.0 s" in dash.text
    assert dash.one(TopView).size.height >= 3


async def test_a_click_in_a_signal_goes_to_its_moment_and_keys_show_less_of_the_time(replay):
    dash = await replay.open(size=(160, 40))
    signals = dash.one(TimelineView)
    await dash.pilot.click(signals, offset=((27 + signals.size.width - 1) // 2, 4))
    await dash.settle()
    assert dash.screen.transport.time == pytest.approx(5.0, abs=0.2)
    assert replay.head.startswith("‖ 1x")
    await dash.press("right_parenthesis", "right_parenthesis")
    assert re.search(r"2.\d+–7.\d+ s of 10.0 s", dash.text)
    await dash.press("left_parenthesis")
    assert re.search(r"1.\d+–8.\d+ s of 10.0 s", dash.text)
    await dash.press("Z")
    assert "s of 10.0 s" not in dash.text.partition("\n")[2]
