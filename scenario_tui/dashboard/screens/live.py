"""A live world from above, its speed and who is connected; the robot is driven by keys."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import ClassVar, Final

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.widgets import Static

from daemon.live.simulation import LiveSimulation, LiveStatus, LiveThread
from daemon.model.status import LiveSnapshot
from scenario_tui.dashboard.live_run import tracked_view
from scenario_tui.dashboard.live_tracks import Tracks
from scenario_tui.dashboard.screens.maps import MapActions
from scenario_tui.dashboard.screens.standalone import StandaloneScreen
from scenario_tui.dashboard.teleoperation import Axis, Teleoperation
from scenario_tui.dashboard.transport import next_speed
from scenario_tui.dashboard.widgets.key_footer import KeyFooter
from scenario_tui.dashboard.widgets.map_legend import MapLegend
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.text.styles import BAD, QUIET, UNSURE

FRAMES: Final = 10
"""How often a second the view is drawn."""
COMMANDS: Final = 20
"""How often a second a key that is held commands: more often than the timeout of any drive."""
FASTEST: Final = 100.0
"""Times as fast as the clock on the wall that a stack may be served at most."""
SOURCE: Final = "keys"
"""Whose commands those of this screen are."""


class LiveScreen(StandaloneScreen, MapActions):
    """Shows and steers a simulation that runs in a thread of its own.

    ``serving`` says where it is served and who is connected, a line each; ``to_type`` is what a
    stack's terminal needs to connect.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "pause", "Pause", id="live-pause", tooltip="Stand still, or go on"),
        Binding("plus,equals_sign", "faster(1)", "Faster", key_display="+", id="live-faster",
                tooltip="Up to 100x"),
        Binding("minus", "faster(-1)", "Slower", key_display="-", show=False, id="live-slower",
                tooltip="Down to 0.1x"),
        Binding("r", "reset", "Reset", id="live-reset",
                tooltip="The same world from its beginning"),
        Binding("up,w", "drive('vx', 1)", "Drive", id="live-forward",
                tooltip="Forward; the other arrows go back and turn"),
        Binding("down,s", "drive('vx', -1)", "Backward", show=False, id="live-backward",
                tooltip="Two keys at once drive a curve"),
        Binding("left,a", "drive('wz', 1)", "Turn left", show=False, id="live-left",
                tooltip="On the spot when nothing else is held"),
        Binding("right,d", "drive('wz', -1)", "Turn right", show=False, id="live-right",
                tooltip="On the spot when nothing else is held"),
        Binding("shift+left,A", "drive('vy', 1)", "Sideways left", show=False,
                id="live-sideways-left", tooltip="Omnidirectional bases"),
        Binding("shift+right,D", "drive('vy', -1)", "Sideways right", show=False,
                id="live-sideways-right", tooltip="Omnidirectional bases"),
        Binding("x", "stop", "Stop", show=False, id="live-stop",
                tooltip="At once, whatever key is held"),
        Binding("y", "copy", "Copy", id="copy",
                tooltip="What to type in a terminal of your ROS 2, into the clipboard"),
    ]  # fmt: skip

    def __init__(
        self,
        simulation: LiveSimulation,
        thread: LiveThread,
        serving: Callable[[], Sequence[str]] = tuple,
        to_type: str = "",
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self._simulation, self._thread = simulation, thread
        self._serving, self._to_type = serving, to_type
        self._keys = Teleoperation(simulation.spec.robot.drive, clock)
        self._tracks = Tracks(clock)

    def compose(self) -> ComposeResult:
        """Lay out headline, map, who is connected, and keys."""
        yield StaticText(id="status")
        yield TopView(id="map")
        yield StaticText(id="serving")
        yield MapLegend(id="legend")
        yield KeyFooter()

    def on_mount(self) -> None:
        """Look at the world from now on."""
        self._simulation.watched = True
        self.set_interval(1.0 / FRAMES, self.show_moment)
        self.set_interval(1.0 / COMMANDS, self.command)
        self.show_moment()

    def on_unmount(self) -> None:
        """Look no more."""
        self._simulation.watched = False

    def show_moment(self) -> None:
        """Show how it goes and what there is to see."""
        if not self.is_attached or not self.app.is_running:
            return
        if self._thread.failure is not None:
            # Nothing goes on any more: whoever started this says why.
            self.app.exit()
            return
        simulation = self._simulation
        head = live_line(simulation.status, simulation.spec.scenario)
        self.query_one("#status", Static).update(head)
        lines = [*self._serving(), *([simulation.status.note] if simulation.status.note else ())]
        self.query_one("#serving", Static).update(Text("\n".join(lines), style=QUIET))
        if simulation.view is not None:
            self._tracks.add(LiveSnapshot("", simulation.view))
        track = self._tracks.get("")
        if track is not None:
            view = tracked_view(simulation.scene, simulation.spec, track)
            self.query_one(TopView).show(view)

    def command(self) -> None:
        """Command what the keys say."""
        twist = self._keys.command()
        if twist is not None:
            self._simulation.command(twist, SOURCE)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Offer only what this robot can do, and to copy only what there is."""
        if action == "copy":
            return bool(self._to_type)
        if action == "drive" and parameters[:1] == ("vy",):
            return self._simulation.spec.robot.drive.kind == "omnidirectional"
        return super().check_action(action, parameters)

    def action_pause(self) -> None:
        """Stand still, or go on."""
        self._simulation.toggle()

    def action_faster(self, step: int) -> None:
        """Go at the next speed, or the one before."""
        speed = next_speed(self._simulation.status.speed, step)
        self._simulation.set_speed(min(speed, FASTEST))

    def action_reset(self) -> None:
        """Begin anew."""
        self._keys.stop()
        self._simulation.reset()

    def action_drive(self, axis: Axis, sign: int) -> None:
        """Drive as long as a key is held."""
        self._keys.press(axis, sign)
        self.command()

    def action_stop(self) -> None:
        """Stop at once."""
        self._keys.stop()
        self.command()

    def action_copy(self) -> None:
        """Put what is to be typed elsewhere into the clipboard."""
        self.app.copy_to_clipboard(self._to_type)
        self.notify(f"copied: {self._to_type}", markup=False)


def live_line(status: LiveStatus, scenario: str) -> Text:
    """Return ``▶ 1x  12.3 s  busy-house  keys drive`` and what is wrong."""
    sign = "‖" if status.paused else "▶"
    text = Text(f"{sign} {status.speed:g}x  {status.time:.1f} s  {scenario}", no_wrap=True,
                overflow="ellipsis")  # fmt: skip
    if status.driver:
        text.append(f"  driven by {status.driver}")
    if status.late and not status.paused:
        text.append(f"  cannot keep up: {status.reached:.1f}x", style=BAD)
    if status.time > status.limit:
        text.append(f"  past the scenario's {status.limit:g} s", style=UNSURE)
    return text
