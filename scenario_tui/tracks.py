"""Where running robots were: the last snapshot and the trail of every run in telemetry."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Final

from daemon.protocol import Live
from daemon.spec import Snapshot
from grammars.values import Point2

_KEPT_RUNS: Final = 64
_KEPT_POINTS: Final = 20_000
_STEP: Final = 0.03
"""Metres between two points of a trail; a dot of the map is rarely finer."""


@dataclass(slots=True)
class Track:
    """A running run: ``snapshot`` is the last one, ``trail`` the way so far [m]."""

    snapshot: Snapshot
    trail: deque[Point2] = field(default_factory=lambda: deque(maxlen=_KEPT_POINTS))


class Tracks:
    """Tracks by run, the least recently heard of forgotten first."""

    def __init__(self) -> None:
        self._tracks: dict[str, Track] = {}

    def add(self, live: Live) -> None:
        """Take a snapshot in; an earlier time than the last means that the run began anew."""
        seen = live.snapshot
        track = self._tracks.pop(live.run, None)
        if track is None or seen.time < track.snapshot.time:
            track = Track(seen)
        track.snapshot = seen
        here = (seen.pose.x, seen.pose.y)
        if not track.trail or math.dist(track.trail[-1], here) >= _STEP:
            track.trail.append(here)
        self._tracks[live.run] = track
        while len(self._tracks) > _KEPT_RUNS:
            self._tracks.pop(next(iter(self._tracks)))

    def get(self, run: str) -> Track | None:
        """Return the track of a run, if anything was heard of it."""
        return self._tracks.get(run)
