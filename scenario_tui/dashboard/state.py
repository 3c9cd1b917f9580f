"""What the dashboard knows: its state, the query of a screen, live tracks, traces, assessments."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from daemon.batch.errors import DaemonError, Refused
from daemon.model.run_state import RunState
from grammars.model.geometry import Pose2
from scenario_tui.text.results import (
    CampaignResults,
    Conclusion,
    conclude,
    fetch_conclusion,
    gather_results,
)

if TYPE_CHECKING:
    from daemon.model.live_judgement import LiveJudgement
    from daemon.model.messages import RunQuery
    from daemon.model.search_answer import SearchRow
    from daemon.model.spec import Snapshot
    from daemon.model.status import (
        CampaignRow,
        DaemonOverview,
        LiveSnapshot,
        RunDetail,
        RunPage,
        WorkerRow,
    )
    from daemon.model.verbs import DaemonClient
    from grammars.model.geometry import Point2
    from grammars.model.scene import Scene
    from scenario_tui.dashboard.search_runs import SearchRuns

LiveNews: TypeAlias = "LiveSnapshot | LiveJudgement"
"""What running runs tell of themselves, and no ledger keeps."""
_TRAIL_POINTS: Final = 4000
"""Points of a way at most: more of them would fall into the same dots of the map."""


@dataclass(frozen=True, slots=True)
class TraceSummary:
    """Where the robot of a finished run went, and how everything stood at its end; ``path`` is
    the trace.
    """

    run: str
    path: Path
    pose: Pose2
    joints: tuple[float, ...]
    reached: int
    trail: tuple[Point2, ...]


@dataclass(frozen=True, slots=True)
class UnavailableTrace:
    """A run that is over but has nothing to look at, and why, for people."""

    run: str
    why: str


def local_trace(detail: RunDetail, source: DaemonClient | None = None) -> Path | UnavailableTrace:
    """Return where the trace of a run lies on this machine, or why there is none.

    One that lies elsewhere is brought here if ``source`` is given; that may take a while.
    """
    run, path = detail.row.id, Path(detail.row.trace)
    if detail.row.state in (RunState.QUEUED, RunState.RUNNING):
        return UnavailableTrace(
            run, f"This run is {detail.row.state}: its trace is there when it is over."
        )
    if detail.result is None:
        what = f"This run was {detail.row.state}: there is nothing to look at."
        return UnavailableTrace(run, f"{what}\n\nr queues it again.")
    if not detail.row.trace:
        return UnavailableTrace(run, "No trace of this run was kept.")
    if path.is_file():
        return path
    if source is not None:
        return _fetch_trace(detail, source)
    what = "Look at it where its worker is, or run it again."
    return UnavailableTrace(run, f"Its trace is not on this machine (any more): {path}\n\n{what}")


def _fetch_trace(detail: RunDetail, source: DaemonClient) -> Path | UnavailableTrace:
    from daemon.batch.stores import local_copy, trace_reference

    try:
        return local_copy(trace_reference(detail), source)
    except DaemonError as error:
        return UnavailableTrace(detail.row.id, f"Its trace cannot be brought here: {error}")


def can_fetch_trace(detail: RunDetail, source: DaemonClient) -> bool:
    """Whether the trace of a run lies elsewhere, and can be had from there as far as is known."""
    from daemon.batch.stores import is_url

    row = detail.row
    if detail.result is None or not row.trace or Path(row.trace).is_file():
        return False
    if is_url(row.trace):
        return True
    # Only the daemon knows whether it can: asked for the first piece, it says so.
    try:
        source.piece(row.id, 0)
    except Refused:
        return False
    return True


def read_trace_summary(
    detail: RunDetail, source: DaemonClient | None = None
) -> TraceSummary | UnavailableTrace:
    """Return the recorded way of a run that is over, or why its trace cannot be read here.

    One that lies elsewhere is brought here if ``source`` is given.
    """
    from daemon.trace import TraceError, read_trace

    run, path = detail.row.id, local_trace(detail, source)
    if isinstance(path, UnavailableTrace):
        return path
    try:
        trace = read_trace(path)
    except TraceError as error:
        said = "; ".join(d.message for d in error.diagnostics)
        what = "Run it again, or copy the file anew from where its worker is."
        return UnavailableTrace(run, f"Its trace cannot be used: {said}: {path}\n\n{what}")
    way, joints = trace.ground_truth, trace.joints
    if not len(way.time):
        return UnavailableTrace(run, f"Its trace says nothing of where the robot was: {path}")
    every = max(1, len(way.time) // _TRAIL_POINTS)
    trail = tuple(zip(way.x[::every].tolist(), way.y[::every].tolist(), strict=True))
    return TraceSummary(
        run=run,
        path=path,
        pose=Pose2(float(way.x[-1]), float(way.y[-1]), float(way.yaw[-1])),
        joints=tuple(joints.position[-1].tolist()) if len(joints.time) else (),
        reached=trace.progress[-1].reached if trace.progress else 0,
        trail=trail,
    )


_KEPT_RUNS: Final = 64
"""Running runs whose tracks are kept; nobody looks at more of them at a time."""
_KEPT_MOMENTS: Final = 600
"""Moments of a running run that are remembered; of more, every other one is forgotten."""
_KEPT_POINTS: Final = 2000
"""Points of a trail; of a longer one every other point is forgotten."""
_TRAIL_STEP: Final = 0.03
"""Metres between two points of a trail; a dot of the map is rarely finer."""
_CONTACT_FLASH: Final = 0.5
"""Seconds of the wall a contact stays to be seen."""
ASSESS_SHOWN_EVERY: Final = 1.0
"""Seconds between two looks at the campaign that is shown."""
ASSESS_OTHERS_EVERY: Final = 5.0
"""Seconds between two looks at another one."""
RUNNING_SHOWN: Final = 200
"""Running runs asked for at a time; there are rarely more slots."""
CAMPAIGNS_SHOWN: Final = 500
"""Campaigns in the table, the newest: a table of thousands is slow to lay out."""
CAMPAIGNS_ASSESSED: Final = 100
"""How many campaigns are judged, the newest first."""
_SHARE: Final = 0.25
"""The share of its time the assessor works at most, however large the campaigns are: it is a thread
beside the one that draws, and only one of them at a time runs Python.
"""
_State: TypeAlias = "tuple[CampaignRow, int]"


@dataclass(frozen=True, slots=True)
class RunsView:
    """How the runs of a place were looked at last: filter, order, page and the run in front."""

    wanted: RunQuery
    only: int = 0
    key: str = ""


@dataclass(frozen=True, slots=True)
class Query:
    """What the screen in front shows beyond the overview: nothing else is asked for.

    ``judged``: also what the run would be judged by now. ``running``: the runs under way of a
    campaign, of all when it is empty.
    """

    runs: RunQuery | None = None
    run: str = ""
    judged: bool = False
    running: str | None = None
    workers: bool = False
    results: str = ""
    search: str = ""


@dataclass(frozen=True, slots=True)
class DashboardState:
    """The last that is known; ``at`` is when it was true [s since the epoch], 0 for never.

    ``problem`` says why we are not connected; somebody is there but ``refused`` when that is what
    they said, as daemons of other versions do.
    """

    connected: bool = False
    problem: str = ""
    refused: bool = False
    at: float = 0.0
    overview: DaemonOverview | None = None
    campaigns: tuple[CampaignRow, ...] = ()
    workers: tuple[WorkerRow, ...] = ()
    wanted: RunQuery | None = None
    page: RunPage | None = None
    running: RunPage | None = None
    detail: RunDetail | None = None
    scene: Scene | None = None
    recording: TraceSummary | UnavailableTrace | None = None
    conclusions: Mapping[str, Conclusion] = field(default_factory=dict)
    results: CampaignResults | None = None
    searches: Mapping[str, SearchRow] = field(default_factory=dict)
    search: SearchRuns | None = None

    def campaign(self, campaign: str) -> CampaignRow | None:
        """Return the campaign with this id."""
        return next((row for row in self.campaigns if row.id == campaign), None)

    def page_for(self, query: RunQuery) -> RunPage | None:
        """Return the page of runs asked for; the last one asked for may be another."""
        return self.page if self.wanted == query else None

    def detail_of(self, run: str) -> RunDetail | None:
        """Return the details of a run, if that is the one that was asked for last."""
        return self.detail if self.detail is not None and self.detail.row.id == run else None

    def search_of(self, campaign: str) -> SearchRuns | None:
        """Return a search with its runs, if that is the one that was asked for last."""
        return self.search if self.search and self.search.campaign == campaign else None

    def recording_of(self, run: str) -> TraceSummary | UnavailableTrace | None:
        """Return what is known of the trace of a run."""
        return self.recording if self.recording is not None and self.recording.run == run else None


@dataclass(frozen=True, slots=True)
class Notice:
    """The outcome of an action, for people."""

    text: str
    severity: Literal["information", "error"] = "information"


@dataclass(frozen=True, slots=True)
class HeardMoment:
    """A moment of a running run, as its snapshot told it."""

    time: float
    pose: Pose2
    estimate: Pose2 | None
    reached: int
    joints: tuple[float, ...] = ()


@dataclass(slots=True)
class Track:
    """A running run: ``snapshot`` is the last one, ``trail`` the way so far [m].

    ``times`` are the moments [s] of the points of the trail, ``heard`` and ``judgement`` when the
    last snapshot came, by the clock of the tracks, and what the run would be judged by now.
    ``heard_of`` is what all snapshots said of moments, thinned: there before any judgement.
    ``flashes`` are contacts with the moment, by the same clock, until which they show.
    """

    snapshot: Snapshot
    heard: float = 0.0
    judgement: LiveJudgement | None = None
    trail: list[Point2] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    heard_of: list[HeardMoment] = field(default_factory=list)
    flashes: dict[Point2, float] = field(default_factory=dict)
    step: float = _TRAIL_STEP

    def note(self) -> None:
        """Take what the snapshot says of its moment into what was heard."""
        now = self.snapshot
        if now.waiting or (self.heard_of and now.time <= self.heard_of[-1].time):
            return
        self.heard_of.append(HeardMoment(now.time, now.pose, now.estimate, now.reached, now.joints))
        if len(self.heard_of) > _KEPT_MOMENTS:
            del self.heard_of[1:-1:2]

    def add(self, here: Point2, time: float) -> None:
        """Take a place into the trail, once it is some way on."""
        if self.trail and math.dist(self.trail[-1], here) < self.step:
            return
        self.trail.append(here)
        self.times.append(time)
        if len(self.trail) > _KEPT_POINTS:
            # Coarser, not shorter: the way from the start stays to be seen.
            del self.trail[1::2], self.times[1::2]
            self.step *= 2.0


class Tracks:
    """Tracks by run, the least recently heard of forgotten first."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._tracks: dict[str, Track] = {}
        self._clock = clock

    def add(self, live: LiveNews) -> None:
        """Take a snapshot in; an earlier time than the last means that the run began anew."""
        from daemon.model.live_judgement import LiveJudgement

        if isinstance(live, LiveJudgement):
            if (judged := self._tracks.get(live.run)) is not None:
                judged.judgement = live
            return
        seen, now = live.snapshot, self._clock()
        track = self._tracks.pop(live.run, None)
        if track is None or seen.time < track.snapshot.time:
            track = Track(seen)
        track.snapshot, track.heard = seen, now
        track.note()
        track.add((seen.pose.x, seen.pose.y), seen.time)
        track.flashes = {at: end for at, end in track.flashes.items() if end > now}
        if seen.contacts:
            # It calculates with arrays, whose library takes longer to load than the first screen.
            from daemon.model.live_view import from_centimetres

            track.flashes |= dict.fromkeys(from_centimetres(seen.contacts), now + _CONTACT_FLASH)
        self._tracks[live.run] = track
        # Put in anew above, so that the first of the dictionary was heard of least recently.
        while len(self._tracks) > _KEPT_RUNS:
            self._tracks.pop(next(iter(self._tracks)))

    def silence(self, track: Track) -> float:
        """Return for how long nothing was heard of a run [s]."""
        return self._clock() - track.heard

    def get(self, run: str) -> Track | None:
        """Return the track of a run, if anything was heard of it."""
        return self._tracks.get(run)


