"""One run in words and from above: the panel beside the table of runs, and its map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Vertical, VerticalScroll
from textual.widgets import Static

from daemon.model.assessments import Mark
from daemon.model.status import RunDetail, RunRow
from daemon.model.verdicts import RunState
from scenario_tui.dashboard.live_run import LiveRun
from scenario_tui.dashboard.recordings import Missing
from scenario_tui.dashboard.run_watch import RunNews, Track
from scenario_tui.dashboard.screens.playing import decisive_moment
from scenario_tui.dashboard.widgets.static_text import StaticText, show_message_or
from scenario_tui.dashboard.widgets.top_view import MapLegend, TopView
from scenario_tui.text.run_text import NO_MARKS, run_text

if TYPE_CHECKING:
    from daemon.judging.assessment import Expectations
    from scenario_tui.dashboard.app import Dashboard
    from scenario_tui.dashboard.playback import Playback
    from scenario_tui.dashboard.state import DashboardState


class RunMap(Vertical):
    """The top view of a run with its legend, or the reason why there is none."""

    def __init__(self) -> None:
        super().__init__(id="above")
        self._still: tuple[Playback, float] | None = None

    def compose(self) -> ComposeResult:
        """Lay out map, legend, and the messages instead of them."""
        yield StaticText(id="unseen")
        yield StaticText(id="note")
        yield TopView(id="map")
        yield MapLegend(id="legend")

    def show_run(self, dashboard: Dashboard, news: RunNews | None, oracle: str = "") -> None:
        """Show a run live, or at its decisive moment, that of ``oracle`` if given."""
        why, view, still = "", None, None
        if news is not None and news.detail.row.settled:
            recording = dashboard.recordings.get(news.detail.row)
            if isinstance(recording, Missing):
                why = recording.why
            else:
                verdict = next((v for v in recording.verdicts if v.oracle == oracle), None)
                marks = marks_of(dashboard, news.detail.row)
                moment = verdict.moment if verdict else decisive_moment(recording, marks)
                time = recording.end if moment is None else moment
                still = (recording, time)
                if still == self._still:
                    return  # the view has not changed, and a drawing takes some milliseconds
                view = recording.view(time, verdict=verdict)
        elif news is not None:
            live = LiveRun()
            live.hear(news, track_of(dashboard, news.detail))
            view = live.view(math.inf)
        self._still = still
        self.query_one(TopView).show(view)
        self.explain(why)

    def explain(self, why: str) -> None:
        """Show the reason ``why`` there is no map, or the map if it is empty."""
        show_message_or(self.query_one("#unseen"), self.query_one(TopView), why)
        self.query_one("#legend").display = not why

    def note(self, words: str) -> None:
        """Show a note above the map, or none."""
        note = self.query_one("#note", Static)
        note.update(Text(words))
        note.display = bool(words)


class RunPanel(Vertical):
    """Words and map of one run, one above the other: beside the table of runs."""

    BORDER_TITLE = "run "

    def compose(self) -> ComposeResult:
        """Lay out words and map."""
        with VerticalScroll(id="words"):
            yield StaticText(id="run-text")
        yield RunMap()

    def show(self, dashboard: Dashboard, news: RunNews | None) -> None:
        """Show a run, or nothing."""
        words, above = self.query_one("#run-text", Static), self.query_one(RunMap)
        if news is None:
            words.update("")
        else:
            track = track_of(dashboard, news.detail)
            expectations = expectations_of(dashboard.state, news.detail.row)
            words.update(run_text(news.detail, track.snapshot if track else None, expectations))
        above.show_run(dashboard, news)


def track_of(dashboard: Dashboard, detail: RunDetail) -> Track | None:
    """Return the track of a running run, if it has any snapshot."""
    is_running = detail.row.state is RunState.RUNNING
    return dashboard.tracks.get(detail.row.id) if is_running else None


def expectations_of(state: DashboardState, row: RunRow) -> Expectations | None:
    """Return the expectations that mark a run, once its campaign is judged."""
    conclusion = state.conclusions.get(row.campaign)
    return None if conclusion is None else conclusion.expectations


def marks_of(dashboard: Dashboard, row: RunRow) -> Mapping[str, Mark]:
    """Return the marks of the verdicts of a run, by the oracle's name."""
    expectations = expectations_of(dashboard.state, row)
    return NO_MARKS if expectations is None else expectations.mark_verdicts(row)
