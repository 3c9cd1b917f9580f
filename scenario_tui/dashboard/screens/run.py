"""One run: verdicts, signals, map and log, while it runs and at any moment of it afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widgets import ContentSwitcher, OptionList, Static

from daemon.model.status import CampaignRow, RunDetail
from daemon.model.verbs import DaemonClient
from scenario_tui.dashboard.recorded_traces import (
    RecordingVersion,
    TraceSummary,
    UnavailableTrace,
    recording_version,
)
from scenario_tui.dashboard.run_timeline import RunTimeline
from scenario_tui.dashboard.run_watch import RunNews
from scenario_tui.dashboard.screens.base import show_message_or
from scenario_tui.dashboard.screens.maps import MapActions
from scenario_tui.dashboard.screens.parts import Parts
from scenario_tui.dashboard.screens.playing import PlayingScreen, clock_line
from scenario_tui.dashboard.screens.run_log import log_text
from scenario_tui.dashboard.screens.run_panel import RunMap, top_view_of, track_of
from scenario_tui.dashboard.screens.steering import SteeringScreen
from scenario_tui.dashboard.screens.unfinished_run import (
    UnfinishedRun,
    is_running,
    live_text,
)
from scenario_tui.dashboard.state import Known
from scenario_tui.dashboard.transport import (
    FLASH,
    FailureMoment,
    LiveTransport,
    ReplayTransport,
    follows,
)
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.tables import VerdictList
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.timeline_drawing import LEGEND as SIGNS
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.text.formatting import glyph_word, run_label, run_word
from scenario_tui.text.run_text import run_text
from scenario_tui.text.styles import QUIET

if TYPE_CHECKING:
    from scenario_tui.dashboard.playback import Playback

_VAST: Final = 170
"""Columns from which on map and signals stand side by side."""


class RunScreen(Parts, MapActions, PlayingScreen, SteeringScreen[RunNews]):
    """A run by its id; one that is over is played as soon as its trace is read."""

    # More than twenty methods: ten answer what its two bases ask of a screen, and each of the
    # others fills one part of it. The map, alone with the legend, is RunMap.

    AUTO_FOCUS = "VerdictList"
    VIEWS = ("verdicts", "signals", "map", "log")
    IN_FOOTER = (
        "back", "view", "replay-play", "next-failure", "zoom", "compare", "help", "quit",
    )  # fmt: skip

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "play", "Play", id="replay-play", tooltip="Or pause, or once more"),
        Binding("space", "stay", "Stay", id="replay-play", tooltip="At this moment of the run"),
        Binding("p", "replay", "Play", show=False, id="play",
                tooltip="Watch the recorded run from above, the map alone"),
        Binding("C", "compare", "Compare", id="compare",
                tooltip="With another run: the one marked before, or the next one marked"),
    ]  # fmt: skip

    def __init__(self, run: str) -> None:
        super().__init__()
        self._run = run
        self._playback: Playback | None = None
        self._version: RecordingVersion | None = None
        self._opened: RecordingVersion | None = None
        self._damage = ""
        self._shown: object = None
        self._unfinished = UnfinishedRun()
        self._since = 0.0

    def body(self) -> ComposeResult:
        """Words on the left; map and signals on the right, or one of them alone."""
        yield StaticText(id="now")
        with Horizontal(id="desk"):
            with Vertical(id="left", classes="part in-verdicts in-log"):
                with ContentSwitcher(id="told", initial="words", classes="part in-verdicts"):
                    with VerticalScroll(id="words"):
                        yield StaticText(id="run-text")
                    yield VerdictList(id="decided")
                with VerticalScroll(id="log", classes="part in-log"):
                    yield StaticText(id="log-text")
            with Vertical(id="right", classes="part in-signals in-map"):
                yield RunMap().add_class("part", "in-map")
                with Vertical(id="along", classes="part in-signals"):
                    yield StaticText(id="untold")
                    yield TimelineView(id="signals")
                    yield StaticText(SIGNS, id="signs")

    def on_resize(self) -> None:
        """Put map and signals side by side where there is room for that."""
        self.set_class(self.size.width >= _VAST, "-vast")
        self.call_after_refresh(self.update_from_state)

    @property
    def about(self) -> str:
        """The campaign of the run."""
        return self._run.rpartition(".")[0]

    def fetch(self, daemon: DaemonClient, known: Known) -> RunNews | None:
        """Return this run, with how it is judged while it runs."""
        return self.dashboard.feed.watch.look(daemon, self._run, judged=True)

    def command(self) -> str:
        """Return what to type to be told of it."""
        return self._line("show", self._run)

    def cursor_command(self) -> str:
        """Return what to type for the moment of the verdict under the cursor."""
        chosen = self.query_one(VerdictList).chosen()
        if chosen is None:
            return self.command()
        return self._line("replay", self._run, "--frame", chosen.oracle)

    def campaign(self) -> CampaignRow | None:
        """Return the campaign the run is part of."""
        return self.dashboard.known.campaign(self.about)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """One key plays a run, and stays where it is in one that is followed."""
        if action in ("play", "stay") and follows(self.transport) != (action == "stay"):
            return False
        return super().check_action(action, parameters)

    def action_stay(self) -> None:
        """Stay at the moment shown of a run that goes on."""
        self.action_play()

    def trail(self) -> str:
        """Where we are."""
        detail = self._detail()
        label = run_label(detail.row) if detail is not None else self._run
        return f"campaigns › {self.about} › {label}"

    def moments(self) -> Sequence[FailureMoment]:
        """Return when its oracles were decided against, of a run that goes on until now."""
        return (self._playback or self._unfinished).moments

    def _detail(self) -> RunDetail | None:
        return self.news.detail if self.news is not None else None

    def show(self, known: Known, news: RunNews | None) -> None:
        """Show what is known of the run: live, or as it was."""
        if news is None:
            return
        detail = news.detail
        self.dashboard.tracks.forget_ended((detail.row,))
        version = recording_version(detail)
        if version != self._version:
            self._change_version(version)
        self._unfinished.hear(detail, track_of(self.dashboard, detail))
        seen = news.recording
        if isinstance(seen, TraceSummary) and version is not None and version != self._opened:
            self._opened = version
            self._open(seen.path, version)
        self._words(detail)
        if self._playback is None:
            self._show_live(news)
        self._say(detail)

    def _change_version(self, version: RecordingVersion | None) -> None:
        """Drop the recording of an earlier attempt or judgement.

        A run that was only judged again keeps the moment that somebody chose.
        """
        before, self._version = self._version, version
        self._opened, self._playback, self._damage = None, None, ""
        if before is not None and (version is None or version.sha256 != before.sha256):
            self._unfinished = UnfinishedRun()
            self.transport = None
            self._since = self.dashboard.clock()
            self.refresh_bindings()

    def _words(self, detail: RunDetail) -> None:
        """Show verdicts once there are any, and the log."""
        track = self._unfinished.track
        result, judgement = detail.row.result, track.judgement if track else None
        so_far = judgement.verdicts if judgement else ()
        judged = result is not None or bool(so_far)
        told = self.query_one(ContentSwitcher)
        if judged and told.current != "decided":
            self.call_after_refresh(self.view_changed)
        told.current = "decided" if judged else "words"
        if result is not None:
            self.query_one(VerdictList).show(result.verdicts)
        elif so_far:
            self.query_one(VerdictList).show(so_far, so_far=True)
        else:
            snapshot = track.snapshot if track else None
            self.query_one("#run-text", Static).update(run_text(detail, snapshot))
        shown = (detail, self._playback, judgement)
        if self._shown != shown:
            if self._shown is None:
                # What is going on for a run that runs, why it failed for one that is over.
                self.show_view(self.VIEWS.index("map") if is_running(detail) else 0)
                self._since = self.dashboard.clock()
            self._shown = shown
            words = log_text(detail, self._playback, judgement=judgement)
            self.query_one("#log-text", Static).update(words)
            # While it grows its end stays in view, unless somebody scrolled up.
            log, grows = self.query_one("#log", VerticalScroll), result is None and judgement
            if bool(grows) != log.is_anchored:
                log.anchor(bool(grows))

    def _show_live(self, news: RunNews) -> None:
        """Show the map and the signals as they are now, or why there is nothing to see."""
        detail, live = news.detail, self._unfinished
        track = live.track
        view, why = top_view_of(news, track)
        why = self._damage or why
        above, signals = self.query_one(RunMap), self.query_one("#signals", TimelineView)
        # Where the words are not beside the map, the first line has no room for all of it.
        starting = track.snapshot.waiting if track and not self.has_class("-wide") else ""
        above.explain(why)
        above.note(starting)
        if live.grow(detail) and live.timeline is not None:
            self._grow(signals, live.timeline)
        reason = live.why_untold(detail, self.dashboard.clock() - self._since)
        untold = "" if live.timeline else reason
        show_message_or(self.query_one("#untold"), signals, why or untold)
        self.set_class(bool(untold) and not why, "-untold")
        soon = is_running(detail) and not (track and track.judgement)
        self.query_one("#signs").display = not (why or untold)
        # As text: what a system waits for may have brackets, which are markup otherwise.
        self.query_one("#signs", Static).update(Text(reason if soon else SIGNS))
        if not why and view is not None:
            live.take_map(view)
            above.show(live.view_at(self.transport))

    def _grow(self, signals: TimelineView, known: RunTimeline) -> None:
        """Show signals that have grown; the cursor goes along unless somebody went back."""
        transport = self.transport
        if not isinstance(transport, LiveTransport):
            transport = LiveTransport(known.start, known.end, known.end)
            self.transport = transport
            self.refresh_bindings()
        transport.grow(known.start, known.end)
        signals.show((known,), transport.time)

    def _say(self, detail: RunDetail) -> None:
        """Say when it is and which part of the screen this is."""
        word = run_word(detail.row)
        said = Text(glyph_word(word), style=word)
        track = track_of(self.dashboard, detail)
        if self.transport is not None and self._playback is not None:
            reached = self._playback.reached(self.transport.time)
            said.append(f"  {clock_line(self.transport)}  {reached}/{self._playback.waypoints} wp")
            if line := self._playback.stack_line(self.transport.time):
                said.append(f"  {line}", style=QUIET)
        elif track is not None:
            silence, wide = self.dashboard.tracks.silence(track), self.has_class("-wide")
            said.append_text(live_text(track, silence, self.transport, self.key("end"), wide=wide))
        tabs = self.tabs()
        said.truncate(max(self.size.width - len(tabs) - 4, 0), overflow="ellipsis", pad=True)
        self.query_one("#now", Static).update(said.append(f"  {tabs}", style=QUIET))

    def show_moment(self, window: float = FLASH) -> None:
        """Show map and cursor at the moment."""
        if not self.is_attached or not self.app.is_running:
            return
        playback, transport, detail = self._playback, self.transport, self._detail()
        if transport is None or detail is None:
            return
        if playback is not None:
            self.query_one("#map", TopView).show(playback.view(transport.time, window=window))
        else:
            self.query_one(RunMap).show(self._unfinished.view_at(transport))
        self.query_one("#signals", TimelineView).move(transport.time)
        self._say(detail)

    def view_changed(self) -> None:
        """Give the keys to what is shown."""
        wanted = {"verdicts": "#decided", "log": "#log"}.get(self.part)
        if wanted is None and self.has_class("-wide"):
            wanted = "#decided"  # in view as well, and the only part of these that takes keys
        if wanted is not None and self.query(wanted):
            self.query_one(wanted).focus(scroll_visible=False)
        else:
            self.set_focus(None)
        self.update_from_state()

    @work(thread=True, exclusive=True)
    def _open(self, path: Path, version: RecordingVersion) -> None:
        """Read the whole trace outside the thread that draws, then show it."""
        # What reads traces takes a while to load, and the dashboard is to be there at once.
        from daemon.trace import TraceError

        try:
            playback = self.dashboard.read_playback(path, version.verdicts)
        except TraceError as error:
            why = "; ".join(f"{d.message}\n\n{d.hint}" for d in error.findings)
            self.app.call_from_thread(self._broken, version, f"{why}: {path}")
            return
        self.app.call_from_thread(self._ready, version, playback)

    def _broken(self, version: RecordingVersion, why: str) -> None:
        if version == self._version:
            self._damage = why
            self.update_from_state()

    def _ready(self, version: RecordingVersion, playback: Playback) -> None:
        """Show the run at the moment that tells most."""
        if version != self._version:
            return  # it was executed or judged again while this was read
        self._playback = playback
        self.query_one(RunMap).explain("")
        self.query_one(RunMap).note("")
        self.remove_class("-untold")
        self.query_one("#untold").display = False
        signals = self.query_one("#signals", TimelineView)
        signals.display = self.query_one("#signs").display = True
        signals.show((playback.timeline,))
        # Who watched it to its end stays there; who opens it sees the moment that tells most.
        # Who went back in it stays at that moment.
        before, watched = self.transport, self._unfinished.timeline is not None
        now = playback.end if watched else playback.start
        if before is not None and not follows(before):
            now = playback.within(before.time)
        self.begin(ReplayTransport(playback.start, playback.end, now, playing=False))
        if before is None and not watched:
            self._go_to_chosen()
        self.update_from_state()

    @on(OptionList.OptionHighlighted)
    @on(OptionList.OptionSelected)
    def _go_to_chosen(self, event: OptionList.OptionMessage | None = None) -> None:
        """Go to when the chosen oracle was decided; Enter goes back there."""
        chosen = self.query_one(VerdictList).chosen()
        if chosen is None:
            return
        self.query_one("#signals", TimelineView).lead(chosen.oracle)
        # The list of a run that goes on changes by itself: only Enter stops the clock there.
        asked = self._playback is not None or isinstance(event, OptionList.OptionSelected)
        if chosen.evidence.time is not None and asked:
            self.go(chosen.evidence.time)

    def action_view(self, step: int) -> None:
        """Show the next part of the screen; where all are in view, give the log the keys."""
        if not self.has_class("-wide"):
            super().action_view(step)
        else:
            verdicts, log = self.VIEWS.index("verdicts"), self.VIEWS.index("log")
            self.show_view(verdicts if self._part == log else log)

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
        seen = self.news.recording if self.news is not None else None
        if self._damage or isinstance(seen, UnavailableTrace):
            return self._damage or (seen.why if isinstance(seen, UnavailableTrace) else "")
        return "its trace is being read" if self._opened else "a run can be played when it is over"

    def action_compare(self) -> None:
        """Compare with the run that was marked, or mark this one."""
        from scenario_tui.dashboard.screens.compare import mark_or_compare

        mark_or_compare(self.dashboard, self._run)
