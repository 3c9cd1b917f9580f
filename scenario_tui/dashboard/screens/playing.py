"""Keys and clock of screens with maps, and of those that play recorded runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, Final

from textual.binding import Binding, BindingType
from textual.screen import Screen

from daemon.model.assessments import Mark
from daemon.model.verdicts import Outcome
from scenario_tui.dashboard.transport import FLASH, FailureMoment, ReplayTransport, next_speed
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.text.run_text import NO_MARKS, by_severity

if TYPE_CHECKING:
    from scenario_tui.dashboard.playback import Playback

FRAMES: Final = 10
"""Frames per second of a replay."""
_NEEDS_RUN: Final = ("play", "scrub", "edge", "speed", "failure")


class MapActions(Screen[None]):
    """A screen with one :class:`TopView` or more, which move together."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("z", "zoom", "Zoom", show=False, id="zoom",
                tooltip="Nearer to the robot, then the whole map"),
        Binding("Z", "fit", "Fit", show=False, id="fit",
                tooltip="The whole map and the whole time again"),
        Binding("F", "follow", "Follow", show=False, id="follow",
                tooltip="Follow the robot when zoomed, or stay"),
        Binding("H", "pan(-1, 0)", "Pan left", show=False, id="pan-left", tooltip="When zoomed"),
        Binding("J", "pan(0, -1)", "Pan down", show=False, id="pan-down", tooltip="When zoomed"),
        Binding("K", "pan(0, 1)", "Pan up", show=False, id="pan-up", tooltip="When zoomed"),
        Binding("L", "pan(1, 0)", "Pan right", show=False, id="pan-right", tooltip="When zoomed"),
        Binding("O", "costmap", "Costmap", show=False, id="costmap",
                tooltip="The next costmap of the stack on the map, or none"),
    ]  # fmt: skip

    def action_zoom(self) -> None:
        """Zoom to the robot on the map."""
        for top in self.query(TopView):
            top.zoom()

    def action_fit(self) -> None:
        """Show the whole map and the whole time again."""
        for top in self.query(TopView):
            top.fit()
        for signals in self.query(TimelineView):
            signals.fit_time()

    def action_follow(self) -> None:
        """Follow the robot on the map, or stay at its present place."""
        followed = [top.follow() for top in self.query(TopView)]
        self.notify("following the robot" if any(followed) else "staying here")

    def action_costmap(self) -> None:
        """Show another costmap on the map, or none."""
        names = [name for top in self.query(TopView) if (name := top.next_costmap()) is not None]
        if not names:
            self.notify("no costmap was recorded")
        else:
            self.notify(f"{names[0]} costmap" if names[0] else "no costmap")

    def action_pan(self, right: int, up: int) -> None:
        """Look to a side on the map."""
        panned = [top.pan(right, up) for top in self.query(TopView)]
        if not any(panned):
            self.notify("the whole map is in view: z zooms in")


