"""Watched runs: the tracks of all running ones within bounds, and the run in front."""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, TypeAlias

from daemon.batch.errors import Refused
from daemon.model.verdicts import RunState
from scenario_tui.dashboard.transport import FLASH

if TYPE_CHECKING:
    from daemon.model.live_judgement import LiveJudgement
    from daemon.model.spec import Snapshot
    from daemon.model.status import LiveSnapshot, RunDetail, RunRow
    from daemon.model.verbs import Closeable, DaemonClient
    from grammars.model.geometry import Point2
    from grammars.model.scene import Scene

LiveNews: TypeAlias = "LiveSnapshot | LiveJudgement"
"""Telemetry of running runs, which no ledger keeps."""
SILENT: Final = 5.0
"""Seconds without a snapshot after which a run counts as silent."""
_KEPT_RUNS: Final = 64
"""Most running runs with a track."""
_KEPT_MOMENTS: Final = 600
"""Most snapshots of a running run; beyond that, every other one is dropped."""
_KEPT_POINTS: Final = 2000
"""Most points of a trail; beyond that, every other one is dropped."""
TRAIL_STEP: Final = 0.03
"""Metres between two points of a trail; a dot of the map is rarely finer."""
_SCENES_KEPT: Final = 8
"""Most scenes to keep: the runs of a campaign share a few."""


@dataclass(slots=True)
class Track:
    """A running run: ``snapshot`` is the last one, ``trail`` the way so far [m].

    ``times`` are the moments [s] of the points of the trail. ``received_at`` is the time of the
    last snapshot by the clock of the tracks, ``judgement`` the verdicts if the run ended now.
    ``heard_of`` are the thinned snapshots without laser, plan and costmap. ``flashes`` are contacts
    with the end of their display, by the same clock.
    """

    snapshot: Snapshot
    received_at: float = 0.0
    judgement: LiveJudgement | None = None
    trail: list[Point2] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    heard_of: list[Snapshot] = field(default_factory=list)
    flashes: dict[Point2, float] = field(default_factory=dict)
    step: float = TRAIL_STEP

    def note(self) -> None:
        """Remember the snapshot, and add its place to the trail if the robot has moved on."""
        now = self.snapshot
        if not now.waiting and (not self.heard_of or now.time > self.heard_of[-1].time):
            self.heard_of.append(replace(now, returns=(), plan=(), contacts=(), costmap=()))
            if len(self.heard_of) > _KEPT_MOMENTS:
                del self.heard_of[1:-1:2]
        here = (now.pose.x, now.pose.y)
        if not self.trail or math.dist(self.trail[-1], here) >= self.step:
            self.trail.append(here)
            self.times.append(now.time)
            if len(self.trail) > _KEPT_POINTS:
                # Coarser, not shorter: the way from the start stays visible.
                del self.trail[1::2], self.times[1::2]
                self.step *= 2.0

    def at(self, time: float) -> Snapshot:
        """Return the snapshot of a moment [s], before the first one that."""
        index = bisect_right(self.heard_of, time, key=lambda one: one.time) - 1
        return self.heard_of[max(index, 0)] if self.heard_of else self.snapshot


class Tracks:
    """Tracks by run; the ones without news for longest are dropped first."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._tracks: dict[str, Track] = {}
        self._clock = clock

    def add(self, live: LiveNews) -> None:
        """Take in a snapshot; an earlier time than the last means that the run began anew."""
        from daemon.model.live_judgement import LiveJudgement

        if isinstance(live, LiveJudgement):
            if (judged := self._tracks.get(live.run)) is not None:
                judged.judgement = live
            return
        snapshot, now = live.snapshot, self._clock()
        track = self._tracks.pop(live.run, None)
        if track is None or snapshot.time < track.snapshot.time:
            track = Track(snapshot)
        track.snapshot, track.received_at = snapshot, now
        track.note()
        track.flashes = {at: end for at, end in track.flashes.items() if end > now}
        if snapshot.contacts:
            # Imported here, because its library loads longer than the first screen.
            from daemon.model.live_view import from_centimetres

            track.flashes |= dict.fromkeys(from_centimetres(snapshot.contacts), now + FLASH)
        self._tracks[live.run] = track
        # Inserted anew above, so that the first of the dictionary has the oldest news.
        while len(self._tracks) > _KEPT_RUNS:
            self._tracks.pop(next(iter(self._tracks)))

    def forget_ended(self, rows: Iterable[RunRow]) -> None:
        """Forget tracks of runs that do not run: their next attempts begin new tracks."""
        for row in rows:
            if row.state != "running":
                self._tracks.pop(row.id, None)

    def silence(self, track: Track) -> float:
        """Return the time [s] since the last snapshot of a run."""
        return self._clock() - track.received_at

    def get(self, run: str) -> Track | None:
        """Return the track of a run, if it has any snapshot."""
        return self._tracks.get(run)


@dataclass(frozen=True, slots=True)
class RunNews:
    """A run with its scene, if available."""

    detail: RunDetail
    scene: Scene | None


class RunWatch:
    """Follows one run at a time; telemetry goes to ``lives``, problems to ``on_problem``."""

    def __init__(self, lives: deque[LiveNews], on_problem: Callable[[str], object]) -> None:
        self._lives = lives
        self._on_problem = on_problem
        self._scenes: dict[str, Scene] = {}
        self._subscription: Closeable | None = None
        self._looked_at = self._followed = ("", False)
        self._detailed = ""

    @contextmanager
    def looking(self, daemon: DaemonClient) -> Iterator[None]:
        """Follow the run of :meth:`look` in this block, if any, and no other afterwards."""
        self._looked_at = ("", False)
        yield
        if self._looked_at != self._followed:
            run, judged = self._looked_at
            self.close()
            if run:
                hear = self._lives.append if judged else None
                self._subscription = daemon.watch(run, self._hear_detail, hear)
                self._followed = (run, judged)

    def look(self, daemon: DaemonClient, run: str, *, judged: bool = False) -> RunNews | None:
        """Return a run with its scene, ``None`` if it does not exist.

        While it runs, its details arrive as telemetry; with ``judged`` also its judgement so far.
        """
        try:
            detail = daemon.run(run)
        except Refused as error:
            self._on_problem(str(error))
            return None
        if detail.row.state is RunState.RUNNING:
            self._looked_at = (run, judged)
        return RunNews(detail, self._scene(daemon, detail.spec.scene))

    def close(self) -> None:
        """Follow no run."""
        if self._subscription is not None:
            self._subscription.close()
        self._subscription, self._followed, self._detailed = None, ("", False), ""

    def hear(self, live: LiveSnapshot) -> None:
        """Take in a snapshot from the stream for all clients."""
        # The run that is followed has its own, finer stream. Two streams of one run would make its
        # clock jump back, which means a new attempt.
        if live.run != self._detailed:
            self._lives.append(live)

    def _hear_detail(self, live: LiveSnapshot) -> None:
        self._detailed = live.run
        self._lives.append(live)

    def _scene(self, daemon: DaemonClient, digest: str) -> Scene | None:
        if digest not in self._scenes:
            try:
                scene = daemon.scene(digest)
            except (Refused, ValueError):
                return None  # without the scene there is no map, but everything else
            while len(self._scenes) >= _SCENES_KEPT:
                self._scenes.pop(next(iter(self._scenes)))
            self._scenes[digest] = scene
        return self._scenes[digest]
