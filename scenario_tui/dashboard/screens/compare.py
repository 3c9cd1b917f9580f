"""Two recorded runs side by side: two maps on one clock, overlaid signals, differences."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widgets import Static

from daemon.batch.errors import DaemonError
from daemon.model.assessments import Mark
from scenario_tui.dashboard.playback import Playback
from scenario_tui.dashboard.recordings import Missing
from scenario_tui.dashboard.run_timeline import Alignment, common_clock, shift_to_clock
from scenario_tui.dashboard.screens.parts import Parts
from scenario_tui.dashboard.screens.playing import (
    MapActions,
    PlayingScreen,
    clock_line,
    decisive_moment,
)
from scenario_tui.dashboard.screens.run_panel import marks_of
from scenario_tui.dashboard.screens.standalone import StandaloneScreen
from scenario_tui.dashboard.transport import FLASH, FailureMoment, ReplayTransport
from scenario_tui.dashboard.widgets.key_footer import KeyFooter
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.top_view import MapLegend, TopView
from scenario_tui.text.comparison_text import comparison_text
from scenario_tui.text.run_text import NO_MARKS
from scenario_tui.text.styles import QUIET

if TYPE_CHECKING:
    from scenario_tui.dashboard.app import Dashboard

_BY: dict[Alignment, str] = {"time": "by simulated time", "mission": "by waypoints done"}


class CompareScreen(StandaloneScreen, Parts, MapActions, PlayingScreen):
    """Plays two runs at once, on the clock of the first.

    The ``marks`` of each run, by oracle, tell known failures from new ones.
    """

    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (110, "-wide")]  # noqa: RUF012
    AUTO_FOCUS = "#differences"
    VIEWS = ("maps", "signals", "differences")

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("t", "align", "Align", id="align",
                tooltip="By simulated time, or by the waypoints that both have done"),
        Binding("w", "swap", "Swap", show=False, id="swap",
                tooltip="Exchange the first run and the second"),
    ]  # fmt: skip

    def __init__(
        self,
        first: Playback,
        second: Playback,
        *,
        marks: tuple[Mapping[str, Mark], Mapping[str, Mark]] = (NO_MARKS, NO_MARKS),
        begin: float | None = None,
        speed: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self.first, self.second = first, second
        self.marks = marks
        self.by: Alignment = "time"
        self._begin, self._speed = begin, speed
        self.clock = clock

    def compose(self) -> ComposeResult:
        """Lay out maps, signals and differences."""
        yield StaticText(id="status")
        with Horizontal(id="maps", classes="part in-maps"):
            for side in ("first", "second"):
                with Vertical():
                    yield StaticText(id=f"name-{side}")
                    yield TopView(id=f"map-{side}")
        with Horizontal(id="below", classes="part in-signals in-differences"):
            yield TimelineView(id="signals").add_class("part", "in-signals")
            with VerticalScroll(id="differences", classes="part in-differences"):
                yield StaticText(id="table")
        yield MapLegend(id="legend").add_class("part", "in-maps")
        yield KeyFooter()

    def on_mount(self) -> None:
        """Show both runs, paused."""
        self._meet(self._begin)

    def _meet(self, time: float | None) -> None:
        """Put both runs on one clock, paused at a moment of the first."""
        first, second = self.first.timeline, self.second.timeline
        self._clock = common_clock(first, second, self.by)
        # The signals of the second run are shifted to the clock of the first once, here; the maps
        # convert the moment at every frame.
        self._moved = moved = shift_to_clock(second, self._clock)
        start, end = min(first.start, moved.start), max(first.end, moved.end)
        self.query_one(TimelineView).show((first, moved))
        text = comparison_text(
            self.first.verdicts, self.second.verdicts,
            self.first.trace.spec, self.second.trace.spec, self.marks,
        )  # fmt: skip
        self.query_one("#table", Static).update(text)
        speed = self._speed if self.transport is None else self.transport.speed
        if time is None:
            time = self._decisive_moment()
        self.begin(
            ReplayTransport(start, end, start if time is None else time, speed, playing=False)
        )

    def _decisive_moment(self) -> float | None:
        """Return the decisive moment of the first run, otherwise the second, on the first clock."""
        pairs = zip((self.first, self.second), self.marks, strict=True)
        first, second = (decisive_moment(*pair) for pair in pairs)
        if first is not None or second is None:
            return first
        return float(self._clock.to_first([second])[0])

    def moments(self) -> Sequence[FailureMoment]:
        """Return the failures of oracles in either run, on the clock of the first."""
        second = zip(self.second.moments, self._moved.decided, strict=True)
        both = [*self.first.moments, *(FailureMoment(at, m.oracle) for m, at in second)]
        return sorted(both, key=lambda moment: (moment.time, moment.oracle))

    def show_moment(self, window: float = FLASH) -> None:
        """Show both runs at the moment."""
        transport = self.transport
        if transport is None or not self.is_attached or not self.app.is_running:
            return
        times = (transport.time, self._clock.to_second(transport.time))
        line = Text(f"{clock_line(transport)}  {_BY[self.by]}")
        self.query_one("#status", Static).update(self.with_tabs(line))
        for side, playback, at in zip(
            ("first", "second"), (self.first, self.second), times, strict=True
        ):
            now = playback.within(at)
            self.query_one(f"#map-{side}", TopView).show(playback.view(now, window=window))
            over = "  (over)" if at > playback.end + 1e-6 else ""
            name = Text(f"{playback.label}", style="bold", no_wrap=True, overflow="ellipsis")
            name.append(
                f"  {now:.1f} s  {playback.reached(now)}/{playback.waypoints} wp{over}", style=QUIET
            )
            self.query_one(f"#name-{side}", Static).update(name)
        self.query_one(TimelineView).move(transport.time)

    def view_changed(self) -> None:
        """Give the focus to the differences if they are visible."""
        if self.part == "differences" or self.has_class("-wide"):
            self.query_one("#differences").focus(scroll_visible=False)
        self.show_moment()

    def action_align(self) -> None:
        """Use the other clock."""
        self.by = "mission" if self.by == "time" else "time"
        self._meet(self.transport.time if self.transport is not None else None)

    def action_swap(self) -> None:
        """Exchange the first run and the second."""
        now = self.transport.time if self.transport is not None else 0.0
        then = self._clock.to_second(now)
        self.first, self.second = self.second, self.first
        self.marks = self.marks[::-1]
        self._meet(then)


def mark_or_compare(dashboard: Dashboard, run: str) -> None:
    """Mark a run, or compare it with the marked one."""
    marked = dashboard.marked_run
    if not marked or marked == run:
        dashboard.marked_run = "" if marked == run else run
        message = f"unmarked {run}" if marked else f"marked {run}: now mark another run"
        dashboard.notify(message, markup=False)
        return
    dashboard.marked_run = ""
    dashboard.notify(f"reading {marked} and {run}", markup=False)
    front = dashboard.screen

    def show(both: list[tuple[Playback, Mapping[str, Mark]]]) -> None:
        # Not if the user has gone to another screen meanwhile.
        if dashboard.screen is front:
            (first, second), marks = zip(*both, strict=True)
            dashboard.push_screen(CompareScreen(first, second, marks=marks))

    dashboard.start_task(
        lambda: [_playback(dashboard, one) for one in (marked, run)], show, dashboard.problem
    )


def _playback(dashboard: Dashboard, run: str) -> tuple[Playback, Mapping[str, Mark]]:
    with dashboard.feed.connect() as daemon:
        row = daemon.run(run).row
    recording = dashboard.recordings.read(row)
    if isinstance(recording, Missing):
        raise DaemonError(f"{run}: {recording.why}")
    return recording, marks_of(dashboard, row)
