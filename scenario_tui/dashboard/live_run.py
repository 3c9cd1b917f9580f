"""A running run, at its last moment or an earlier one, as reported by its worker."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from rich.text import Text

from daemon.model.live_view import from_centimetres
from daemon.model.spec import RunSpec
from daemon.model.verdicts import Outcome, RunState
from grammars.model.scene import Scene
from grammars.text.words import duration_text
from scenario_tui.dashboard.run_log import LogExcerpt
from scenario_tui.dashboard.run_timeline import (
    RunTimeline,
    clearance_along,
    failure_moments,
    heard_timeline,
    live_timeline,
)
from scenario_tui.dashboard.run_watch import SILENT, Track
from scenario_tui.dashboard.transport import FLASH, FailureMoment
from scenario_tui.dashboard.widgets.map_frame import View
from scenario_tui.text.run_text import reached_text, worst_text
from scenario_tui.text.styles import QUIET, UNSURE

if TYPE_CHECKING:
    from daemon.model.live_judgement import LiveJudgement
    from daemon.model.spec import Snapshot
    from daemon.model.verdicts import Verdict
    from scenario_tui.dashboard.run_watch import RunNews
    from templates.plan_shapes import MeasuredMark

_PATIENCE: Final = 30.0
"""Seconds until the screen says that no signals come."""


class LiveRun:
    """A run without a recording, with the same interface as :class:`Playback`.

    ``track`` has its snapshots, ``timeline`` its signals so far. Both stay after the end of the run
    until its trace is read.
    """

    def __init__(self) -> None:
        self.track: Track | None = None
        self.timeline: RunTimeline | None = None
        self._judgement: LiveJudgement | None = None
        self._mark: tuple[Verdict, MeasuredMark | None] | None = None
        self._news: RunNews | None = None

    @property
    def end(self) -> float:
        """The last moment known [s]."""
        return self.timeline.end if self.timeline is not None else 0.0

    @property
    def moments(self) -> Sequence[FailureMoment]:
        """The moments at which its oracles failed so far."""
        return failure_moments(self._judgement.verdicts) if self._judgement is not None else ()

    @property
    def judgement(self) -> LiveJudgement | None:
        """The judgement of the run if it ended now."""
        return self.track.judgement if self.track is not None else None

    @property
    def snapshot(self) -> Snapshot | None:
        """Its last snapshot."""
        return self.track.snapshot if self.track is not None else None

    @property
    def log(self) -> LogExcerpt | None:
        """The end of its log, ``None`` before the first judgement."""
        judgement = self.judgement
        if judgement is None:
            return None
        lines = ((line.time, line.source, line.text) for line in judgement.log)
        return LogExcerpt(tuple(lines), judgement.log_before)

    def hear(self, news: RunNews, track: Track | None) -> None:
        """Take in the news of the run; a run that is over keeps its last track."""
        unfinished = not news.detail.row.settled
        self._news = news
        if track is not None or unfinished:
            self.track = track
        judgement = self.judgement
        if judgement is not None and judgement.signals:
            if judgement is not self._judgement:
                self._judgement = judgement
                self.timeline = live_timeline(judgement, news.detail.spec)
        elif unfinished:
            # Without judgements, snapshots alone have some signals.
            self._judgement = None
            timeline = heard_timeline(track.heard_of, news.detail.spec) if track else None
            if timeline is None or self.timeline is None or timeline.end != self.timeline.end:
                self.timeline = timeline

    def view(
        self, time: float, *, window: float = FLASH, verdict: Verdict | None = None
    ) -> View | None:
        """Return the top view at ``time`` [s], at the end as it is now; ``None`` without a scene.

        Earlier returns of the laser are not kept. The view marks the object that decided
        ``verdict`` if that was in the ``window`` [s] before. Without a verdict it marks the last
        failure, at the end of the run also an older one.
        """
        news, track = self._news, self.track
        if news is None or news.scene is None:
            return None
        if track is None:
            return still_view(news.scene, news.detail.spec)
        then = track.snapshot if time >= self.end else track.at(time)
        view = tracked_view(news.scene, news.detail.spec, track, then)
        if self.timeline is not None and track.judgement is not None:
            times = track.times[: len(view.trail)]
            clearances, limit = clearance_along(self.timeline.signals, times)
            view = replace(view, clearances=clearances, limit=limit)
        return replace(view, decisive=self._decisive(time, window, verdict))

    def _decisive(self, time: float, window: float, verdict: Verdict | None) -> MeasuredMark | None:
        verdicts = self._judgement.verdicts if self._judgement is not None else ()
        moments = [
            (one.moment, one)
            for one in ((verdict,) if verdict else verdicts)
            if one.outcome is Outcome.FAIL and one.moment is not None and one.evidence.object
        ]
        first = -math.inf if time >= self.end else time - window
        recent = [pair for pair in moments if first < pair[0] <= time + 1e-9]
        if not recent or self._news is None or self.track is None:
            return None
        last = max(recent, key=lambda pair: pair[0])[1]
        if self._mark is None or self._mark[0] != last:
            self._mark = (last, _object_mark(self._news, self.track, last))
        return self._mark[1]

    def reached(self, time: float) -> int:
        """Return the number of waypoints done at ``time``."""
        return bisect_right(self.timeline.reached, time) if self.timeline is not None else 0

    def why_untold(self, waited: float) -> str:
        """Return why there are no signals (yet) after ``waited`` seconds."""
        state = self._news.detail.row.state if self._news is not None else RunState.QUEUED
        if state is RunState.QUEUED:
            return "This run is queued. Its signals are drawn while it runs."
        if state is not RunState.RUNNING:
            return "Its trace is being read."
        if self.track is None:
            return "Its worker prepares this run and has not reported yet."
        if waiting := self.track.snapshot.waiting:
            return f"{waiting}\n\nSignals begin with simulated time, once it is up."
        if waited > _PATIENCE:
            return "Its worker sends no signals: they are drawn after the run."
        return "Signals and verdicts so far come in a moment."


def still_view(scene: Scene, spec: RunSpec) -> View:
    """Return the top view of a run before its first snapshot."""
    return View(scene, spec.robot, spec.mission, tuple(scene.initial_joints.values()))


def tracked_view(
    scene: Scene, spec: RunSpec, track: Track, snapshot: Snapshot | None = None
) -> View:
    """Return the top view of a run by a snapshot of its track, by default the last one."""
    now, still = snapshot or track.snapshot, still_view(scene, spec)
    return replace(
        still,
        # For a moment the scene may be of another attempt than the snapshot.
        joints=now.joints if len(now.joints) == len(still.joints) else still.joints,
        robot_pose=now.pose,
        estimate=now.estimate,
        reached=now.reached,
        trail=tuple(track.trail[: bisect_right(track.times, now.time)]),
        returns=from_centimetres(now.returns),
        plan=from_centimetres(now.plan),
        contacts=tuple(track.flashes) if now is track.snapshot else (),
        spread=now.spread,
        costmaps={"stack's": from_centimetres(now.costmap)} if now.costmap else {},
    )


def _object_mark(news: RunNews, track: Track, verdict: Verdict) -> MeasuredMark | None:
    """Return the object that decides a verdict, at its place in the snapshot of that moment."""
    # Loaded with the first failure, because the library of distances loads longer than the screen.
    from daemon.analysis.deciding import object_mark

    scene, robot = news.scene, news.detail.spec.robot
    if scene is None:
        return None
    then = track.at(verdict.moment or 0.0)
    positions = dict(zip(scene.initial_joints, then.joints, strict=False))
    mark = object_mark(scene, robot, verdict, then.pose, positions, verdict.evidence.object)
    if mark is None:
        return None
    # The pose between two snapshots is unknown: draw no line, and only the judged distance.
    words = mark.words if verdict.unit == "m" else verdict.oracle
    return replace(mark, line=(mark.line[1], mark.line[1]), words=words)


def live_text(track: Track, silence: float, *, wide: bool) -> Text:
    """Return the progress of a run, and its least margin so far.

    ``silence`` is the time [s] since its last snapshot; a line that is not ``wide`` has fewer
    parts.
    """
    now, text = track.snapshot, Text()
    if silence > SILENT:
        text.append(f"  last report {duration_text(silence)} ago", style=UNSURE)
    # On a narrow line the limit would push out the margin.
    far = reached_text(now, limit=wide or now.margin is None)
    text.append(f"  {far}", style="default not bold")
    if worst := worst_text(now.margin, now.unit, now.oracle):
        text.append("  ").append_text(worst)
    if now.stack:
        text.append(f"  {now.stack}", style=QUIET)
    return text
