"""Where running robots were: the last snapshot and the trail of every run in telemetry."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from daemon.protocol import Live
from daemon.spec import Snapshot
from grammars.values import Point2

_KEPT_RUNS: Final = 64
_KEPT_POINTS: Final = 2000
"""Points of a trail; of a longer one every other point is forgotten."""
_STEP: Final = 0.03
"""Metres between two points of a trail; a dot of the map is rarely finer."""
_FLASH: Final = 0.5
"""Seconds of the wall a contact stays to be seen."""


@dataclass(slots=True)
class Track:
    """A running run: ``snapshot`` is the last one, ``trail`` the way so far [m].

    ``flashes`` are contacts with the moment, by the clock of the tracks, until which they show.
    """

    snapshot: Snapshot
    trail: list[Point2] = field(default_factory=list)
    flashes: dict[Point2, float] = field(default_factory=dict)
    step: float = _STEP

    def add(self, here: Point2) -> None:
        """Take a place into the trail, once it is some way on."""
        if self.trail and math.dist(self.trail[-1], here) < self.step:
            return
        self.trail.append(here)
        if len(self.trail) > _KEPT_POINTS:
            del self.trail[1::2]
            self.step *= 2.0


class Tracks:
    """Tracks by run, the least recently heard of forgotten first."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._tracks: dict[str, Track] = {}
        self._clock = clock

    def add(self, live: Live) -> None:
        """Take a snapshot in; an earlier time than the last means that the run began anew."""
        seen, now = live.snapshot, self._clock()
        track = self._tracks.pop(live.run, None)
        if track is None or seen.time < track.snapshot.time:
            track = Track(seen)
        track.snapshot = seen
        track.add((seen.pose.x, seen.pose.y))
        track.flashes = {at: end for at, end in track.flashes.items() if end > now}
        if seen.contacts:
            # It calculates with arrays, whose library takes longer to load than the first screen.
            from daemon.glance import metres

            track.flashes |= dict.fromkeys(metres(seen.contacts), now + _FLASH)
        self._tracks[live.run] = track
        while len(self._tracks) > _KEPT_RUNS:
            self._tracks.pop(next(iter(self._tracks)))

    def get(self, run: str) -> Track | None:
        """Return the track of a run, if anything was heard of it."""
        return self._tracks.get(run)
