"""One run: verdicts, signals, map and log, while it runs and at any moment of it afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widgets import OptionList, Static

from daemon.model.live_judgement import LiveJudgement
from daemon.model.status import CampaignRow, RunDetail, RunState
from daemon.model.verdicts import Verdict
from scenario_tui.dashboard.live_timeline import heard_timeline, live_timeline
from scenario_tui.dashboard.screens.base import show_message_or
from scenario_tui.dashboard.screens.playing import PlayingScreen, clock_line
from scenario_tui.dashboard.screens.run_log import log_text
from scenario_tui.dashboard.screens.run_panel import RunMap, top_view_of, track_of
from scenario_tui.dashboard.screens.steering import SteeringScreen
from scenario_tui.dashboard.signal_strips import (
    FLASH,
    FailureMoment,
    ReplayTransport,
    RunTimeline,
    clearance_along,
    limits_of,
)
from scenario_tui.dashboard.state import (
    DashboardState,
    Query,
    TraceSummary,
    Track,
    UnavailableTrace,
)
from scenario_tui.dashboard.widgets.tables import VerdictList
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.timeline_drawing import LEGEND as SIGNS
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    QUIET,
    UNSURE,
    duration,
    glyph_word,
    run_label,
    run_word,
)
from scenario_tui.text.provisional_text import worst_text
from scenario_tui.text.run_text import run_text

if TYPE_CHECKING:
    from grammars.oracle import ComparedLimit
    from scenario_tui.dashboard.playback import Playback

_VAST: Final = 170
"""Columns from which on map and signals stand side by side."""
_SILENT: Final = 5.0
"""Seconds after which a run that says nothing is said to be silent."""
_PATIENCE: Final = 30.0
"""Seconds after which somebody who looks is told that no signals come."""


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
        self._track: Track | None = None
        self._judgement: LiveJudgement | None = None
        self._so_far: RunTimeline | None = None
        self._limits: tuple[ComparedLimit, ...] | None = None
        self._since = 0.0

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
                yield Static(id="starting")
                yield RunMap()
                with Vertical(id="along"):
                    yield Static(id="untold")
                    yield TimelineView(id="signals")
                    yield Static(SIGNS, id="signs")

    def on_resize(self) -> None:
        """Put map and signals side by side where there is room for that."""
        self.set_class(self.size.width >= _VAST, "-vast")
        self.call_after_refresh(self.update_from_state)

    def state_query(self) -> Query:
        """This run, and how it is judged while it runs."""
        return Query(run=self._run, judged=True)

    def rejudge_target(self) -> str:
        """This run alone is judged again."""
        return self._run

    def command(self) -> str:
        """Return what to type to be told of it."""
        return self._line("show", self._run)

    def cursor_command(self) -> str:
        """Return what to type for the moment of the verdict under the cursor."""
        chosen = self.query_one(VerdictList).chosen()
        if chosen is None:
            return self.command()
        return self._line("replay", self._run, "--frame", chosen.oracle)

    def cursor_lines(self) -> list[tuple[str, str]]:
        """Return what can be typed about the verdict and its run."""
        return [("the verdict's moment", self.cursor_command()), *self.run_lines(self._run)]

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
        track, seen = self._last_heard(detail), state.recording_of(self._run)
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

    def _last_heard(self, detail: RunDetail) -> Track | None:
        """Return what was heard of the run, also when it is over, until its trace is read."""
        track = track_of(self.dashboard, detail)
        if track is not None or _unfinished(detail):
            self._track = track
        if self._limits is None and _runs(detail):
            self._limits = ()
            self._read_limits(detail)
        return self._track

    @work(thread=True)
    def _read_limits(self, detail: RunDetail) -> None:
        """Read the oracles of a run outside the thread that draws: their language loads slowly."""
        self._limits = limits_of(detail.spec.oracles)
        self._judgement = None

    def _words(self, detail: RunDetail, track: Track | None) -> None:
        """Show verdicts once there are any, and the log."""
        result, judgement = detail.result, track.judgement if track else None
        so_far = judgement.verdicts if judgement else ()
        judged = result is not None or bool(so_far)
        if judged and not self.has_class("-judged"):
            self.call_after_refresh(self.view_changed)
        self.set_class(judged, "-judged")
        self.set_class(result is None and judgement is None, "-unlogged")
        if result is not None:
            self.query_one(VerdictList).show(result.verdicts)
        elif so_far:
            self.query_one(VerdictList).show_so_far(so_far)
        else:
            snapshot = track.snapshot if track else None
            self.query_one("#run-text", Static).update(run_text(detail, snapshot))
        shown = (detail, self._playback, judgement)
        if self._shown != shown:
            if self._shown is None:
                # What is going on for a run that runs, why it failed for one that is over.
                self.show_view(self.VIEWS.index("map") if _runs(detail) else 0)
                self._since = self.dashboard.clock()
            self._shown = shown
            words = log_text(detail, self._playback, judgement=judgement)
            self.query_one("#log-text", Static).update(words)
            # While it grows its end stays in view, unless somebody scrolled up.
            log, grows = self.query_one("#log", VerticalScroll), result is None and judgement
            if bool(grows) != log.is_anchored:
                log.anchor(bool(grows))

    def _show_live(self, detail: RunDetail, state: DashboardState, track: Track | None) -> None:
        """Show the map and the signals as they are now, or why there is nothing to see."""
        view, why = top_view_of(state, detail, track)
        why = self._damage or why
        above, signals = self.query_one(RunMap), self.query_one("#signals", TimelineView)
        # Where the words are not beside the map, the first line has no room for all of it.
        starting = track.snapshot.waiting if track and not self.has_class("-wide") else ""
        above.explain(why)
        self.query_one("#starting", Static).update(Text(starting))
        self.set_class(bool(starting), "-starting")
        judgement = track.judgement if track else None
        if judgement is not None and judgement is not self._judgement and judgement.signals:
            self._judgement = judgement
            self._so_far = live_timeline(judgement, detail.spec, self._limits or ())
            signals.show((self._so_far,), judgement.time)
        if not (judgement and judgement.signals) and _unfinished(detail):
            # Before the first one, and where none comes any more, snapshots tell something, too.
            before = self._so_far
            self._so_far = heard_timeline(track.heard_of, detail.spec) if track else None
            if self._so_far and (before is None or before.end != self._so_far.end):
                signals.show((self._so_far,), self._so_far.end)
        untold = "" if self._so_far else self._untold(detail, track)
        show_message_or(self.query_one("#untold"), signals, why or untold)
        told = not (why or untold)
        self.set_class(bool(untold) and not why, "-untold")
        soon = "" if judgement or not _runs(detail) else self._untold(detail, track)
        self.query_one("#signs").display = told
        # As text: what a system waits for may have brackets, which are markup otherwise.
        self.query_one("#signs", Static).update(Text(soon or SIGNS))
        if not why and view is not None:
            if self._so_far and track and judgement:
                known, limit = clearance_along(self._so_far.strips, track.times)
                view = replace(view, clearances=known, limit=limit)
            above.show(view)

    def _untold(self, detail: RunDetail, track: Track | None) -> str:
        """Return why there are no signals (yet)."""
        if detail.row.state is RunState.QUEUED:
            return "This run is queued. Its signals are drawn while it runs."
        if not _runs(detail):
            return "Its trace is being read."
        if track is None:
            return "Nothing was heard of this run yet: its worker prepares it."
        if track.snapshot.waiting:
            return f"{track.snapshot.waiting}\n\nSignals begin with simulated time, when it is up."
        if self.dashboard.clock() - self._since > _PATIENCE:
            return "Its worker tells no signals: they are drawn when the run is over."
        return "Signals and verdicts so far come in a moment."

    def _say(self, detail: RunDetail) -> None:
        """Say when it is and which part of the screen this is."""
        word = run_word(detail.row)
        said = Text(glyph_word(word), style=DASHBOARD_STYLES[word])
        track = track_of(self.dashboard, detail)
        if self.transport is not None and self._playback is not None:
            reached = self._playback.reached(self.transport.time)
            said.append(f"  {clock_line(self.transport)}  {reached}/{self._playback.waypoints} wp")
        elif track is not None:
            self._say_live(said, track)
        tabs = "" if self.has_class("-wide") else self.tabs()
        said.truncate(max(self.size.width - len(tabs) - 4, 0), overflow="ellipsis", pad=True)
        self.query_one("#now", Static).update(said.append(f"  {tabs}", style=QUIET))

    def _say_live(self, said: Text, track: Track) -> None:
        now, silence = track.snapshot, self.dashboard.tracks.silence(track)
        far = f"{now.reached}/{now.waypoints} wp  {now.time:.0f} s"
        if self.has_class("-wide") or now.margin is None:  # else the margin would be cut
            far += f" of {now.limit:.0f} s"
        if silence > _SILENT:
            said.append(f"  last heard {duration(silence)} ago", style=UNSURE)
        said.append(f"  {now.waiting or far}", style="default not bold")
        if worst := worst_text(now.margin, now.unit, now.oracle):
            said.append("  ").append_text(worst)

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
        if wanted is None and self.has_class("-wide"):
            wanted = "#decided"  # in view as well, and the only part of these that takes keys
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
        self.remove_class("-untold", "-starting")
        self.query_one("#untold").display = False
        signals = self.query_one("#signals", TimelineView)
        signals.display = self.query_one("#signs").display = True
        signals.show((playback.timeline,))
        # Who watched it to its end stays there; who opens it sees the moment that tells most.
        watched = self._so_far is not None
        now = playback.end if watched else playback.start
        self.begin(ReplayTransport(playback.start, playback.end, now, playing=False))
        if not watched:
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
            at, end = self.transport.time, self.transport.end
            # A finished run opens at its end, where there is nothing left to play.
            self.app.push_screen(ReplayScreen(self._playback, at if at < end else None))
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
