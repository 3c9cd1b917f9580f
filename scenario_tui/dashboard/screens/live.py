"""A live world from above, with its speed and its clients; keys drive the robot."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import ClassVar, Final, Literal, TypeAlias

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.widgets import Static

from daemon.live.simulation import LiveSimulation, LiveStatus, LiveThread
from daemon.model.status import LiveSnapshot
from grammars.model.geometry import Twist2
from grammars.model.robot import Drive
from scenario_tui.dashboard.live_run import tracked_view
from scenario_tui.dashboard.run_watch import Tracks
from scenario_tui.dashboard.screens.playing import MapActions
from scenario_tui.dashboard.screens.standalone import StandaloneScreen
from scenario_tui.dashboard.transport import next_speed
from scenario_tui.dashboard.widgets.key_footer import KeyFooter
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.top_view import MapLegend, TopView
from scenario_tui.text.styles import BAD, QUIET, UNSURE

FRAMES: Final = 10
"""Frames per second."""
COMMANDS: Final = 20
"""Commands per second of a held key, more often than the timeout of any drive."""
FASTEST: Final = 100.0
"""Largest speed for a stack, as a multiple of real time."""
SOURCE: Final = "keys"
"""Name of the source of this screen's commands."""
Axis: TypeAlias = Literal["vx", "vy", "wz"]

SPEED: Final = 0.5
"""Largest speed of driving [m/s], as far as the drive allows."""
TURNING: Final = 1.0
"""Largest speed of turning [rad/s], as far as the drive allows."""

_FIRST: Final = 0.6
"""Seconds for which a pressed key counts as held. Before its first repetition, after half a second
on most machines, a tap looks like a held key.
"""
_REPEATED: Final = 0.25
"""Seconds for which a repeated key counts as held; repetitions come 20 to 40 times a second."""


class Teleoperation:
    """The command of the held keys; two of them, one per axis, drive a curve."""

    def __init__(self, drive: Drive, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        speeds = (drive.max_vx, drive.max_vy, drive.max_wz)
        most = (SPEED, SPEED, TURNING)
        axes: tuple[Axis, ...] = ("vx", "vy", "wz")
        self._most = {axis: min(a, b) for axis, a, b in zip(axes, speeds, most, strict=True)}
        self._held: dict[Axis, tuple[float, float]] = {}
        self._moving = False

    def press(self, axis: Axis, sign: int) -> None:
        """Take a pressed or repeated key; ``sign`` is 1 or -1."""
        now, value = self._clock(), sign * self._most[axis]
        before, until = self._held.get(axis, (0.0, 0.0))
        again = before == value and now < until
        self._held[axis] = (value, now + (_REPEATED if again else _FIRST))
        # A terminal repeats only the last of two held keys, so its repetition keeps the other.
        for other, (speed, end) in self._held.items():
            if again and other != axis and now < end:
                self._held[other] = (speed, now + _REPEATED)

    def stop(self) -> None:
        """Release all keys."""
        self._held.clear()

    def command(self) -> Twist2 | None:
        """Return the command of the held keys; without any, one stop, then ``None``."""
        now = self._clock()
        speeds = {axis: value for axis, (value, until) in self._held.items() if now < until}
        was_moving, self._moving = self._moving, bool(speeds)
        if speeds:
            return Twist2(speeds.get("vx", 0.0), speeds.get("vy", 0.0), speeds.get("wz", 0.0))
        return Twist2() if was_moving else None


class LiveScreen(StandaloneScreen, MapActions):
    """Shows and steers a simulation that runs in its own thread.

    ``serving`` returns lines with addresses and clients; ``to_type`` is the command that connects
    a stack.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "pause", "Pause", id="live-pause", tooltip="Pause, or continue"),
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
                tooltip="On the spot without another key"),
        Binding("right,d", "drive('wz', -1)", "Turn right", show=False, id="live-right",
                tooltip="On the spot without another key"),
        Binding("shift+left,A", "drive('vy', 1)", "Sideways left", show=False,
                id="live-sideways-left", tooltip="Omnidirectional bases"),
        Binding("shift+right,D", "drive('vy', -1)", "Sideways right", show=False,
                id="live-sideways-right", tooltip="Omnidirectional bases"),
        Binding("x", "stop", "Stop", show=False, id="live-stop",
                tooltip="At once, even with a held key"),
        Binding("y", "copy", "Copy", id="copy",
                tooltip="The command for a terminal of your ROS 2, into the clipboard"),
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
        """Lay out headline, map, addresses, and keys."""
        yield StaticText(id="status")
        yield TopView(id="map")
        yield StaticText(id="serving")
        yield MapLegend(id="legend")
        yield KeyFooter()

    def on_mount(self) -> None:
        """Start to watch the world."""
        self._simulation.watched = True
        self.set_interval(1.0 / FRAMES, self.show_moment)
        self.set_interval(1.0 / COMMANDS, self.command)
        self.show_moment()

    def on_unmount(self) -> None:
        """Stop watching the world."""
        self._simulation.watched = False

    def show_moment(self) -> None:
        """Show the status and the view of the world."""
        if not self.is_attached or not self.app.is_running:
            return
        if self._thread.failure is not None:
            # The simulation has failed, and the caller of this app reports it.
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
        """Send the command of the held keys."""
        twist = self._keys.command()
        if twist is not None:
            self._simulation.command(twist, SOURCE)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Offer only motions of this robot, and to copy only an existing command."""
        if action == "copy":
            return bool(self._to_type)
        if action == "drive" and parameters[:1] == ("vy",):
            return self._simulation.spec.robot.drive.kind == "omnidirectional"
        return super().check_action(action, parameters)

    def action_pause(self) -> None:
        """Pause, or continue."""
        self._simulation.toggle()

    def action_faster(self, step: int) -> None:
        """Change to the next speed, or the one before."""
        speed = next_speed(self._simulation.status.speed, step)
        self._simulation.set_speed(min(speed, FASTEST))

    def action_reset(self) -> None:
        """Reset the world to its beginning."""
        self._keys.stop()
        self._simulation.reset()

    def action_drive(self, axis: Axis, sign: int) -> None:
        """Drive while a key is held."""
        self._keys.press(axis, sign)
        self.command()

    def action_stop(self) -> None:
        """Stop at once."""
        self._keys.stop()
        self.command()

    def action_copy(self) -> None:
        """Copy the command for the stack to the clipboard."""
        self.app.copy_to_clipboard(self._to_type)
        self.notify(f"copied: {self._to_type}", markup=False)


def live_line(status: LiveStatus, scenario: str) -> Text:
    """Return ``▶ 1x  12.3 s  busy-house  driven by keys``, and problems."""
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
