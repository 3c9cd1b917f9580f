"""A recorded run from above, played: over the dashboard, or as an app of its own."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.screen import Screen
from textual.widgets import Static

from scenario_tui.dashboard.playback import Playback, headline, timeline_bar
from scenario_tui.dashboard.screens.help import Help
from scenario_tui.dashboard.screens.playing import PlayingScreen
from scenario_tui.dashboard.themes import ThemedApp
from scenario_tui.dashboard.transport import FLASH, FailureMoment, ReplayTransport
from scenario_tui.dashboard.widgets.key_footer import KeyFooter
from scenario_tui.dashboard.widgets.map_legend import MapLegend
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.text.formatting import QUIET
from scenario_tui.text.run_text import verdict_lines


class StandaloneScreen(PlayingScreen):
    """A screen of its own, over the dashboard or in a :class:`ReplayApp`, which has no other keys.

    Subclasses bind ``keys`` and ``leave``.
    """

    def on_resize(self) -> None:
        """Draw everything for the new size."""
        self.call_after_refresh(self.show_moment)

    def action_keys(self) -> None:
        """Show the keys."""
        self.app.push_screen(Help(self.app.screen))

    def action_leave(self) -> None:
        """Go back to where this came from; leave the app when nothing lies below."""
        if len(self.app.screen_stack) > 1:
            self.app.pop_screen()
        else:
            self.app.exit()


class ReplayScreen(StandaloneScreen):
    """Plays a :class:`Playback`."""

    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (150, "-wide")]  # noqa: RUF012
    VIEWS = ("map", "signals")

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("question_mark,f1", "keys", "Help", id="help", tooltip="This list"),
        Binding("escape", "leave", "Back", id="leave", tooltip="Leave the replay"),
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
        self.transport = ReplayTransport(playback.start, playback.end, first, speed)
        self.clock = clock

    def compose(self) -> ComposeResult:
        """Lay out headline, timeline, map, signals, verdicts and keys."""
        yield StaticText(id="status")
        yield StaticText(id="timeline")
        with Horizontal(id="stage"):
            yield TopView(id="map")
            yield TimelineView(id="signals")
        yield StaticText(id="verdicts")
        yield MapLegend()
        yield KeyFooter()

    def on_mount(self) -> None:
        """Show the first moment."""
        self.show_moment()

    def moments(self) -> Sequence[FailureMoment]:
        """Return when oracles were decided against."""
        return self.playback.moments

    def view_changed(self) -> None:
        """Sample the signals once they are looked at: that may take a moment."""
        signals = self.query_one(TimelineView)
        if signals.size and not signals.drawn:
            signals.show((self.playback.timeline,))
        self.show_moment()

    def show_moment(self, window: float = FLASH) -> None:
        """Show the moment, with the contacts of the ``window`` [s] before it."""
        transport = self.transport
        if transport is None or not self.is_attached or not self.app.is_running:
            return
        playback, sign = self.playback, "▶" if transport.playing else "‖"
        head = f"{sign} {transport.speed:g}x  {headline(playback, transport.time)}"
        self.query_one("#status", Static).update(Text(head, no_wrap=True, overflow="ellipsis"))
        width = max(self.size.width - 2, 2)
        line = timeline_bar(playback, transport.time, width)
        self.query_one("#timeline", Static).update(line)
        lines = verdict_lines(playback.verdicts, transport.time)
        if stack := playback.stack_line(transport.time):
            lines.insert(0, Text(stack, style=QUIET))
        words = Text("\n").join(lines)
        self.query_one("#verdicts", Static).update(words)
        self.query_one(TopView).show(playback.view(transport.time, window=window))
        self.query_one(TimelineView).move(transport.time)


class ReplayApp(ThemedApp):
    """Nothing but a replay, or two of them compared."""

    TITLE = "scenario replay"
    CSS_PATH = ["../dashboard.tcss", "../playing.tcss"]  # noqa: RUF012
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("q", "quit", "Quit", id="quit", tooltip="Leave the program"),
        Binding(
            "ctrl+c",
            "quit",
            "Quit",
            show=False,
            priority=True,
            id="quit-at-once",
            tooltip="Leave from anywhere",
        ),
    ]

    def __init__(self, screen: Screen[None]) -> None:
        super().__init__()
        self._first = screen

    def get_default_screen(self) -> Screen[None]:
        """Begin with the replay."""
        return self._first


def run_replay(screen: Screen[None]) -> int:
    """Play until somebody leaves; return the exit code of the app."""
    app = ReplayApp(screen)
    app.limit_to_terminal()
    app.run()
    return app.return_code or 0
