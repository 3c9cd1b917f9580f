"""The tracks of running runs: what their snapshots told so far, kept within bounds."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, TypeAlias

from scenario_tui.dashboard.transport import FLASH

if TYPE_CHECKING:
    from daemon.model.live_judgement import LiveJudgement
    from daemon.model.spec import Snapshot
    from daemon.model.status import LiveSnapshot, RunRow
    from grammars.model.geometry import Point2

LiveNews: TypeAlias = "LiveSnapshot | LiveJudgement"
"""What running runs tell of themselves, and no ledger keeps."""
SILENT: Final = 5.0
"""Seconds after which a run that says nothing is said to be silent."""
_KEPT_RUNS: Final = 64
"""Running runs whose tracks are kept; nobody looks at more of them at a time."""
_KEPT_MOMENTS: Final = 600
"""Moments of a running run that are remembered; of more, every other one is forgotten."""
_KEPT_POINTS: Final = 2000
"""Points of a trail; of a longer one every other point is forgotten."""
TRAIL_STEP: Final = 0.03
"""Metres between two points of a trail; a dot of the map is rarely finer."""


@dataclass(slots=True)
class Track:
    """A running run: ``snapshot`` is the last one, ``trail`` the way so far [m].

    ``times`` are the moments [s] of the points of the trail, ``heard`` and ``judgement`` when the
    last snapshot came, by the clock of the tracks, and what the run would be judged by now.
    ``heard_of`` are all snapshots without what they show, thinned: there before any judgement.
    ``flashes`` are contacts with the moment, by the same clock, until which they show.
    """

    snapshot: Snapshot
    heard: float = 0.0
    judgement: LiveJudgement | None = None
    trail: list[Point2] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    heard_of: list[Snapshot] = field(default_factory=list)
    flashes: dict[Point2, float] = field(default_factory=dict)
    step: float = TRAIL_STEP

    def note(self) -> None:
        """Take the snapshot into what was heard, and its place into the trail if it is far on."""
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
        track.flashes = {at: end for at, end in track.flashes.items() if end > now}
        if seen.contacts:
            # It calculates with arrays, whose library takes longer to load than the first screen.
            from daemon.model.live_view import from_centimetres

            track.flashes |= dict.fromkeys(from_centimetres(seen.contacts), now + FLASH)
        self._tracks[live.run] = track
        # Put in anew above, so that the first of the dictionary was heard of least recently.
        while len(self._tracks) > _KEPT_RUNS:
            self._tracks.pop(next(iter(self._tracks)))

    def forget_ended(self, rows: Iterable[RunRow]) -> None:
        """Forget those of some runs that do not run: their next attempts begin tracks anew."""
        for row in rows:
            if row.state != "running":
                self._tracks.pop(row.id, None)

    def silence(self, track: Track) -> float:
        """Return for how long nothing was heard of a run [s]."""
        return self._clock() - track.heard

    def get(self, run: str) -> Track | None:
        """Return the track of a run, if anything was heard of it."""
        return self._tracks.get(run)
