"""A recorded run from above, played: over the dashboard, or as an app of its own."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import ClassVar, Final

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import Screen
from textual.widgets import Footer, Static

from scenario_tui.frame import headline, timeline, verdict_lines
from scenario_tui.playback import FLASH, Moment, Playback
from scenario_tui.screens.dialogs import Help
from scenario_tui.transport import Transport
from scenario_tui.widgets.top_view import REPLAY_LEGEND, TopView

FRAMES: Final = 10
"""How often a second the view is drawn while it plays."""


class ReplayScreen(Screen[None]):
    """Plays a :class:`Playback`; leaving it leaves the app when nothing lies below."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "play", "Play/pause", tooltip="At the end: from the start"),
        Binding("left", "scrub(-1)", "−1 s", show=False),
        Binding("right", "scrub(1)", "+1 s", show=False),
        Binding("shift+left", "scrub(-10)", "−10 s", show=False),
        Binding("shift+right", "scrub(10)", "+10 s", show=False),
        Binding("home", "edge(False)", "Start", show=False),
        Binding("end", "edge(True)", "End", show=False),
        Binding("plus,equals_sign", "faster", "Faster", key_display="+", tooltip="Up to 1000x"),
        Binding("minus", "slower", "Slower", key_display="-", tooltip="Down to 0.1x"),
        Binding("n", "next", "Next ✗", tooltip="To when the next oracle was decided against"),
        Binding("N", "previous", "Previous ✗", show=False, tooltip="The one before"),
        Binding("z", "zoom", "Zoom", tooltip="Nearer to the robot, then back to everything"),
        Binding("question_mark", "keys", "Help", tooltip="This list"),
        Binding("q,escape", "leave", "Quit", tooltip="Leave the replay"),
    ]

    def __init__(
        self,
        playback: Playback,
        begin: float | None = None,
        speed: float = 1.0,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self.playback = playback
        first = playback.start if begin is None else begin
        self.transport = Transport(playback.start, playback.end, first, speed)
        self._clock = clock
        self._at = clock()

    def compose(self) -> ComposeResult:
        """Lay out headline, timeline, map, verdicts and keys."""
        yield Static(id="status")
        yield Static(id="timeline")
        yield TopView(id="map")
        yield Static(id="verdicts")
        yield Static(REPLAY_LEGEND, id="legend")
        yield Footer(compact=True, show_command_palette=False)

    def on_mount(self) -> None:
        """Begin to play."""
        self._at = self._clock()
        self.set_interval(1.0 / FRAMES, self.tick)
        self.present()

    def on_resize(self) -> None:
        """Draw the timeline for the new width."""
        self.call_after_refresh(self.present)

    def tick(self) -> None:
        """Go on by the time that passed: a slow terminal shows fewer frames, not a slower run."""
        now = self._clock()
        passed, self._at = now - self._at, now
        if self.transport.playing:
            went = self.transport.advance(passed)
            self.present(max(FLASH, went))

    def present(self, window: float = FLASH) -> None:
        """Show the moment, with the contacts of the ``window`` [s] before it."""
        if not self.is_attached or not self.app.is_running:
            return
        playback, transport = self.playback, self.transport
        sign = "▶" if transport.playing else "‖"
        head = f"{sign} {transport.speed:g}x  {headline(playback, transport.time)}"
        self.query_one("#status", Static).update(Text(head, no_wrap=True, overflow="ellipsis"))
        width = max(self.size.width - 2, 2)
        line = timeline(playback, transport.time, width)
        self.query_one("#timeline", Static).update(line)
        words = Text("\n").join(verdict_lines(playback, transport.time))
        self.query_one("#verdicts", Static).update(words)
        self.query_one(TopView).show(playback.view(transport.time, window=window))

    def action_play(self) -> None:
        """Play or pause."""
        self.transport.toggle()
        self._at = self._clock()
        self.present()

    def action_scrub(self, seconds: int) -> None:
        """Go some seconds on or back."""
        self.transport.go(self.transport.time + seconds)
        self.present()

    def action_edge(self, end: bool) -> None:
        """Go to the start or the end."""
        self.transport.go(self.transport.end if end else self.transport.start)
        self.present()

    def action_faster(self) -> None:
        """Play faster."""
        self.transport.faster()
        self.present()

    def action_slower(self) -> None:
        """Play slower."""
        self.transport.slower()
        self.present()

    def action_next(self) -> None:
        """Go to the next moment an oracle was decided against, and stay there."""
        self._jump(self.playback.next_moment(self.transport.time), "after")

    def action_previous(self) -> None:
        """Go to the previous moment an oracle was decided against, and stay there."""
        self._jump(self.playback.previous_moment(self.transport.time), "before")

    def _jump(self, found: Moment | None, where: str) -> None:
        if found is None:
            self.notify(f"no oracle was decided against {where} this moment")
            return
        self.transport.go(found.time)
        self.transport.playing = False
        self.present()

    def action_zoom(self) -> None:
        """Come nearer to the robot on the map."""
        self.query_one(TopView).zoom()

    def action_keys(self) -> None:
        """Show the keys."""
        self.app.push_screen(Help(self.app.screen))

    def action_leave(self) -> None:
        """Go back to where this came from."""
        if len(self.app.screen_stack) > 1:
            self.app.pop_screen()
        else:
            self.app.exit()


class ReplayApp(App[None]):
    """Nothing but a replay."""

    TITLE = "scenario replay"
    CSS_PATH = "../dashboard.tcss"
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+c", "quit", "Quit", show=False, priority=True),
    ]

    def __init__(self, screen: ReplayScreen) -> None:
        super().__init__()
        self._first = screen

    def get_default_screen(self) -> Screen[None]:
        """Begin with the replay."""
        return self._first


def run_replay(playback: Playback, begin: float, speed: float) -> int:
    """Play until somebody leaves; return the exit code of the app."""
    app = ReplayApp(ReplayScreen(playback, begin, speed))
    app.run()
    return app.return_code or 0
