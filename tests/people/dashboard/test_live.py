"""The view of a live world and its keys; the world's clock is turned by hand."""

from dataclasses import replace
from functools import partial

import pytest

from daemon.live.simulation import LiveSimulation, LiveThread
from grammars.model.geometry import Twist2
from grammars.model.robot import Drive
from scenario_tui.dashboard.screens.live import LiveScreen, Teleoperation
from scenario_tui.dashboard.screens.standalone import StandaloneApp
from tests.batch.live.worlds import HandClock, demo_spec, demo_submission, go
from tests.people.dashboard.journeys import LOOK, follow

LINE = "SCENARIO_SOCKET=/run/user/relay SCENARIO_NONCE=ab12 python3 relay.py"
DRIVE = Drive("differential", 0.8, 0.0, 0.7, 1.0, 1.0, 3.0, 80.0, 20.0, 0.5)


class Shown:
    """A view and the world behind it."""

    def __init__(self, campaigns, to_type=""):
        self.clock = HandClock()
        self.simulation = LiveSimulation(*demo_spec(demo_submission(campaigns)), clock=self.clock)
        self.simulation.step()  # its clock begins
        self.thread = LiveThread(self.simulation)
        self.connected = ["Foxglove ws://127.0.0.1:8765  nobody listens"]
        self.screen = LiveScreen(
            self.simulation, self.thread, lambda: self.connected, to_type, clock=self.clock
        )
        self.app = StandaloneApp(self.screen)

    async def passes(self, dash, seconds):
        """Let time pass in the world, and show what is seen then."""
        go(self.simulation, self.clock, seconds)
        self.screen.show_moment()
        await dash.settle()


@pytest.fixture
def shown(campaigns):
    return Shown(campaigns, LINE)


def damaged(shown, dash):
    status = shown.simulation.status
    changes = {"late": True, "reached": 0.61, "time": 190.0, "note": "crashed"}
    shown.simulation.status = replace(status, **changes)
    shown.screen.show_moment()


WAYS = {
    "looked-at": (
        (120, 30), [LOOK, 2.0, "y", "question_mark", "escape", "z", "H F", "z", damaged]
    ),
    "in-little-room": ((60, 16), [LOOK, 2.0]),
    "in-time": (
        (80, 24),
        [1.0, *["plus", 0.1] * 2, *["minus", 0.1] * 3, "space", 1.0, 1.0, "space r", 0.2,
         *["plus", 0.05] * 8],
    ),
}  # fmt: skip
"""Sizes and steps: keys, seconds that pass in the world, and what happens to it."""


@pytest.mark.parametrize("name", WAYS)
async def test_a_way_through_a_live_world_is_as_it_was(dashboard, golden, shown, name):
    def action(step):
        if isinstance(step, float):
            return f"{step} s", lambda dash: shown.passes(dash, step)
        return step if isinstance(step, str) else (step.__name__, partial(step, shown))

    size, steps = WAYS[name]
    text = await follow(await dashboard(shown.app, size), [action(step) for step in steps])
    golden(f"journeys/live-{name}.txt", text)


async def test_keys_drive_the_robot(dashboard, shown):
    dash = await dashboard(shown.app)
    await shown.passes(dash, 1.0)
    start = shown.simulation.view.pose
    for _ in range(20):
        await dash.press("up")
        await shown.passes(dash, 0.05)
    assert "driven by keys" in dash.lines[0]
    driven = shown.simulation.view.pose
    assert abs(driven.x - start.x) + abs(driven.y - start.y) > 0.2
    for _ in range(10):
        await dash.press("a")
        await shown.passes(dash, 0.05)
    assert shown.simulation.view.pose.yaw - driven.yaw > 0.1
    await dash.press("x")
    await shown.passes(dash, 3.0)
    assert "driven by" not in dash.lines[0]
    rests = shown.simulation.view.pose
    await shown.passes(dash, 1.0)
    assert shown.simulation.view.pose == rests


@pytest.mark.parametrize("broken", [False, True])
async def test_nobody_watches_a_world_that_was_left_or_broke(dashboard, shown, broken):
    dash = await dashboard(shown.app)
    assert shown.simulation.watched
    if broken:
        shown.thread.failure = RuntimeError("gone")
        await shown.passes(dash, 0.05)
    else:
        await dash.press("q")
    await dash.leave()
    assert dash.app.return_code == 0
    assert not shown.simulation.watched


def test_a_tap_drives_for_a_moment_and_stops():
    clock = HandClock()
    keys = Teleoperation(DRIVE, clock)
    assert keys.command() is None
    keys.press("vx", 1)
    assert keys.command() == Twist2(0.5, 0.0, 0.0)
    clock.now += 0.5
    assert keys.command() == Twist2(0.5, 0.0, 0.0), "until a key would be repeated"
    clock.now += 0.2
    assert keys.command() == Twist2(), "told once that it stops"
    assert keys.command() is None


def test_a_key_that_is_held_and_let_go():
    clock = HandClock()
    keys = Teleoperation(DRIVE, clock)
    keys.press("wz", -1)
    clock.now += 0.5
    for _ in range(20):
        clock.now += 0.03
        keys.press("wz", -1)
        assert keys.command() == Twist2(0.0, 0.0, -0.7), "what the drive can at most"
    clock.now += 0.3
    assert keys.command() == Twist2()


def test_two_keys_drive_a_curve_and_the_other_direction_takes_over():
    clock = HandClock()
    keys = Teleoperation(DRIVE, clock)
    keys.press("vx", 1)
    clock.now += 0.4
    keys.press("wz", 1)
    assert keys.command() == Twist2(0.5, 0.0, 0.7)
    for _ in range(30):
        clock.now += 0.03
        keys.press("wz", 1)
    assert keys.command() == Twist2(0.5, 0.0, 0.7), "a terminal repeats the last key only"
    keys.press("vx", -1)
    assert keys.command() == Twist2(-0.5, 0.0, 0.7)
    keys.stop()
    assert keys.command() == Twist2()
