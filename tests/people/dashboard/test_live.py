"""The view of a live world and its keys; the world's clock is turned by hand."""

from dataclasses import replace

import pytest

from daemon.live.simulation import LiveSimulation, LiveThread
from grammars.model.geometry import Twist2
from grammars.model.robot import Drive
from scenario_tui.dashboard.screens.help import Help
from scenario_tui.dashboard.screens.live import LiveScreen
from scenario_tui.dashboard.screens.standalone import StandaloneApp
from scenario_tui.dashboard.teleoperation import Teleoperation
from tests.batch.live.worlds import HandClock, demo_spec, demo_submission, go

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
        """Let time pass in the world, and return what is seen then."""
        go(self.simulation, self.clock, seconds)
        self.screen.show_moment()
        await dash.settle()
        return dash.lines


@pytest.fixture
def shown(campaigns):
    return Shown(campaigns)


@pytest.mark.parametrize("size", [(80, 24), (60, 16)])
async def test_what_there_is_to_see(dashboard, shown, size):
    dash = await dashboard(shown.app, size)
    lines = await shown.passes(dash, 2.0)
    assert lines[0].strip().startswith("▶ 1x  2.0 s  busy-house")
    assert any(sign in "\n".join(lines) for sign in "→↗↑↖←↙↓↘")
    assert "◆" in "\n".join(lines)
    assert "Foxglove ws://127.0.0.1:8765" in "\n".join(lines[-4:])
    assert size[0] < 80 or "q Quit" in dash.lines[-1]
    assert "Copy" not in dash.lines[-1]  # there is nothing to type


async def test_keys_for_time(dashboard, shown):
    dash = await dashboard(shown.app)
    await shown.passes(dash, 1.0)
    for key, said in (("plus", "2x"), ("plus", "5x"), ("minus", "2x"), ("minus", "1x"),
                      ("minus", "0.5x")):  # fmt: skip
        await dash.press(key)
        assert (await shown.passes(dash, 0.1))[0].strip().startswith(f"▶ {said}")
    await dash.press("space")
    lines = await shown.passes(dash, 1.0)
    assert lines[0].strip().startswith("‖ 0.5x")
    stood = shown.simulation.status.time
    await shown.passes(dash, 1.0)
    assert shown.simulation.status.time == stood
    await dash.press("space", "r")
    lines = await shown.passes(dash, 0.2)
    assert lines[0].strip().startswith("▶ 0.5x  0.1 s")
    for _ in range(20):
        await dash.press("plus")
        await shown.passes(dash, 0.05)
    assert shown.simulation.status.speed == 100.0


async def test_keys_drive_the_robot(dashboard, shown):
    dash = await dashboard(shown.app)
    await shown.passes(dash, 1.0)
    assert shown.simulation.view is not None
    start = shown.simulation.view.pose
    for _ in range(20):
        await dash.press("up")
        lines = await shown.passes(dash, 0.05)
    assert "driven by keys" in lines[0]
    driven = shown.simulation.view.pose
    assert abs(driven.x - start.x) + abs(driven.y - start.y) > 0.2
    for _ in range(10):
        await dash.press("a")
        await shown.passes(dash, 0.05)
    assert shown.simulation.view.pose.yaw - driven.yaw > 0.1
    await dash.press("x")
    lines = await shown.passes(dash, 3.0)
    assert "driven by" not in lines[0]
    rests = shown.simulation.view.pose
    await shown.passes(dash, 1.0)
    assert shown.simulation.view.pose == rests


async def test_what_goes_wrong_is_said(dashboard, shown):
    dash = await dashboard(shown.app, (120, 30))
    await shown.passes(dash, 0.5)
    late = replace(shown.simulation.status, late=True, reached=0.61, time=190.0, note="crashed")
    shown.simulation.status = late
    shown.screen.show_moment()
    await dash.settle()
    lines = dash.lines
    assert "cannot keep up: 0.6x" in lines[0]
    assert "past the scenario's 180 s" in lines[0]
    assert "crashed" in "\n".join(lines[-4:])
    shown.thread.failure = RuntimeError("gone")
    shown.screen.show_moment()
    await dash.settle()
    assert dash.app.return_code == 0


async def test_the_line_to_type_can_be_copied(dashboard, campaigns):
    shown = Shown(campaigns, LINE)
    copied = []
    dash = await dashboard(shown.app, (120, 30))
    shown.screen.app.copy_to_clipboard = copied.append
    await dash.press("y")
    assert copied == [LINE]
    await dash.press("question_mark")
    assert isinstance(dash.screen, Help)
    assert "Sideways" not in dash.text, "it has two wheels"
    await dash.press("escape", "z", "H", "F", "z", "q")
    await dash.leave()
    assert shown.simulation.watched is False


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
