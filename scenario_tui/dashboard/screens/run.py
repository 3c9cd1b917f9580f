"""One run: verdicts, signals, map and log, while it runs and at any moment of it afterwards."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widgets import OptionList, Static

from daemon.model.spec import RunResult
from daemon.model.status import CampaignRow, RunDetail, RunState
from daemon.model.verdicts import Verdict
from scenario_tui.dashboard.screens.base import show_message_or
from scenario_tui.dashboard.screens.playing import PlayingScreen, clock_line
from scenario_tui.dashboard.screens.run_panel import RunMap, top_view_of, track_of
from scenario_tui.dashboard.screens.steering import SteeringScreen
from scenario_tui.dashboard.signal_strips import FLASH, FailureMoment, ReplayTransport
from scenario_tui.dashboard.state import (
    DashboardState,
    Query,
    TraceSummary,
    Track,
    UnavailableTrace,
)
from scenario_tui.dashboard.widgets.tables import VerdictList
from scenario_tui.dashboard.widgets.timeline import LEGEND as SIGNS
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.top_view import REPLAY_LEGEND, TopView
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    QUIET,
    UNSURE,
    glyph_word,
    pluralise,
    run_label,
    run_word,
)
from scenario_tui.text.printed_output import last_lines, printed_lines
from scenario_tui.text.run_text import append_facts, run_text

if TYPE_CHECKING:
    from scenario_tui.dashboard.playback import Playback

_LINES: Final = 5000
"""Lines of the log that are laid out at once; `scenario logs` prints all."""

Line = tuple[float, str, str]
_VAST: Final = 170
"""Columns from which on map and signals stand side by side."""


def log_text(detail: RunDetail | None, playback: Playback | None, limit: int = _LINES) -> Text:
    """Return everything there is to read about a run, at most ``limit`` lines of its log."""
    text = Text()
    if detail is not None:
        for note in _notes(detail.row.remark, detail.result):
            text.append(f"{note}\n", style=UNSURE)
        if detail.row.attempt > 1:
            text.append(f"this was attempt {detail.row.attempt}\n", style=UNSURE)
        if detail.row.cached:
            text.append(f"not executed again: the result is that of {detail.row.cached}\n")
        append_facts(text, detail)
    if playback is None:
        return text
    if playback.trace.problems:
        text.append("not to be trusted: ", style=UNSURE)
        text.append("; ".join(playback.trace.problems) + "\n")
    text.append("\n")
    lines = [*log_lines(playback)]
    for time, source, said in lines[:limit]:
        text.append(f"{time:8.2f} s  ", style=QUIET)
        text.append(f"{source:<10} ", style="bold")
        text.append("\n".join(printed_lines(said)) + "\n")
    if len(lines) > limit:
        text.append(f"and {len(lines) - limit} lines more\n", style=QUIET)
    _append_outputs(text, playback)
    return text


def _append_outputs(text: Text, playback: Playback) -> None:
    """Add the last lines of what an external system under test printed."""
    for name, printed in playback.outputs.items():
        shown, hidden = last_lines(printed)
        text.append(f"\n{name}\n", style="bold")
        if hidden:
            more = pluralise(hidden, "line")
            text.append(f"{more} before these: scenario logs prints all\n", style=QUIET)
        text.append("".join(f"{line}\n" for line in shown or ["(nothing)"]))


def log_lines(playback: Playback) -> Iterator[Line]:
    """Yield what was recorded as words, what oracles decided and what doors did, by time [s]."""
    trace = playback.trace
    said = sorted((e.time, e.source, e.text) for e in trace.events)
    decided = [(m.time, "oracle", f"✗ {m.oracle} decided against") for m in playback.moments]
    doors = [
        (event.time, event.name, "opens" if event.opens else "is shut")
        for event in playback.timeline.doors
    ]
    touched = sorted((c.time, "contact", f"{c.first} touches {c.second}") for c in trace.contacts)
    yield from heapq.merge(said, decided, doors, _first_of_each(touched))


def _first_of_each(touched: list[Line], pause: float = 1.0) -> Iterator[Line]:
    """Leave out contacts that only go on: the same two within a while."""
    last: dict[str, float] = {}
    for time, source, words in touched:
        if time - last.get(words, -pause) >= pause:
            yield time, source, words
        last[words] = time


def _notes(reason: str, result: RunResult | None) -> list[str]:
    note = result.note if result is not None else ""
    return list(dict.fromkeys(filter(None, (reason.strip(), note.strip()))))


class RunScreen(PlayingScreen, SteeringScreen):
    """A run by its id; one that is over is played as soon as its trace is read."""

    # More than twenty methods: ten answer what its two bases ask of a screen, and each of the
    # others fills one part of it. The map, alone with the legend, is RunMap.

    AUTO_FOCUS = "VerdictList"
    VIEWS = ("verdicts", "signals", "map", "log")
    IN_FOOTER = (
        "back", "view", "replay-play", "next-failure", "zoom", "compare", "help", "quit",
    )  # fmt: skip

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("p", "replay", "Play", show=False, id="play",
                tooltip="Watch the recorded run from above, the map alone"),
        Binding("C", "compare", "Compare", id="compare",
                tooltip="With another run: the one marked before, or the next one marked"),
    ]  # fmt: skip

    def __init__(self, run: str) -> None:
        super().__init__()
        self._run = run
        self._playback: Playback | None = None
        self._opened: Path | None = None
        self._damage = ""
        self._shown: object = None

    def body(self) -> ComposeResult:
        """Words on the left; map and signals on the right, or one of them alone."""
        yield Static(id="now")
        with Horizontal(id="desk"):
            with Vertical(id="left"):
                with VerticalScroll(id="words"):
                    yield Static(id="run-text")
                yield VerdictList(id="decided")
                with VerticalScroll(id="log"):
                    yield Static(id="log-text")
            with Vertical(id="right"):
                yield RunMap(REPLAY_LEGEND)
                with Vertical(id="along"):
                    yield Static(id="untold")
                    yield TimelineView(id="signals")
                    yield Static(SIGNS, id="signs")

    def on_resize(self) -> None:
        """Put map and signals side by side where there is room for that."""
        self.set_class(self.size.width >= _VAST, "-vast")
        self.call_after_refresh(self.update_from_state)

    def state_query(self) -> Query:
        """This run."""
        return Query(run=self._run)

    def rejudge_target(self) -> str:
        """This run alone is judged again."""
        return self._run

    def command(self) -> str:
        """Return what to type to watch it."""
        return self.dashboard.command_lines.daemon_line("replay", self._run)

    def campaign(self) -> CampaignRow | None:
        """Return the campaign the run is part of."""
        return self.dashboard.daemon_state.campaign(self._run.rpartition(".")[0])

    def trail(self) -> str:
        """Where we are."""
        detail = self._detail()
        label = run_label(detail.row) if detail is not None else self._run
        return f"campaigns › {self._run.rpartition('.')[0]} › {label}"

    def moments(self) -> Sequence[FailureMoment]:
        """Return when its oracles were decided against."""
        return self._playback.moments if self._playback is not None else ()

    def _detail(self) -> RunDetail | None:
        return self.dashboard.daemon_state.detail_of(self._run)

    def show(self, state: DashboardState) -> None:
        """Show what is known of the run: live, or as it was."""
        detail = self._detail()
        if detail is None:
            return
        track, seen = track_of(self.dashboard, detail), state.recording_of(self._run)
        if (
            isinstance(seen, TraceSummary)
            and detail.result is not None
            and seen.path != self._opened
        ):
            self._opened = seen.path
            self._open(seen.path, detail.result.verdicts)
        self._words(detail, track)
        if self._playback is None:
            self._show_live(detail, state, track)
        self._say(detail)

    def _words(self, detail: RunDetail, track: Track | None) -> None:
        """Show verdicts once there are any, and the log."""
        result = detail.result
        self.set_class(result is not None, "-judged")
        if result is None:
            snapshot = track.snapshot if track else None
            self.query_one("#run-text", Static).update(run_text(detail, snapshot))
        else:
            self.query_one(VerdictList).show(result.verdicts)
        if self._shown != (detail, self._playback):
            if self._shown is None:
                # What is going on for a run that runs, why it failed for one that is over.
                self.show_view(self.VIEWS.index("map") if _runs(detail) else 0)
            self._shown = (detail, self._playback)
            self.query_one("#log-text", Static).update(log_text(detail, self._playback))

    def _show_live(self, detail: RunDetail, state: DashboardState, track: Track | None) -> None:
        """Show the map as it is now, or why there is nothing to see."""
        view, why = top_view_of(state, detail, track)
        why = self._damage or why
        above, signals = self.query_one(RunMap), self.query_one("#signals", TimelineView)
        # Where the words are not beside the map, the first line has no room for all of it.
        starting = track.snapshot.waiting if track and not self.has_class("-wide") else ""
        above.explain(why or starting)
        waiting = "Signals are drawn when the run is over." if _unfinished(detail) else "Reading."
        show_message_or(self.query_one("#untold"), signals, why or waiting)
        self.query_one("#signs").display = False
        if not why and view is not None:
            above.show(view)

    def _say(self, detail: RunDetail) -> None:
        """Say when it is and which part of the screen this is."""
        word = run_word(detail.row)
        said = Text(glyph_word(word), style=DASHBOARD_STYLES[word])
        track = track_of(self.dashboard, detail)
        if self.transport is not None and self._playback is not None:
            reached = self._playback.reached(self.transport.time)
            said.append(f"  {clock_line(self.transport)}  {reached}/{self._playback.waypoints} wp")
        elif track is not None:
            now = track.snapshot
            far = f"{now.reached}/{now.waypoints} wp  {now.time:.0f} s of {now.limit:.0f} s"
            said.append(f"  {now.waiting or far}")
        tabs = "" if self.has_class("-wide") else self.tabs()
        said.truncate(max(self.size.width - len(tabs) - 4, 0), overflow="ellipsis", pad=True)
        self.query_one("#now", Static).update(said.append(f"  {tabs}", style=QUIET))

    def show_moment(self, window: float = FLASH) -> None:
        """Show map and cursor at the moment."""
        if not self.is_attached or not self.app.is_running:
            return
        playback, transport, detail = self._playback, self.transport, self._detail()
        if playback is None or transport is None or detail is None:
            return
        self.query_one("#map", TopView).show(playback.view(transport.time, window=window))
        self.query_one("#signals", TimelineView).move(transport.time)
        self._say(detail)

    def view_changed(self) -> None:
        """Give the keys to what is shown."""
        wanted = {"verdicts": "#decided", "log": "#log"}.get(self.VIEWS[self._part])
        if wanted is not None and self.query(wanted):
            self.query_one(wanted).focus(scroll_visible=False)
        else:
            self.set_focus(None)
        self.update_from_state()

    @work(thread=True, exclusive=True)
    def _open(self, path: Path, verdicts: tuple[Verdict, ...]) -> None:
        """Read the whole trace outside the thread that draws, then show it."""
        # What reads traces takes a while to load, and the dashboard is to be there at once.
        from daemon.trace import TraceError

        try:
            playback = self.dashboard.read_playback(path, verdicts)
        except TraceError as error:
            why = "; ".join(f"{d.message}\n\n{d.hint}" for d in error.diagnostics)
            self.app.call_from_thread(self._broken, f"{why}: {path}")
            return
        self.app.call_from_thread(self._ready, playback)

    def _broken(self, why: str) -> None:
        self._damage = why
        self.update_from_state()

    def _ready(self, playback: Playback) -> None:
        """Show the run at the moment that tells most."""
        self._playback = playback
        self.query_one(RunMap).explain("")
        self.query_one("#untold").display = False
        signals = self.query_one("#signals", TimelineView)
        signals.display = self.query_one("#signs").display = True
        signals.show((playback.timeline,))
        self.begin(ReplayTransport(playback.start, playback.end, playback.start, playing=False))
        self._go_to_chosen()
        self.update_from_state()

    @on(OptionList.OptionHighlighted)
    @on(OptionList.OptionSelected)
    def _go_to_chosen(self) -> None:
        """Go to when the chosen oracle was decided; Enter goes back there."""
        chosen = self.query_one(VerdictList).chosen()
        if chosen is None:
            return
        self.query_one("#signals", TimelineView).lead(chosen.oracle)
        if chosen.evidence.time is not None:
            self.go(chosen.evidence.time)

    def action_replay(self) -> None:
        """Play the recorded run, the map alone, once its trace is read."""
        if self._playback is not None and self.transport is not None:
            from scenario_tui.dashboard.screens.replay import ReplayScreen

            self.transport.playing = False
            self.app.push_screen(ReplayScreen(self._playback, self.transport.time))
        else:
            self.notify(self._why_not())

    def _why_not(self) -> str:
        """Return why the run cannot be played."""
        seen = self.dashboard.daemon_state.recording_of(self._run)
        if self._damage or isinstance(seen, UnavailableTrace):
            return self._damage or (seen.why if isinstance(seen, UnavailableTrace) else "")
        return "its trace is being read" if self._opened else "a run can be played when it is over"

    def action_compare(self) -> None:
        """Compare with the run that was marked, or mark this one."""
        from scenario_tui.dashboard.screens.compare import mark_or_compare

        mark_or_compare(self.dashboard, self._run)


def _runs(detail: RunDetail) -> bool:
    return detail.row.state is RunState.RUNNING


def _unfinished(detail: RunDetail) -> bool:
    return detail.row.state in (RunState.QUEUED, RunState.RUNNING)
