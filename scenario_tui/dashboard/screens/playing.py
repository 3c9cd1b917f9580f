"""Keys and clock of every screen that plays recorded runs."""

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
from scenario_tui.text.run_text import NO_MARKS, by_severity

if TYPE_CHECKING:
    from scenario_tui.dashboard.playback import Playback

FRAMES: Final = 10
"""How often a second the view is drawn while it plays."""
_NEEDS_RUN: Final = ("play", "scrub", "edge", "speed", "failure")


class PlayingScreen(Screen[None]):
    """A screen with a moment of simulated time; nothing can be played without a transport."""

    # More than twenty methods: ten are keys, which Textual calls by name, of one line or two. The
    # clock itself is ReplayTransport.

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "play", "Play", id="replay-play", tooltip="Or pause, or once more"),
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
                tooltip="To when the next oracle was decided against"),
        Binding("N", "failure(-1)", "Previous ✗", show=False, id="previous-failure",
                tooltip="The one before"),
        Binding("right_square_bracket", "signals(1)", "More signals", show=False, id="signals-on",
                tooltip="Signals further down"),
        Binding("left_square_bracket", "signals(-1)", "Signals back", show=False, id="signals-back",
                tooltip="Signals further up"),
        Binding("left_parenthesis", "zoom_time(False)", "More time", key_display="(", show=False,
                id="more-time", tooltip="A longer stretch of the time beside the signals"),
        Binding("right_parenthesis", "zoom_time(True)", "Less time", key_display=")", show=False,
                id="less-time", tooltip="A shorter stretch of it, as by the wheel of the mouse"),
        Binding("e", "counting", "Every signal", show=False, id="every-signal",
                tooltip="Also clocks and odometers, or without them"),
    ]  # fmt: skip

    transport: ReplayTransport | None = None
    clock: Callable[[], float] = staticmethod(time.monotonic)
    _at = 0.0

    def moments(self) -> Sequence[FailureMoment]:
        """Return when oracles were decided against, by time."""
        return ()

    def show_moment(self, window: float = FLASH) -> None:
        """Show the moment, with the contacts of the ``window`` [s] before it."""

    def begin(self, transport: ReplayTransport) -> None:
        """Have something to play."""
        self.transport, self._at = transport, self.clock()
        self.refresh_bindings()
        self.show_moment()

    def on_mount(self) -> None:
        """Look at the clock from now on."""
        self._at = self.clock()
        self.set_interval(1.0 / FRAMES, self.tick)

    def on_resize(self) -> None:
        """Show the moment in the new size."""
        self.call_after_refresh(self.show_moment)

    def tick(self) -> None:
        """Go on by the time that passed: a slow terminal shows fewer frames, not a slower run."""
        now = self.clock()
        passed, self._at = now - self._at, now
        if self.transport is not None and self.transport.playing:
            went = self.transport.advance(passed)
            # The window of contacts grows with the step, or at 100x most would fall between two.
            self.show_moment(max(FLASH, went))

    def go(self, time: float) -> None:
        """Go to a moment [s], and stay there."""
        if self.transport is not None:
            self.transport.go(time)
            self.transport.playing = False
            self.show_moment()
            self.query_one(TimelineView).reveal()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Offer playing only where there is something to play."""
        if action in _NEEDS_RUN and self.transport is None:
            return False
        return super().check_action(action, parameters)

    def action_play(self) -> None:
        """Play or pause."""
        self._at = self.clock()  # the time it stood still does not count
        self._change(lambda transport: transport.toggle())

    def action_scrub(self, seconds: int) -> None:
        """Go some seconds on or back."""
        self._change(lambda transport: transport.go(transport.time + seconds))

    def action_edge(self, end: bool) -> None:
        """Go to the start or the end."""
        self._change(lambda transport: transport.go(transport.end if end else transport.start))

    def action_speed(self, step: int) -> None:
        """Play faster, or slower."""
        # Without a transport no key gets here.
        assert self.transport is not None
        self.transport.speed = next_speed(self.transport.speed, step)
        self.show_moment()

    def _change(self, change: Callable[[ReplayTransport], None]) -> None:
        assert self.transport is not None
        change(self.transport)
        self.show_moment()
        self.query_one(TimelineView).reveal()

    def action_failure(self, step: int) -> None:
        """Go to the next moment an oracle was decided against, or the one before, in a circle."""
        # A finished run opens at its end: behind that the first moment is what is looked for.
        assert self.transport is not None
        moments, time = self.moments(), self.transport.time
        further = [one for one in moments if (one.time - time) * step > 1e-6] or moments
        if further:
            self.show_failure(further[0 if step > 0 else -1])
        else:
            self.notify("no oracle was decided against")

    def action_signals(self, step: int) -> None:
        """Show signals further down or up."""
        self.query_one(TimelineView).scroll_signals(step)

    def action_counting(self) -> None:
        """Show signals that only count, too, or leave them out."""
        self.query_one(TimelineView).toggle_counting()

    def action_zoom_time(self, nearer: bool) -> None:
        """Show less of the time beside the signals, or more."""
        self.query_one(TimelineView).zoom_time(nearer)

    def show_failure(self, moment: FailureMoment) -> None:
        """Go to a moment at which an oracle was decided against."""
        self.go(moment.time)

    def on_timeline_view_seek(self, event: TimelineView.Seek) -> None:
        """Go to the moment somebody pointed at."""
        self.go(event.time)


def clock_line(transport: ReplayTransport) -> str:
    """Return ``▶ 2x  27.0 s of 62.2 s``."""
    sign = "▶" if transport.playing else "‖"
    return f"{sign} {transport.speed:g}x  {transport.time:.1f} s of {transport.end:.1f} s"


def decisive_moment(playback: Playback, marks: Mapping[str, Mark] = NO_MARKS) -> float | None:
    """Return the moment [s] of the failure that people must look at first, ``None`` without one.

    ``marks`` of oracles tell known failures from news. A failure without a moment is decided by
    the end: something never happened.
    """
    verdicts = by_severity(playback.verdicts, marks)
    failed = [one for one in verdicts if one.outcome is Outcome.FAIL]
    if not failed:
        return None
    return playback.end if failed[0].moment is None else failed[0].moment