class PlayingScreen(Screen[None]):
    """A screen with a moment of simulated time; without a transport it cannot play."""

    # Ten of the methods are keys, which Textual calls by name. The clock is ReplayTransport.

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "play", "Play", id="replay-play", tooltip="Play, pause, or play again"),
        Binding("left", "scrub(-1)", "−1 s", show=False, id="back-1", tooltip="A second back"),
        Binding("right", "scrub(1)", "+1 s", show=False, id="on-1", tooltip="A second on"),
        Binding("shift+left", "scrub(-10)", "−10 s", show=False, id="back-10",
                tooltip="Ten seconds back"),
        Binding("shift+right", "scrub(10)", "+10 s", show=False, id="on-10",
                tooltip="Ten seconds on"),
        Binding("home", "edge(False)", "Start", show=False, id="start", tooltip="To the start"),
        Binding("end", "edge(True)", "End", show=False, id="end", tooltip="To the end"),
        Binding("plus,equals_sign", "speed(1)", "Faster", key_display="+", show=False, id="faster",
                tooltip="Up to 1000x"),
        Binding("minus", "speed(-1)", "Slower", key_display="-", show=False, id="slower",
                tooltip="Down to 0.1x"),
        Binding("n", "failure(1)", "Next ✗", id="next-failure",
                tooltip="To the next failure of an oracle"),
        Binding("N", "failure(-1)", "Previous ✗", show=False, id="previous-failure",
                tooltip="To the failure before"),
        Binding("right_square_bracket", "signals(1)", "More signals", show=False, id="signals-on",
                tooltip="Signals further down"),
        Binding("left_square_bracket", "signals(-1)", "Signals back", show=False, id="signals-back",
                tooltip="Signals further up"),
        Binding("left_parenthesis", "zoom_time(False)", "More time", key_display="(", show=False,
                id="more-time", tooltip="Show a longer time range of the signals"),
        Binding("right_parenthesis", "zoom_time(True)", "Less time", key_display=")", show=False,
                id="less-time", tooltip="Show a shorter time range, as by the mouse wheel"),
        Binding("e", "counting", "Every signal", show=False, id="every-signal",
                tooltip="With clocks and odometers, or without"),
    ]  # fmt: skip

    transport: ReplayTransport | None = None
    clock: Callable[[], float] = staticmethod(time.monotonic)
    _at = 0.0

    def moments(self) -> Sequence[FailureMoment]:
        """Return the moments at which oracles failed, by time."""
        return ()

    def show_moment(self, window: float = FLASH) -> None:
        """Show the moment, with the contacts of the ``window`` [s] before it."""

    def begin(self, transport: ReplayTransport) -> None:
        """Start with something to play."""
        self.transport, self._at = transport, self.clock()
        self.refresh_bindings()
        self.show_moment()

    def on_mount(self) -> None:
        """Start the clock."""
        self._at = self.clock()
        self.set_interval(1.0 / FRAMES, self.tick)

    def on_resize(self) -> None:
        """Show the moment in the new size."""
        self.call_after_refresh(self.show_moment)

    def tick(self) -> None:
        """Advance by the passed time: a slow terminal shows fewer frames, not a slower run."""
        now = self.clock()
        passed, self._at = now - self._at, now
        if self.transport is not None and self.transport.playing:
            step = self.transport.advance(passed)
            # The window grows with the step: at 100x most contacts would fall between two frames.
            self.show_moment(max(FLASH, step))

    def go(self, time: float) -> None:
        """Go to a moment [s], and stay there."""
        if self.transport is not None:
            self.transport.go(time)
            self.transport.playing = False
            self.show_moment()
            self.query_one(TimelineView).reveal()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Offer keys of a replay only with something to play."""
        if action in _NEEDS_RUN and self.transport is None:
            return False
        return super().check_action(action, parameters)

    def action_play(self) -> None:
        """Play or pause."""
        self._at = self.clock()  # the time of the pause does not count
        self._change(lambda transport: transport.toggle())

    def action_scrub(self, seconds: int) -> None:
        """Go some seconds on or back."""
        self._change(lambda transport: transport.go(transport.time + seconds))

    def action_edge(self, end: bool) -> None:
        """Go to the start or the end."""
        self._change(lambda transport: transport.go(transport.end if end else transport.start))

    def action_speed(self, step: int) -> None:
        """Play faster, or slower."""
        # The key is disabled without a transport.
        assert self.transport is not None
        self.transport.speed = next_speed(self.transport.speed, step)
        self.show_moment()

    def _change(self, change: Callable[[ReplayTransport], None]) -> None:
        assert self.transport is not None
        change(self.transport)
        self.show_moment()
        self.query_one(TimelineView).reveal()

    def action_failure(self, step: int) -> None:
        """Go to the next failure of an oracle, or the one before; round at the end."""
        # A finished run opens at its end, behind which the first failure comes next.
        assert self.transport is not None
        moments, time = self.moments(), self.transport.time
        further = [one for one in moments if (one.time - time) * step > 1e-6] or moments
        if further:
            self.show_failure(further[0 if step > 0 else -1])
        else:
            self.notify("no oracle failed")

    def action_signals(self, step: int) -> None:
        """Show signals further down or up."""
        self.query_one(TimelineView).scroll_signals(step)

    def action_counting(self) -> None:
        """Show or hide signals that only count."""
        self.query_one(TimelineView).toggle_counting()

    def action_zoom_time(self, nearer: bool) -> None:
        """Show a shorter or longer time range of the signals."""
        self.query_one(TimelineView).zoom_time(nearer)

    def show_failure(self, moment: FailureMoment) -> None:
        """Go to the moment of a failure."""
        self.go(moment.time)

    def on_timeline_view_seek(self, event: TimelineView.Seek) -> None:
        """Go to the clicked moment."""
        self.go(event.time)


def clock_line(transport: ReplayTransport) -> str:
    """Return ``▶ 2x  27.0 s of 62.2 s``."""
    sign = "▶" if transport.playing else "‖"
    return f"{sign} {transport.speed:g}x  {transport.time:.1f} s of {transport.end:.1f} s"


def decisive_moment(playback: Playback, marks: Mapping[str, Mark] = NO_MARKS) -> float | None:
    """Return the moment [s] of the gravest failure, ``None`` without one.

    ``marks`` of oracles tell known failures from new ones. The end of the run decides a failure
    without a moment, because an event never happened.
    """
    verdicts = by_severity(playback.verdicts, marks)
    failures = [one for one in verdicts if one.outcome is Outcome.FAIL]
    if not failures:
        return None
    return playback.end if failures[0].moment is None else failures[0].moment
