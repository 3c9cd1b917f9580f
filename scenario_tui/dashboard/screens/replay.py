"""The replay of a recorded run from above: over the dashboard, or as a separate app."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Horizontal
from textual.widgets import Static

from daemon.model.assessments import Mark
from scenario_tui.dashboard.playback import Playback, headline, lines_below, timeline_bar
from scenario_tui.dashboard.screens.parts import Parts
from scenario_tui.dashboard.screens.playing import MapActions, PlayingScreen, decisive_moment
from scenario_tui.dashboard.screens.standalone import StandaloneScreen
from scenario_tui.dashboard.transport import FLASH, FailureMoment, ReplayTransport
from scenario_tui.dashboard.widgets.key_footer import KeyFooter
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.top_view import MapLegend, TopView
from scenario_tui.text.run_text import NO_MARKS


class ReplayScreen(StandaloneScreen, Parts, MapActions, PlayingScreen):
    """Plays a :class:`Playback` from ``begin`` [s], by default from its decisive moment or start.

    ``marks`` of oracles tell known failures from new ones.
    """

    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (150, "-wide")]  # noqa: RUF012
    VIEWS = ("map", "signals")

    def __init__(
        self,
        playback: Playback,
        begin: float | None = None,
        speed: float = 1.0,
        *,
        marks: Mapping[str, Mark] = NO_MARKS,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self.playback, self.marks = playback, marks
        if begin is None:
            begin = decisive_moment(playback, marks)
        first = playback.start if begin is None else begin
        # At the moment of a failure the replay is paused, for the user to look at it.
        plays = all(abs(moment.time - first) > 1e-6 for moment in playback.moments)
        self.transport = ReplayTransport(playback.start, playback.end, first, speed, plays)
        self.clock = clock

    def compose(self) -> ComposeResult:
        """Lay out headline, timeline, map, signals, verdicts and keys."""
        yield StaticText(id="status")
        yield StaticText(id="timeline")
        with Horizontal(id="stage"):
            yield TopView(id="map").add_class("part", "in-map")
            yield TimelineView(id="signals").add_class("part", "in-signals")
        yield StaticText(id="verdicts")
        yield MapLegend(id="legend").add_class("part", "in-map")
        yield KeyFooter()

    def on_mount(self) -> None:
        """Show the first moment."""
        self.show_moment()

    def moments(self) -> Sequence[FailureMoment]:
        """Return the moments at which oracles failed."""
        return self.playback.moments

    def view_changed(self) -> None:
        """Sample the signals once they are in view, because that may take a moment."""
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
        line = timeline_bar(playback, transport.time, width, self.marks)
        self.query_one("#timeline", Static).update(line)
        lines = lines_below(playback, transport.time, self.marks)
        for line in lines:
            line.truncate(width, overflow="ellipsis")
        self.query_one("#verdicts", Static).update(Text("\n").join(lines))
        self.query_one(TopView).show(playback.view(transport.time, window=window))
        self.query_one(TimelineView).move(transport.time)
