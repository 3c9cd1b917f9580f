"""A run that goes on along time: what it would be judged by now, made ready to be drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from daemon.model.live_judgement import LiveJudgement, LiveSignal
from daemon.model.spec import RunSpec
from daemon.model.verdicts import Outcome
from grammars.model.geometry import Floats, Point2, Pose2
from scenario_tui.dashboard.live_tracks import HeardMoment
from scenario_tui.dashboard.signal_strips import (
    FailureMoment,
    ReplayTransport,
    RunTimeline,
    SignalStrip,
    with_limits,
)
from scenario_tui.text.scale import round_step

if TYPE_CHECKING:
    from grammars.oracle import ComparedLimit

_SHORTEST: Final = 10.0
"""Seconds the axis of time shows at least."""
_STEPS: Final = 6
"""Steps, at least, in which the axis grows to twice its length: it stands still in between."""


@dataclass(slots=True)
class LiveTransport(ReplayTransport):
    """The moment shown of a run that goes on: its last one while it ``follows``.

    Who goes back, or stops it, stays there; at the end it follows again.
    """

    playing: bool = False
    follows: bool = True

    def grow(self, start: float, end: float) -> None:
        """Take in that the run is known from ``start`` to ``end`` [s]."""
        # A run that begins anew, with another attempt, is another one.
        self.follows = self.follows or end < self.end
        self.start, self.end = start, end
        if self.follows:
            self.time = end

    def go(self, time: float) -> None:
        """Go to a moment, or the nearest there is."""
        # Not super(): a dataclass with slots is another class than the one written here.
        ReplayTransport.go(self, time)
        self.follows = self.time >= self.end

    def toggle(self) -> None:
        """Stay at this moment, or play on from where it stays."""
        if self.follows:
            self.follows = False
        else:
            self.playing = not self.playing


def follows(transport: ReplayTransport | None) -> bool:
    """Whether what is shown goes along with a run that goes on."""
    return isinstance(transport, LiveTransport) and transport.follows


def live_timeline(
    judgement: LiveJudgement, spec: RunSpec, limits: Sequence[ComparedLimit]
) -> RunTimeline:
    """Return the timeline of a run until now; its axis has some room for what comes."""
    starts = [signal.start for signal in judgement.signals]
    timeline = RunTimeline(
        min(starts, default=0.0),
        judgement.time,
        tuple(_strip(signal) for signal in judgement.signals),
        judgement.doors,
        judgement.reached,
        len(spec.mission.waypoints),
        tuple(moment.time for moment in decided_moments(judgement)),
        tuple(waypoint.id for waypoint in spec.mission.waypoints),
        _horizon(judgement.time),
    )
    return with_limits(timeline, limits)


def heard_timeline(heard: Sequence[HeardMoment], spec: RunSpec) -> RunTimeline | None:
    """Return what snapshots alone tell of a run along time, as long as nobody has judged it.

    ``None`` for less than two moments.
    """
    if len(heard) < 2:
        return None
    time = np.array([one.time for one in heard])
    x, y = (np.array([getattr(one.pose, axis) for one in heard]) for axis in ("x", "y"))
    way = np.hypot(np.diff(x), np.diff(y))
    speed = way / np.diff(time)
    error = np.array(
        [
            math.nan if one.estimate is None else math.dist(_place(one.pose), _place(one.estimate))
            for one in heard
        ]
    )
    strips = (
        SignalStrip("loc.error", "m", time, error),
        SignalStrip("speed", "m/s", time, np.append(speed, speed[-1])),
    )
    moments: list[float] = []
    for one in heard:
        # A worker may say anything; there are no more than these.
        reached = min(one.reached, len(spec.mission.waypoints))
        moments += [one.time] * (reached - len(moments))
    return RunTimeline(
        heard[0].time, heard[-1].time,
        tuple(strip for strip in strips if np.isfinite(strip.values).any()),
        None, tuple(moments), len(spec.mission.waypoints), (),
        tuple(waypoint.id for waypoint in spec.mission.waypoints), _horizon(heard[-1].time),
    )  # fmt: skip


def _place(pose: Pose2) -> Point2:
    return pose.x, pose.y


def _strip(signal: LiveSignal) -> SignalStrip:
    count = len(signal.low)
    time = signal.start + (signal.end - signal.start) * np.arange(count) / max(count, 1)
    return SignalStrip(
        signal.name, signal.unit, time, _numbers(signal.low), signal.limits, signal.against,
        signal.readers, most=_numbers(signal.high), until=signal.end,
    )  # fmt: skip


def _numbers(values: Sequence[float | None]) -> Floats:
    return np.array([math.nan if value is None else value for value in values], dtype=np.float64)


def decided_moments(judgement: LiveJudgement) -> list[FailureMoment]:
    """Return when the run failed by its oracles so far, by time."""
    failed = [verdict for verdict in judgement.verdicts if verdict.outcome is Outcome.FAIL]
    moments = [
        FailureMoment(v.evidence.time, v.oracle) for v in failed if v.evidence.time is not None
    ]
    return sorted(moments, key=lambda moment: (moment.time, moment.oracle))


def _horizon(now: float) -> float:
    """Return where the axis of time ends: later than now, at a round number."""
    step = round_step(max(now, _SHORTEST) / _STEPS)
    return max(_SHORTEST, step * (math.floor(now / step) + 1))
