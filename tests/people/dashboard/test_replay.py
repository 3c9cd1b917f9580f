"""Every key of the replay, on a recorded run of ten seconds."""

import re

import pytest
from textual.events import MouseScrollDown, MouseScrollUp

from scenario_tui.dashboard.playback import open_playback
from scenario_tui.dashboard.screens.help import Help
from scenario_tui.dashboard.screens.replay import ReplayScreen
from scenario_tui.dashboard.screens.standalone import StandaloneApp
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.top_view import TopView
from tests.people.dashboard.inline import screen_text
from tests.people.recorded import HIT, TURNED, record_run


@pytest.fixture(scope="module")
def playback(tmp_path_factory):
    return open_playback(record_run(tmp_path_factory.mktemp("traces") / "run.mcap"))


class Clock:
    """Stands still unless it is moved."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def opened(playback, begin=2.0, size=(80, 24)):
    screen = ReplayScreen(playback, begin, clock=Clock())
    return StandaloneApp(screen).run_test(size=size)


def shown(pilot):
    return "\n".join(screen_text(pilot))


def head(pilot):
    return screen_text(pilot)[0].strip()


async def test_keys_move_through_the_run(playback):
    async with opened(playback) as pilot:
        await pilot.pause(0)
        assert head(pilot).startswith("▶ 1x  S2/pilot/0  2.0 s of 10.0 s  reached 0 of 3")
        for key, time in (
            ("right", "3.0"), ("left", "2.0"), ("shift+right", "10.0"), ("shift+left", "0.0"),
            ("end", "10.0"), ("home", "0.0"), ("n", f"{HIT}"), ("n", f"{TURNED}"),
            ("n", f"{HIT}"), ("N", f"{TURNED}"), ("N", f"{HIT}"),
        ):  # fmt: skip
            await pilot.press(key)
            await pilot.pause(0)
            assert f"  {time} s of 10.0 s" in head(pilot), key
        assert head(pilot).startswith("‖")
        assert "✱" in shown(pilot)


async def test_it_opens_at_what_decided_and_waits(playback):
    async with opened(playback, None) as pilot:
        await pilot.pause(0)
        assert head(pilot).startswith(f"‖ 1x  S2/pilot/0  {TURNED} s of 10.0 s")
        await pilot.press("n")
        await pilot.pause(0)
        assert f"  {HIT} s of 10.0 s" in head(pilot)


async def test_a_run_that_passes_is_played_from_its_start(tmp_path):
    passed = open_playback(record_run(tmp_path / "run.mcap"), ())
    async with opened(passed, None) as pilot:
        await pilot.pause(0)
        assert head(pilot).startswith("▶ 1x  S2/pilot/0  0.0 s of 10.0 s")


async def test_time_passes_while_it_plays_and_not_while_it_pauses(playback):
    async with opened(playback) as pilot:
        screen = pilot.app.screen
        await pilot.press("space")
        screen.clock.now += 1.0
        screen.tick()
        assert screen.transport.time == 2.0
        await pilot.press("space", "plus")
        screen.clock.now += 1.0
        screen.tick()
        await pilot.pause(0)
        assert screen.transport.time == pytest.approx(4.0)
        assert head(pilot).startswith("▶ 2x")
        await pilot.press("minus", "minus")
        await pilot.pause(0)
        assert head(pilot).startswith("▶ 0.5x")
        screen.clock.now += 60.0
        screen.tick()
        await pilot.pause(0)
        assert head(pilot).startswith("‖ 0.5x  S2/pilot/0  10.0 s of 10.0 s")


async def test_the_wheel_comes_nearer_to_the_robot_and_goes_back(playback):
    async with opened(playback) as pilot:
        top = pilot.app.screen.query_one(TopView)
        zooms = []
        for kind in (MouseScrollUp, MouseScrollUp, MouseScrollDown, MouseScrollDown):
            await pilot._post_mouse_events([kind], top, offset=(5, 5))
            await pilot.pause()
            zooms.append(top._zoom)
        assert zooms == [2, 4, 2, 1]


async def test_contacts_are_not_missed_between_two_frames(playback):
    async with opened(playback) as pilot:
        screen = pilot.app.screen
        screen.transport.speed = 50.0
        screen.clock.now += 0.1
        screen.tick()  # from 2 s to 7 s, the contact was at 6 s
        await pilot.pause(0)
        assert "✱" in shown(pilot)


async def test_z_comes_nearer_and_question_mark_lists_the_keys(playback):
    async with opened(playback, size=(80, 60)) as pilot:
        await pilot.press("z")
        assert pilot.app.screen.query_one(TopView)._zoom == 2
        await pilot.press("z", "Z")
        assert pilot.app.screen.query_one(TopView)._zoom == 1
        await pilot.press("question_mark")
        await pilot.pause(0)
        assert isinstance(pilot.app.screen, Help)
        for words in ("Play: Or pause", "Faster: Up to 1000x", "Next ✗", "Previous ✗", "+10 s"):
            assert words in shown(pilot)
        await pilot.press("escape")
        assert isinstance(pilot.app.screen, ReplayScreen)


async def test_q_leaves(playback):
    async with opened(playback) as pilot:
        await pilot.press("q")
        await pilot.pause(0)
        assert pilot.app._exit


@pytest.mark.parametrize("size", [(40, 10), (160, 50)])
async def test_it_fits_into_any_terminal(playback, size):
    async with opened(playback, HIT, size) as pilot:
        await pilot.pause(0)
        assert "6.0 s" in shown(pilot)
        assert pilot.app.screen.query_one(TopView).size.height >= 3


def test_what_it_looks_like(snap_compare, playback):
    screen = ReplayScreen(playback, HIT, clock=Clock())
    assert snap_compare(StandaloneApp(screen), terminal_size=(80, 24))


async def test_a_click_in_a_signal_goes_to_its_moment_and_keys_show_less_of_the_time(playback):
    async with opened(playback, size=(160, 40)) as pilot:
        await pilot.pause()
        signals = pilot.app.screen.query_one(TimelineView)
        start, end = 27, signals.size.width - 1
        await pilot.click(signals, offset=((start + end) // 2, 4))
        await pilot.pause()
        assert pilot.app.screen.transport.time == pytest.approx(5.0, abs=0.2)
        assert head(pilot).startswith("‖ 1x")
        await pilot.press("right_parenthesis", "right_parenthesis")
        await pilot.pause()
        assert re.search(r"2.\d+–7.\d+ s of 10.0 s", shown(pilot))
        await pilot.press("left_parenthesis")
        await pilot.pause()
        assert re.search(r"1.\d+–8.\d+ s of 10.0 s", shown(pilot))
        await pilot.press("Z")
        await pilot.pause()
        assert "s of 10.0 s" not in shown(pilot).partition("\n")[2]
