"""A recorded run at any moment of it: what the top view shows, and what was decided when."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np

from daemon.trace import Trace, TraceError, read_trace
from daemon.verdict import Outcome, Verdict
from grammars.diagnostics import did_you_mean
from grammars.values import Floats, Point2, Pose2
from scenario_tui.chronicle import Chronicle
from scenario_tui.signals import chronicle_of
from scenario_tui.transport import FLASH, Moment, next_moment, previous_moment
from scenario_tui.widgets.top_view import View

RAYS: Final = 120
"""Laser returns shown of one scan at most: more of them fall into the same dots."""
_STEP: Final = 0.03
"""Metres between two points of the trail."""


class Playback:
    """A trace made ready for looking at any of its moments; ``verdicts`` are those shown."""

    def __init__(self, trace: Trace, verdicts: Sequence[Verdict], label: str = "") -> None:
        way = trace.ground_truth
        if not len(way.time):
            hint = "run it again to get a recording"
            raise TraceError(trace.path, "says nothing of where the robot was", hint)
        self.trace = trace
        self.verdicts = tuple(verdicts)
        spec = trace.spec
        self.label = label or f"{spec.scenario}/{spec.sut.name}/{spec.repeat}"
        self.start, self.end = float(way.time[0]), float(way.time[-1])
        against = (v for v in verdicts if v.outcome is Outcome.FAIL and v.evidence.time is not None)
        found = {Moment(float(v.evidence.time or 0.0), v.oracle) for v in against}
        self.moments = tuple(sorted(found, key=lambda m: (m.time, m.oracle)))

    @property
    def waypoints(self) -> int:
        """How many waypoints the mission has."""
        return len(self.trace.spec.mission.waypoints)

    def next_moment(self, time: float) -> Moment | None:
        """Return the first moment after ``time`` that an oracle was decided against."""
        return next_moment(self.moments, time)

    def previous_moment(self, time: float) -> Moment | None:
        """Return the last moment before ``time`` that an oracle was decided against."""
        return previous_moment(self.moments, time)

    def time_of(self, text: str) -> float:
        """Return the moment meant [s]: a number of seconds, or when an oracle was decided.

        Raises ``ValueError`` for what is neither, and for oracles without a decisive moment.
        """
        try:
            return self.within(float(text))
        except ValueError:
            pass
        names = {verdict.oracle: verdict for verdict in self.verdicts}
        if text not in names:
            hint = did_you_mean(text, names)
            raise ValueError(f'"{text}" is no number of seconds and no oracle of it: {hint}')
        decided = names[text].evidence.time
        if decided is None:
            raise ValueError(f'no moment decided oracle "{text}": {names[text].outcome}')
        return self.within(decided)

    def within(self, time: float) -> float:
        """Return ``time`` or the end of the recording that is nearer; raises for NaN."""
        if np.isnan(time):
            raise ValueError("nan is no moment")
        return min(max(time, self.start), self.end)

    def reached(self, time: float) -> int:
        """Return how many waypoints were done at ``time``."""
        done = [p.reached for p in self.trace.progress if p.time <= time + 1e-9]
        return done[-1] if done else 0

    def pose(self, time: float) -> Pose2:
        """Return where the robot was at ``time``: the last sample until then."""
        return _pose_at(self.trace.ground_truth, _last(self.trace.ground_truth.time, time, 0))

    def estimate(self, time: float) -> Pose2 | None:
        """Return where the system under test believed to be, once it had said so."""
        index = _last(self.trace.estimate.time, time)
        return None if index < 0 else _pose_at(self.trace.estimate, index)

    def spread(self, time: float) -> tuple[float, float, float] | None:
        """Return how sure it was of its position: by its particles, else by its estimate."""
        track = self.trace.cloud if len(self.trace.cloud.time) else self.trace.estimate
        index = _last(track.time, time)
        if index < 0:
            return None
        found = track.covariance[index]
        return float(found[0, 0]), float(found[0, 1]), float(found[1, 1])

    def joints(self, time: float) -> tuple[float, ...]:
        """Return all joint positions at ``time``, in the order of the scene."""
        resting = tuple(value for obj in self.trace.scene.objects for value in obj.initial)
        track = self.trace.joints
        if not len(track.time) or time < track.time[0]:
            return resting
        columns = track.position.T
        return tuple(float(np.interp(time, track.time, column)) for column in columns)

    def contacts(self, time: float, window: float = FLASH) -> tuple[Point2, ...]:
        """Return where bodies touched in the ``window`` [s] before ``time``."""
        records = self.trace.contacts
        return tuple(dict.fromkeys(c.point for c in records if time - window < c.time <= time))

    def view(self, time: float, *, window: float = FLASH) -> View:
        """Return the top view at ``time`` [s], with the contacts of the ``window`` before it."""
        trace = self.trace
        count = int(np.searchsorted(self._trail_times, time + 1e-9, side="right"))
        here = self.pose(time)
        return View(
            trace.scene,
            trace.spec.robot,
            trace.spec.mission,
            self.joints(time),
            here,
            self.estimate(time),
            self.reached(time),
            (*self._trail[:count], (here.x, here.y)),
            self._returns(time),
            self._plan(time),
            self.contacts(time, window),
            self.spread(time),
        )

    @cached_property
    def chronicle(self) -> Chronicle:
        """Signals, doors and mission along time."""
        return chronicle_of(self.trace, self.verdicts)

    @cached_property
    def _kept(self) -> list[int]:
        """Samples of the trail: each some centimetres on from the one before."""
        way = self.trace.ground_truth
        steps = np.hypot(np.diff(way.x, prepend=way.x[:1]), np.diff(way.y, prepend=way.y[:1]))
        passed = np.floor(np.cumsum(steps) / _STEP)
        return np.flatnonzero(np.diff(passed, prepend=-1.0) > 0).tolist()

    @cached_property
    def _trail_times(self) -> Floats:
        return self.trace.ground_truth.time[self._kept]

    @cached_property
    def _trail(self) -> tuple[Point2, ...]:
        way = self.trace.ground_truth
        return tuple(zip(way.x[self._kept].tolist(), way.y[self._kept].tolist(), strict=True))

    def _returns(self, time: float) -> tuple[Point2, ...]:
        """Return where the laser saw something, from where the robot was at that scan."""
        scans = self.trace.scans
        index = _last(scans.time, time) if scans is not None else -1
        if scans is None or index < 0:
            return ()
        laser = self.trace.spec.robot.laser
        step = max(1, -(-laser.rays // RAYS))
        ranges = scans.ranges[index, ::step].astype(np.float64)
        angles = np.linspace(laser.angle_min, laser.angle_max, laser.rays)[::step]
        seen = np.isfinite(ranges) & (ranges > 0.0)
        eye = self.pose(float(scans.time[index])) @ laser.mount
        x = eye.x + ranges[seen] * np.cos(eye.yaw + angles[seen])
        y = eye.y + ranges[seen] * np.sin(eye.yaw + angles[seen])
        return tuple(zip(x.tolist(), y.tolist(), strict=True))

    def _plan(self, time: float) -> tuple[Point2, ...]:
        plans = self.trace.plans
        now = [plan for plan in plans if plan.time <= time + 1e-9]
        return tuple((x, y) for x, y in now[-1].points.tolist()) if now else ()


def _last(stamps: Floats, time: float, least: int = -1) -> int:
    """Return the index of the last stamp until ``time``, at least ``least``."""
    return max(int(np.searchsorted(stamps, time + 1e-9, side="right")) - 1, least)


def _pose_at(track: object, index: int) -> Pose2:
    x, y, yaw = (float(getattr(track, name)[index]) for name in ("x", "y", "yaw"))
    return Pose2(x, y, yaw)


def open_playback(path: Path, verdicts: Sequence[Verdict] | None = None) -> Playback:
    """Read a trace for playing; judged by its own oracles unless ``verdicts`` are known.

    Raises :class:`daemon.trace.TraceError` for what is no usable trace.
    """
    from daemon.oracles import judge

    trace = read_trace(path, scans=True, plans=True)
    if verdicts is None:
        verdicts = judge(trace, trace.spec.oracles)
    return Playback(trace, verdicts)
