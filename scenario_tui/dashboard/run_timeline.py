"""A run along time, recorded or running: signals, doors, mission; two runs on one clock."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from daemon.judging.signals import RunSignal, received_signal
from daemon.model.live_judgement import DoorMotion, LiveJudgement
from daemon.model.spec import RunSpec, Snapshot
from daemon.model.verdicts import Outcome, Verdict
from grammars.model.geometry import Floats, Pose2
from scenario_tui.dashboard.transport import FailureMoment
from scenario_tui.text.scale import round_step

if TYPE_CHECKING:
    from daemon.trace import Trace

Alignment = Literal["time", "mission"]
_CLEARANCE: Final = re.compile(r"clearance(\(\d[^)]*\))?$")
"""The clearance of the robot to any object, not to a named one."""
_SHORTEST: Final = 10.0
"""Least length of the axis of time [s]."""
_STEPS: Final = 6
"""Least number of steps in which the axis grows to twice its length; it rests in between."""
_NOWHERE: Final = Pose2(math.nan, math.nan)
_EVER: Final = 1e9
"""Longer than any run [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class RunTimeline:
    """Signals and events of a run from ``start`` to ``end`` [s].

    ``doors`` is ``None`` if unknown. ``reached`` holds the moments [s] at which the first of the
    ``waypoints`` were done, ``decided`` those at which an oracle failed. The axis of a running run
    ends at ``horizon`` [s], later than the run.
    """

    start: float
    end: float
    signals: tuple[RunSignal, ...]
    doors: tuple[DoorMotion, ...] | None
    reached: tuple[float, ...]
    waypoints: tuple[str, ...]
    decided: tuple[float, ...]
    horizon: float | None = None


def recorded_timeline(trace: Trace, decided: Sequence[float]) -> RunTimeline:
    """Return the usual signals of a trace and those of its oracles, its doors and mission.

    A trace that cannot be trusted has no signals.
    """
    # The judging code takes 70 MB, see children.
    from daemon.judging.live import door_motions, reached_moments, sample_run_signals
    from daemon.judging.oracles import SignalSampler, trace_problems

    way = trace.ground_truth.time
    return RunTimeline(
        float(way[0]),
        float(way[-1]),
        () if trace_problems(trace) else sample_run_signals(SignalSampler(trace)),
        door_motions(trace.joints),
        reached_moments(trace),
        waypoint_names(trace.spec),
        tuple(decided),
    )


def live_timeline(judgement: LiveJudgement, spec: RunSpec) -> RunTimeline:
    """Return the timeline of a run until now; its axis has room for the future."""
    return RunTimeline(
        min((signal.start for signal in judgement.signals), default=0.0),
        judgement.time,
        tuple(received_signal(signal) for signal in judgement.signals),
        judgement.doors,
        judgement.reached,
        waypoint_names(spec),
        tuple(moment.time for moment in failure_moments(judgement.verdicts)),
        _horizon(judgement.time),
    )


def heard_timeline(moments: Sequence[Snapshot], spec: RunSpec) -> RunTimeline | None:
    """Return the timeline of snapshots alone, for a run without a judgement yet.

    ``None`` for less than two snapshots.
    """
    if len(moments) < 2:
        return None
    poses = ((one.time, one.pose, one.estimate or _NOWHERE) for one in moments)
    time, x, y, *off = np.array([(t, p.x, p.y, e.x - p.x, e.y - p.y) for t, p, e in poses]).T
    speed = np.hypot(np.diff(x), np.diff(y)) / np.diff(time)
    signals = [
        RunSignal(name, unit, time, values, values)
        for name, unit, values in (
            ("loc.error", "m", np.hypot(*off)),
            ("speed", "m/s", np.append(speed, speed[-1])),
        )
        if np.isfinite(values).any()
    ]
    names = waypoint_names(spec)
    reached: list[float] = []
    for one in moments:
        # A worker may report any number; there are no more waypoints than these.
        reached += [one.time] * (min(one.reached, len(names)) - len(reached))
    return RunTimeline(
        moments[0].time, moments[-1].time, tuple(signals), None, tuple(reached), names, (),
        _horizon(moments[-1].time),
    )  # fmt: skip


def _horizon(now: float) -> float:
    """Return the end of the axis of time: a round number later than now."""
    step = round_step(max(now, _SHORTEST) / _STEPS)
    return max(_SHORTEST, step * (math.floor(now / step) + 1))


def waypoint_names(spec: RunSpec) -> tuple[str, ...]:
    """Return the names of the waypoints of a mission, in their order."""
    return tuple(waypoint.id for waypoint in spec.mission.waypoints)


def failure_moments(verdicts: Iterable[Verdict]) -> tuple[FailureMoment, ...]:
    """Return the moments at which the oracles of a run failed, by time."""
    failures = ((v.evidence.time, v.oracle) for v in verdicts if v.outcome is Outcome.FAIL)
    moments = sorted((time, oracle) for time, oracle in failures if time is not None)
    return tuple(FailureMoment(time, oracle) for time, oracle in moments)


def clearance_along(
    signals: Iterable[RunSignal], times: Sequence[float] | Floats
) -> tuple[tuple[float, ...], float | None]:
    """Return the clearance at moments ``times`` [s], NaN where unknown, and its limit [m].

    The one that an oracle reads, with the buffer around the robot, comes before the plain one.
    """
    candidates = [s for s in signals if _CLEARANCE.match(s.name) and len(s.time)]
    if not candidates:
        return (), None
    signal = max(candidates, key=lambda one: (bool(one.readers), bool(one.limits)))
    moments = np.asarray(times)
    at = np.searchsorted(signal.time, moments + 1e-9, side="right") - 1
    # Values behind the end of a growing signal are unknown yet.
    judged = (at >= 0) & (moments <= signal.time[-1] + 1e-9)
    limits = [limit.value for limit in signal.limits if limit.side == "below"]
    return tuple(np.where(judged, signal.low[at], np.nan).tolist()), max(limits, default=None)


@dataclass(frozen=True, slots=True)
class CommonClock:
    """Corresponding moments of two runs, ``first`` and ``second`` (n,) [s], ascending.

    Between two pairs the clocks are interpolated. The first and last pair lie far outside of the
    runs, where both clocks go equally fast.
    """

    first: tuple[float, ...]
    second: tuple[float, ...]

    def to_second(self, time: float) -> float:
        """Return the moment [s] of the second run for a moment of the first."""
        return float(np.interp(time, self.first, self.second))

    def to_first(self, times: Sequence[float] | Floats) -> Floats:
        """Return the moments of the first run for moments of the second, (n,) [s]."""
        return np.interp(times, self.second, self.first)


def common_clock(first: RunTimeline, second: RunTimeline, by: Alignment) -> CommonClock:
    """Return the common clock: by simulated time, or by the waypoints that both have done."""
    pairs = [(first.start, second.start)]
    if by == "mission":
        # Only later moments in both runs: two waypoints at one instant would make the clock jump.
        for a, b in zip(first.reached, second.reached, strict=False):
            if a > pairs[-1][0] and b > pairs[-1][1]:
                pairs.append((a, b))
    begin, end = pairs[0], pairs[-1]
    ours, theirs = zip(
        (begin[0] - _EVER, begin[1] - _EVER), *pairs, (end[0] + _EVER, end[1] + _EVER), strict=True
    )
    return CommonClock(ours, theirs)


def shift_to_clock(timeline: RunTimeline, clock: CommonClock) -> RunTimeline:
    """Return the second timeline on the clock of the first."""

    def moved(times: Sequence[float]) -> tuple[float, ...]:
        return tuple(clock.to_first(times).tolist())

    start, end = moved((timeline.start, timeline.end))
    return replace(
        timeline,
        start=start,
        end=end,
        signals=tuple(
            replace(
                signal,
                time=clock.to_first(signal.time),
                against=tuple((a, b) for a, b in map(moved, signal.against)),
            )
            for signal in timeline.signals
        ),
        doors=timeline.doors
        and tuple(replace(event, time=moved((event.time,))[0]) for event in timeline.doors),
        reached=moved(timeline.reached),
        decided=moved(timeline.decided),
    )