class CampaignAssessor:
    """Remembers how campaigns stand; one step judges one campaign at most.

    ``conclusions`` and ``results`` (of the campaign that is wanted) are replaced and never changed,
    so that other threads may read them.
    """

    def __init__(
        self, *, every: float = ASSESS_SHOWN_EVERY, elsewhere: float = ASSESS_OTHERS_EVERY,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self.conclusions: Mapping[str, Conclusion] = {}
        self.results: CampaignResults | None = None
        self._every = every
        self._elsewhere = elsewhere
        self._clock = clock
        self._seen: dict[str, _State] = {}
        self._at: dict[str, float] = {}
        self._touches: dict[str, int] = {}
        self._rest_until = 0.0

    # A run that is judged again may change its verdict while all counts stay what they were.
    def touch(self, campaign: str) -> None:
        """Note that something of a campaign changed, even if its counts stay the same."""
        self._touches[campaign] = self._touches.get(campaign, 0) + 1

    def step(self, daemon: DaemonClient, campaigns: Sequence[CampaignRow], wanted: str) -> bool:
        """Judge the campaign that needs it most; return whether there was one."""
        began = self._clock()
        row = self._next(campaigns, wanted, began) if began >= self._rest_until else None
        if row is None:
            return False
        state = self._state(row)
        if row.id == wanted:
            results = gather_results(daemon, row)
            conclusion = conclude(results.assessment, finished=row.finished)
            self.results = results
        else:
            conclusion = fetch_conclusion(daemon, row)
        self.conclusions = {**self.conclusions, row.id: conclusion}
        ended = self._clock()
        self._seen[row.id], self._at[row.id] = state, ended
        if self._every:
            self._rest_until = ended + (ended - began) * (1.0 / _SHARE - 1.0)
        return True

    def _next(
        self, campaigns: Sequence[CampaignRow], wanted: str, now: float
    ) -> CampaignRow | None:
        first = (row for row in campaigns if row.id == wanted)
        due = (
            row for row in (*first, *campaigns[:CAMPAIGNS_ASSESSED]) if self._due(row, wanted, now)
        )
        return next(due, None)

    def _due(self, row: CampaignRow, wanted: str, now: float) -> bool:
        before, shown = self._seen.get(row.id), row.id == wanted
        if before is None or (shown and not self._holds(wanted)):
            return True
        wait = self._every if shown else self._elsewhere
        return self._state(row) != before and now >= self._at[row.id] + wait

    def _holds(self, campaign: str) -> bool:
        return self.results is not None and self.results.row.id == campaign

    def _state(self, row: CampaignRow) -> _State:
        return row, self._touches.get(row.id, 0)
