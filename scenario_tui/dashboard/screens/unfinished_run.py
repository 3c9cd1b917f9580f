"""What is heard of a run before its trace can be read: signals, map, and where it is, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from rich.text import Text

from daemon.model.live_judgement import LiveJudgement
from daemon.model.run_state import RunState
from daemon.model.status import RunDetail
from grammars.text.words import duration_text
from scenario_tui.dashboard.live_tracks import SILENT, Track
from scenario_tui.dashboard.run_timeline import (
    RunTimeline,
    clearance_along,
    decided_moments,
    heard_timeline,
    live_timeline,
)
from scenario_tui.dashboard.screens.playing import clock_line
from scenario_tui.dashboard.screens.run_panel import heard_view
from scenario_tui.dashboard.transport import (
    FailureMoment,
    LiveTransport,
    ReplayTransport,
    follows,
)
from scenario_tui.dashboard.widgets.map_frame import View
from scenario_tui.text.run_text import reached_text, worst_text
from scenario_tui.text.styles import QUIET, UNSURE

_PATIENCE: Final = 30.0
"""Seconds after which somebody who looks is told that no signals come."""


class UnfinishedRun:
    """A run somebody watches: ``track`` is what was last heard of it, ``timeline`` its signals.

    Both stay when the run is over, until its trace is read.
    """

    def __init__(self) -> None:
        self.track: Track | None = None
        self.timeline: RunTimeline | None = None
        self._judgement: LiveJudgement | None = None
        self._view: View | None = None

    @property
    def moments(self) -> Sequence[FailureMoment]:
        """When it failed by its oracles so far."""
        return decided_moments(self._judgement) if self._judgement is not None else ()

    def hear(self, detail: RunDetail, track: Track | None) -> None:
        """Take in what was heard of it; nothing is heard of one that is over."""
        if track is not None or is_unfinished(detail):
            self.track = track

    def grow(self, detail: RunDetail) -> bool:
        """Bring the timeline up to date; return whether it is another one than before."""
        track = self.track
        judgement = track.judgement if track else None
        if judgement is not None and judgement.signals:
            if judgement is self._judgement:
                return False
            self._judgement = judgement
            self.timeline = live_timeline(judgement, detail.spec)
            return True
        if not is_unfinished(detail):
            return False
        # Before the first one, and where none comes any more, snapshots tell something, too.
        before, self._judgement = self.timeline, None
        self.timeline = heard_timeline(track.heard_of, detail.spec) if track else None
        return self.timeline is not None and (before is None or before.end != self.timeline.end)

    def take_map(self, view: View) -> None:
        """Take in the map as it is now; its trail is coloured by the clearance along it."""
        track = self.track
        if self.timeline is not None and track is not None and track.judgement is not None:
            known, limit = clearance_along(self.timeline.signals, track.times)
            view = replace(view, clearances=known, limit=limit)
        self._view = view

    def view_at(self, transport: ReplayTransport | None) -> View | None:
        """Return the map of the moment shown, as it is now where nothing else is known."""
        view, track = self._view, self.track
        if view is None or track is None or transport is None or follows(transport):
            return view
        return heard_view(view, track, transport.time) or view

    def why_untold(self, detail: RunDetail, waited: float) -> str:
        """Return why there are no signals (yet), to somebody who ``waited`` that long [s]."""
        if detail.row.state is RunState.QUEUED:
            return "This run is queued. Its signals are drawn while it runs."
        if not is_running(detail):
            return "Its trace is being read."
        if self.track is None:
            return "Nothing was heard of this run yet: its worker prepares it."
        if waiting := self.track.snapshot.waiting:
            return f"{waiting}\n\nSignals begin with simulated time, when it is up."
        if waited > _PATIENCE:
            return "Its worker tells no signals: they are drawn when the run is over."
        return "Signals and verdicts so far come in a moment."


def live_text(
    track: Track, silence: float, transport: ReplayTransport | None, end_key: str, *, wide: bool
) -> Text:
    """Return where a run is, and its least margin so far; or the moment somebody went back to.

    ``silence`` is for how long nothing was heard of it [s]; ``wide`` is the line, or its parts
    have to be few.
    """
    now, said = track.snapshot, Text()
    if isinstance(transport, LiveTransport) and not transport.follows:
        said.append(f"  {clock_line(transport)}", style=UNSURE)
        return said.append(f"  {end_key} follows again", style=QUIET)
    if silence > SILENT:
        said.append(f"  last heard {duration_text(silence)} ago", style=UNSURE)
    # On a narrow line the limit would push out the margin.
    far = reached_text(now, limit=wide or now.margin is None)
    said.append(f"  {far}", style="default not bold")
    if worst := worst_text(now.margin, now.unit, now.oracle):
        said.append("  ").append_text(worst)
    if now.stack:
        said.append(f"  {now.stack}", style=QUIET)
    return said


def is_running(detail: RunDetail) -> bool:
    """Whether the run is under way."""
    return detail.row.state is RunState.RUNNING


def is_unfinished(detail: RunDetail) -> bool:
    """Whether the run is under way or waits to be."""
    return not detail.row.settled
