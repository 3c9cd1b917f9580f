"""One run in words and from above: the panel beside the table of runs, and the map alone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Vertical, VerticalScroll
from textual.widgets import Static

from daemon.model.assessments import Mark
from daemon.model.run_state import RunState
from daemon.model.status import RunDetail, RunRow
from scenario_tui.dashboard.live_run import LiveRun
from scenario_tui.dashboard.live_tracks import Track
from scenario_tui.dashboard.recordings import Missing
from scenario_tui.dashboard.run_watch import RunNews
from scenario_tui.dashboard.screens.base import show_message_or
from scenario_tui.dashboard.screens.playing import decisive_moment
from scenario_tui.dashboard.widgets.map_legend import MapLegend
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.text.run_text import NO_MARKS, run_text

if TYPE_CHECKING:
    from daemon.judging.assessment import Expectations
    from scenario_tui.dashboard.app import Dashboard
    from scenario_tui.dashboard.playback import Playback
    from scenario_tui.dashboard.state import Known


class RunMap(Vertical):
    """The top view of a run with its legend, or why there is none."""

    def __init__(self) -> None:
        super().__init__(id="above")
        self._still: tuple[Playback, float] | None = None

    def compose(self) -> ComposeResult:
        """Lay out map, legend, and what is said instead of them."""
        yield StaticText(id="unseen")
        yield StaticText(id="note")
        yield TopView(id="map")
        yield MapLegend(id="legend")

    def show_run(self, dashboard: Dashboard, news: RunNews | None, oracle: str = "") -> None:
        """Show a run as the dashboard knows it: live, or at the moment that decided it.

        With ``oracle`` at the moment that decided that one.
        """
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
                    return  # nothing moves, and to draw it takes some milliseconds
                view = recording.view(time, verdict=verdict)
        elif news is not None:
            live = LiveRun()
            live.hear(news, track_of(dashboard, news.detail))
            view = live.view(math.inf)
        self._still = still
        self.query_one(TopView).show(view)
        self.explain(why)

    def explain(self, why: str) -> None:
        """Say ``why`` there is no map; show the map when that is empty."""
        show_message_or(self.query_one("#unseen"), self.query_one(TopView), why)
        self.query_one("#legend").display = not why

    def note(self, words: str) -> None:
        """Say something above the map, or nothing."""
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
        """Show a run as the dashboard knows it, or nothing."""
        words, above = self.query_one("#run-text", Static), self.query_one(RunMap)
        if news is None:
            words.update("")
        else:
            track = track_of(dashboard, news.detail)
            expectations = expectations_of(dashboard.known, news.detail.row)
            words.update(run_text(news.detail, track.snapshot if track else None, expectations))
        above.show_run(dashboard, news)


def track_of(dashboard: Dashboard, detail: RunDetail) -> Track | None:
    """Return what was heard of a run that is running."""
    running = detail.row.state is RunState.RUNNING
    return dashboard.tracks.get(detail.row.id) if running else None


def expectations_of(known: Known, row: RunRow) -> Expectations | None:
    """Return what marks a run and its verdicts, once its campaign is judged."""
    conclusion = known.conclusions.get(row.campaign)
    return None if conclusion is None else conclusion.expectations


def marks_of(dashboard: Dashboard, row: RunRow) -> Mapping[str, Mark]:
    """Return the marks of the verdicts of a run, by the oracle's name."""
    expectations = expectations_of(dashboard.known, row)
    return NO_MARKS if expectations is None else expectations.mark_verdicts(row)
