"""One run: verdicts, signals, map and log, while it runs and at any moment afterwards."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, Final

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widgets import ContentSwitcher, OptionList, Static

from daemon.model.assessments import Mark
from daemon.model.status import RunDetail
from daemon.model.verbs import DaemonClient
from daemon.model.verdicts import RunState
from scenario_tui.dashboard.live_run import LiveRun, live_text
from scenario_tui.dashboard.recordings import Missing
from scenario_tui.dashboard.run_log import log_text
from scenario_tui.dashboard.run_timeline import RunTimeline
from scenario_tui.dashboard.run_watch import RunNews
from scenario_tui.dashboard.screens.parts import Parts
from scenario_tui.dashboard.screens.playing import (
    MapActions,
    PlayingScreen,
    clock_line,
    decisive_moment,
)
from scenario_tui.dashboard.screens.run_panel import RunMap, expectations_of, marks_of, track_of
from scenario_tui.dashboard.screens.steering import SteeringScreen
from scenario_tui.dashboard.state import DashboardState
from scenario_tui.dashboard.transport import FLASH, FailureMoment, ReplayTransport
from scenario_tui.dashboard.widgets.static_text import StaticText, show_message_or
from scenario_tui.dashboard.widgets.tables import VerdictList
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.timeline_drawing import LEGEND as SIGNS
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.text.run_text import by_severity, marked_word, run_text
from scenario_tui.text.styles import QUIET, UNSURE

if TYPE_CHECKING:
    from scenario_tui.dashboard.playback import Playback

_VAST: Final = 170
"""Least columns for map and signals side by side."""


class RunScreen(Parts, MapActions, PlayingScreen, SteeringScreen[RunNews]):
    """A run by its id; a finished one can be played as soon as its trace is read."""

    # Ten of the methods implement its bases, and each other method fills a part of the screen.
    # The map with its legend is RunMap.

    AUTO_FOCUS = "VerdictList"
    VIEWS = ("verdicts", "signals", "map", "log")
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "play", "Play", id="replay-play", tooltip="Play, pause, or play again"),
        Binding("space", "stay", "Stay", id="replay-play", tooltip="At this moment of the run"),
        Binding("p", "replay", "Play", show=False, id="play",
                tooltip="Watch the recorded run from above, only the map"),
        Binding("C", "compare", "Compare", id="compare",
                tooltip="With another run: the marked one, or the next one you mark"),
    ]  # fmt: skip

    def __init__(self, run: str) -> None:
        super().__init__()
        self._run_id, self.about = run, run.rpartition(".")[0]
        self._live = LiveRun()
        self._recording: Playback | None = None
        self._digest = ""
        self._drawn: RunTimeline | None = None
        self._logged: object = None
        self._since = 0.0

    @property
    def _run(self) -> Playback | LiveRun:
        return self._recording or self._live

    def body(self) -> ComposeResult:
        """Lay out words on the left; map and signals on the right, or one of them."""
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
        """Put map and signals side by side if there is room."""
        self.set_class(self.size.width >= _VAST, "-vast")
        self.call_after_refresh(self.update_from_state)

    def on_screen_resume(self) -> None:
        """Try once more to read a missing recording."""
        self.dashboard.recordings.look_again()

    def fetch(self, daemon: DaemonClient, state: DashboardState) -> RunNews | None:
        """Return this run, with its judgement so far while it runs."""
        return self.dashboard.feed.watch.look(daemon, self._run_id, judged=True)

    def command(self) -> str:
        """Return the command that shows the run."""
        return self._line("show", self._run_id)

    def cursor_command(self) -> str:
        """Return the command for the moment of the verdict under the cursor."""
        verdict = self.query_one(VerdictList).chosen()
        if verdict is None:
            return self.command()
        return self._line("replay", self._run_id, "--frame", verdict.oracle)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Let one key play a run, or stop following a live one."""
        follows = self.transport is not None and self.transport.follows
        if action in ("play", "stay") and follows != (action == "stay"):
            return False
        return super().check_action(action, parameters)

    def action_stay(self) -> None:
        """Stay at the present moment of a live run."""
        self.action_play()

    def trail(self) -> str:
        """Return the campaign and the run."""
        label = self.news.detail.row.label if self.news is not None else self._run_id
        return f"campaigns › {self.about} › {label}"

    def moments(self) -> Sequence[FailureMoment]:
        """Return the moments at which its oracles failed so far."""
        return self._run.moments

    def show(self, state: DashboardState, news: RunNews | None) -> None:
        """Show the run: live, or recorded."""
        if news is None:
            return
        self.dashboard.tracks.forget_ended((news.detail.row,))
        why = self._take(news)
        self._show_words(news.detail)
        self._show_run(news.detail, why)
        self._say(news.detail)

    def _take(self, news: RunNews) -> str:
        """Take in the news of the run; return why it has no map, empty if it has one."""
        row = news.detail.row
        digest = row.result.trace.sha256 if row.settled and row.result is not None else ""
        if self._digest not in ("", digest):
            # It is being executed again, or was in the meantime.
            self._live, self._recording, self._drawn = LiveRun(), None, None
            self.transport, self._since = None, self.dashboard.clock()
            self.refresh_bindings()
        self._digest = digest
        recording = self.dashboard.recordings.get(row) if row.settled else Missing()
        if not isinstance(recording, Missing):
            self._recording = recording
            return ""
        self._live.hear(news, track_of(self.dashboard, news.detail))
        return recording.why if self._recording is None else ""

    def _show_words(self, detail: RunDetail) -> None:
        """Show verdicts, before the first one the run in words, and the log."""
        judgement, so_far = self._live.judgement, detail.row.result is None
        verdicts = judgement.verdicts if so_far and judgement else detail.row.verdicts
        judged = not so_far or bool(verdicts)
        words = self.query_one(ContentSwitcher)
        if judged and words.current != "decided":
            self.call_after_refresh(self.view_changed)
        words.current = "decided" if judged else "words"
        if judged:
            marks = marks_of(self.dashboard, detail.row)
            self.query_one(VerdictList).show(verdicts, marks, so_far=so_far)
        else:
            self.query_one("#run-text", Static).update(run_text(detail, self._live.snapshot))
        logged = (detail, self._run, judgement)
        if self._logged == logged:
            return
        if self._logged is None:
            # First the map of a running run, the verdicts of a finished one.
            self.show_view(self.VIEWS.index("map") if _is_running(detail) else 0)
            self._since = self.dashboard.clock()
        self._logged = logged
        self.query_one("#log-text", Static).update(log_text(detail, self._run.log))
        # The end of a growing log stays in view, unless the user has scrolled up.
        log, grows = self.query_one("#log", VerticalScroll), so_far and judgement is not None
        if grows != log.is_anchored:
            log.anchor(grows)

    def _show_run(self, detail: RunDetail, why: str) -> None:
        """Show map and signals, or the reason ``why`` there are none."""
        above, signals = self.query_one(RunMap), self.query_one(TimelineView)
        live, timeline, snapshot = self._recording is None, self._run.timeline, self._live.snapshot
        above.explain(why)
        # Without words beside the map, the first line has no room for the whole text.
        above.note(snapshot.waiting if live and snapshot and not self.has_class("-wide") else "")
        reason = self._live.why_untold(self.dashboard.clock() - self._since) if live else ""
        untold = "" if timeline else reason
        show_message_or(self.query_one("#untold"), signals, why or untold)
        self.set_class(bool(untold) and not why, "-untold")
        self.query_one("#signs").display = not (why or untold)
        # As text: the reason may have brackets, which would be markup.
        soon = live and _is_running(detail) and self._live.judgement is None
        self.query_one("#signs", Static).update(Text(reason if soon else SIGNS))
        if timeline is not None and timeline is not self._drawn:
            self._drawn = timeline
            signals.show((timeline,))
            self._follow(timeline)
        elif live and not why:
            self.show_moment()

    def _follow(self, timeline: RunTimeline) -> None:
        """Follow the run with the displayed moment, unless the user has gone back.

        A recording opens at the moment that was in view, otherwise at the most telling one.
        """
        start, end, before = timeline.start, timeline.end, self.transport
        if self._recording is not None:
            now = self._telling_moment(self._recording)
            if before is not None:
                now = end if before.follows else before.time
            now = self._recording.within(now)
            self.begin(ReplayTransport(start, end, now, playing=False))
            return
        if before is None or not before.live:
            self.transport = before = ReplayTransport(
                start, end, end, playing=False, live=True, follows=True
            )
            self.refresh_bindings()
        before.grow(start, end)
        self.show_moment()

    def _telling_moment(self, recording: Playback) -> float:
        """Return the decisive moment [s], otherwise that of the gravest verdict."""
        if (decisive := decisive_moment(recording, self._marks())) is not None:
            return decisive
        moments = (verdict.moment for verdict in by_severity(recording.verdicts))
        return next((moment for moment in moments if moment is not None), recording.start)

    def _marks(self) -> Mapping[str, Mark]:
        return {} if self.news is None else marks_of(self.dashboard, self.news.detail.row)

    def _say(self, detail: RunDetail) -> None:
        """Show the moment, and the part of the screen in view."""
        transport, waypoints = self.transport, len(detail.spec.mission.waypoints)
        line = marked_word(detail.row, expectations_of(self.dashboard.state, detail.row))
        track = self._live.track if self._recording is None else None
        if track is not None and (transport is None or transport.follows):
            silence, wide = self.dashboard.tracks.silence(track), self.has_class("-wide")
            line.append_text(live_text(track, silence, wide=wide))
        elif transport is not None:
            style, more = UNSURE, f"{self.key('end')} follows again"
            if self._recording is not None:
                style, more = "", self._recording.stack_line(transport.time)
            line.append(f"  {clock_line(transport)}", style=style)
            line.append(f"  {self._run.reached(transport.time)}/{waypoints} wp")
            line.append(f"  {more}" if more else "", style=QUIET)
        self.query_one("#now", Static).update(self.with_tabs(line))

    def show_moment(self, window: float = FLASH) -> None:
        """Show map and signals at the moment."""
        if not self.is_attached or not self.app.is_running or self.news is None:
            return
        time = math.inf if self.transport is None else self.transport.time
        verdict = self.query_one(VerdictList).chosen()
        verdict = verdict if verdict is not None and verdict.moment == time else None
        self.query_one(TopView).show(self._run.view(time, window=window, verdict=verdict))
        if self.transport is not None:
            self.query_one(TimelineView).move(time)
        self._say(self.news.detail)

    def view_changed(self) -> None:
        """Give the focus to the part in view."""
        target = {"verdicts": "#decided", "log": "#log"}.get(self.part)
        if target is None and self.has_class("-wide"):
            target = "#decided"  # in view as well, and it takes keys
        if target is not None:
            self.query_one(target).focus(scroll_visible=False)
        else:
            self.set_focus(None)
        self.update_from_state()

    def show_failure(self, moment: FailureMoment) -> None:
        """Go to the moment of a failure, and to its verdict."""
        self.query_one(VerdictList).choose(moment.oracle)
        super().show_failure(moment)

    @on(OptionList.OptionHighlighted)
    @on(OptionList.OptionSelected)
    def _go_to_chosen(self, event: OptionList.OptionMessage) -> None:
        """Go to the moment that decided the chosen oracle; Enter goes back there."""
        verdict = self.query_one(VerdictList).chosen()
        if verdict is None:
            return
        self.query_one(TimelineView).lead(verdict.oracle)
        # The list of a live run changes by itself, so there only Enter stops the clock.
        is_asked = self._recording is not None or isinstance(event, OptionList.OptionSelected)
        if verdict.moment is not None and is_asked:
            self.go(verdict.moment)

    def action_view(self, step: int) -> None:
        """Show the next part of the screen; if all are in view, give the focus to the log."""
        if not self.has_class("-wide"):
            super().action_view(step)
        else:
            verdicts, log = self.VIEWS.index("verdicts"), self.VIEWS.index("log")
            self.show_view(verdicts if self._part == log else log)

    def action_replay(self) -> None:
        """Play the recorded run, only the map, once its trace is read."""
        if self._recording is None or self.transport is None:
            recording = (
                self.dashboard.recordings.get(self.news.detail.row) if self.news else Missing()
            )
            why = recording.why if isinstance(recording, Missing) else ""
            self.notify(why or "its trace is being read", markup=False)
            return
        from scenario_tui.dashboard.screens.replay import ReplayScreen

        self.transport.playing = False
        at, end = self.transport.time, self.transport.end
        # At the end of the run there is nothing left to play: use the default.
        begin = at if at < end else None
        self.app.push_screen(ReplayScreen(self._recording, begin, marks=self._marks()))

    def action_compare(self) -> None:
        """Compare with the marked run, or mark this one."""
        from scenario_tui.dashboard.screens.compare import mark_or_compare

        mark_or_compare(self.dashboard, self._run_id)


def _is_running(detail: RunDetail) -> bool:
    return detail.row.state is RunState.RUNNING
