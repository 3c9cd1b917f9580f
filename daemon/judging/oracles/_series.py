"""Time base of judging, recorded signals and localisation signals.

The time base has the ground-truth samples, the weight of each, and the unknown rest of the run.
Recorded signals are the true motion, commands and the estimate. Localisation signals compare an
estimate with the true pose at its stamp, interpolated between ground-truth samples, and hold the
result until the next estimate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from daemon.model.sut import TICK_RATE, BehaviorTreeLog
from daemon.trace import PoseTrack, Trace
from grammars.model.geometry import Floats

ObjectIndices = npt.NDArray[np.int32]

_ROUNDING: Final = 1e-9
"""Largest difference of equal times [s], since recorded nanoseconds are read as seconds."""

_TREE: Final = "behavior tree"
"""Word of a behaviour tree in the key ``record``."""

_TRUTH = {
    "pose.x": "x",
    "pose.y": "y",
    "pose.yaw": "yaw",
    "speed.forward": "vx",
    "speed.sideways": "vy",
}
_COMMAND = {"command.forward": "vx", "command.sideways": "vy", "command.angular": "wz"}
_ESTIMATE = {"estimate.x": "x", "estimate.y": "y", "estimate.yaw": "yaw"}
RECORDED_SIGNALS = frozenset({*_TRUTH, *_COMMAND, *_ESTIMATE, "estimate.particles", "latency"})
"""Names of the signals that :func:`recorded_signal` knows."""


@dataclass(frozen=True, slots=True, eq=False)
class SignalSeries:
    """A signal on the time base: ``values`` (n,) in SI units, 1 or 0 for true or false.

    NaN where the signal is unknown. ``objects`` (n,) index into ``names``, -1 for none: the object
    behind the value, such as the nearest wall. ``note`` names the source of the signal.
    """

    values: Floats
    objects: ObjectIndices | None = None
    names: tuple[str, ...] = ()
    note: str = ""

    def object_at(self, index: int) -> str:
        """Return the name of the object involved at sample ``index``, empty if there is none."""
        if self.objects is None or self.objects[index] < 0:
            return ""
        return self.names[int(self.objects[index])]


@dataclass(frozen=True, slots=True, eq=False)
class TimeBase:
    """The trusted samples of a trace.

    ``time`` (n,) [s]; ``weight`` (n,) [s]: a sample counts until the next one, the last one until
    ``end``. If ``closed``, the trace ends with the run; otherwise up to ``remaining`` seconds are
    unknown.
    """

    time: Floats
    weight: Floats
    end: float
    closed: bool
    remaining: float

    @property
    def start(self) -> float:
        """Time of the first sample [s], 0 without samples."""
        return float(self.time[0]) if len(self.time) else 0.0


def time_base_of(trace: Trace) -> TimeBase:
    """Return the time base of ``trace``: its ground truth up to ``valid_until``.

    A crashed run counts as cut, since the rest of its motion is unknown.
    """
    recorded = np.asarray(trace.ground_truth.time, dtype=np.float64)
    count = int(np.searchsorted(recorded, trace.valid_until + _ROUNDING, side="right"))
    time = recorded[:count]
    end = max(float(trace.valid_until), float(time[-1])) if count else float(trace.valid_until)
    weight = np.diff(time, append=end) if count else np.empty(0)
    closed = trace.complete and trace.ended != "crashed"
    # A run may end one simulation tick past its limit, which is counted from its first sample.
    start = float(time[0]) if count else 0.0
    remaining = 0.0 if closed else max(0.0, start + trace.spec.limit + 1.0 / TICK_RATE - end)
    return TimeBase(time, weight, end, closed, remaining)


def quantile_index(values: Floats, weight: Floats, share: float) -> int:
    """Return the index of the first of ``values`` (n,) that covers ``share`` of their time.

    ``weight`` (n,) [s] is the duration of each: samples are not evenly apart, so this is a
    quantile of time.
    """
    order = np.argsort(values, kind="stable")
    covered = np.cumsum(weight[order])
    rank = int(np.searchsorted(covered, share * covered[-1] - _ROUNDING))
    return int(order[min(rank, len(order) - 1)])


def hold_last(stamps: Floats, values: Floats, time: Floats) -> Floats:
    """Sample ``values`` (m,) taken at ``stamps`` (m,) at ``time`` (n,), holding the last one.

    NaN before the first stamp.
    """
    if not len(stamps):
        return np.full(len(time), np.nan)
    index = np.searchsorted(stamps, time + _ROUNDING, side="right") - 1
    return np.where(index < 0, np.nan, values[np.maximum(index, 0)])


def hold_longest(stamps: Floats, values: Floats, time: Floats) -> Floats:
    """Sample ``values`` (m,) taken at ``stamps`` (m,): the largest since the sample before.

    A sample without a new value holds the last one; NaN before the first. Unlike
    :func:`hold_last`, this skips no value between two samples.
    """
    index = np.searchsorted(time, stamps - _ROUNDING)
    inside = index < len(time)
    largest = np.full(len(time), np.nan)
    np.fmax.at(largest, index[inside], values[inside])
    has_value = ~np.isnan(largest)
    return hold_last(time[has_value], largest[has_value], time)


def recorded_signal(trace: Trace, name: str, time: Floats) -> Floats:
    """Return a recorded signal at ``time`` (n,), the first samples of the ground truth.

    Commands and estimates are held until the next one; NaN before the first. The latency of an
    external system is held too; of several between two samples the longest counts.
    """
    if name in _TRUTH:
        channel: Floats = getattr(trace.ground_truth, _TRUTH[name])[: len(time)]
        return channel
    if name in _COMMAND:
        return hold_last(trace.command.time, getattr(trace.command, _COMMAND[name]), time)
    if name in _ESTIMATE:
        return hold_last(trace.estimate.time, getattr(trace.estimate, _ESTIMATE[name]), time)
    if name == "latency":
        return hold_longest(trace.latency.time, trace.latency.seconds, time)
    return hold_last(trace.cloud.time, trace.cloud_count.astype(np.float64), time)


def tree_signal(trace: Trace, name: str, node: str, time: Floats) -> Floats:
    """Return ``bt.recoveries`` or ``bt.node(node)`` at ``time`` (n,), NaN if no tree is recorded.

    A node that ran only between two samples counts at the later one.
    """
    if _TREE not in trace.spec.sut.recorded:
        return np.full(len(time), np.nan)
    logs = [report for report in trace.reports if isinstance(report, BehaviorTreeLog)]
    changes = [(log.time, change) for log in logs for change in log.changes]
    if name == "bt.recoveries":
        begins = np.array([moment for moment, change in changes if change.starts_recovery])
        return np.searchsorted(begins, time + _ROUNDING, side="right").astype(np.float64)
    values = np.zeros(len(time))
    since: dict[int, float] = {}
    for moment, change in changes:
        if change.node == node and change.current == "RUNNING":
            since.setdefault(change.uid, moment)
        elif change.node == node and change.uid in since:
            _mark(values, time, since.pop(change.uid), moment)
    for begin in since.values():
        _mark(values, time, begin, math.inf)
    return values


def _mark(values: Floats, time: Floats, begin: float, end: float) -> None:
    """Set the samples to 1, from the first at or after ``begin`` to the first one for ``end``."""
    first, last = np.searchsorted(time, np.array([begin, end]) - _ROUNDING)
    values[first : last + 1] = 1.0


class LocalisationSignals:
    """Sampler of the signals ``loc.*`` of one trace on ``time`` (n,)."""

    def __init__(self, trace: Trace, time: Floats) -> None:
        self._trace, self._time = trace, time
        has_cloud = len(trace.cloud.time) > 0
        self._spread = trace.cloud if has_cloud else trace.estimate
        self._note = "from the particle cloud" if has_cloud else "from the estimate's covariance"

    def sample(self, name: str) -> SignalSeries:
        """Return the signal ``name`` (``loc.error``, ``loc.sigma.x``, …)."""
        estimate = self._trace.estimate
        if name == "loc.age":
            return SignalSeries(self._time - hold_last(estimate.time, estimate.time, self._time))
        if name == "loc.inside_2sigma":
            return self._hold(self._spread, self._inside(), self._note)
        if name.startswith("loc.sigma"):
            axis = ("x", "y", "yaw").index(name.rpartition(".")[2])
            return self._hold(self._spread, self._sigma(axis), self._note)
        dx, dy, dyaw = self._difference(estimate)
        values = {
            "loc.error": np.hypot(dx, dy),
            "loc.error.x": dx,
            "loc.error.y": dy,
            "loc.error.yaw": dyaw,
        }[name]
        return self._hold(estimate, values, "")

    def inside_margin(self) -> SignalSeries:
        """Return the remainder [m] of two standard deviations, on the axis with the smaller one.

        It is at least 0 where ``loc.inside_2sigma`` is true.
        """
        dx, dy, _ = self._difference(self._spread)
        rest = np.minimum(2.0 * self._sigma(0) - np.abs(dx), 2.0 * self._sigma(1) - np.abs(dy))
        return self._hold(self._spread, rest, self._note)

    def _hold(self, track: PoseTrack, values: Floats, note: str) -> SignalSeries:
        return SignalSeries(hold_last(track.time, values, self._time), note=note)

    def _sigma(self, axis: int) -> Floats:
        variance = self._spread.covariance[:, axis, axis]
        sigma: Floats = np.sqrt(np.maximum(variance, 0.0))
        return sigma

    def _inside(self) -> Floats:
        """Return equation 1 of the paper, on x and on y: ``|mean - truth| <= 2 sigma``."""
        dx, dy, _ = self._difference(self._spread)
        inside = (np.abs(dx) <= 2.0 * self._sigma(0)) & (np.abs(dy) <= 2.0 * self._sigma(1))
        return inside.astype(np.float64)

    def _difference(self, track: PoseTrack) -> tuple[Floats, Floats, Floats]:
        """Return ``track`` minus truth at its stamps: x, y [m], yaw [rad] in (-pi, pi]."""
        truth, stamps = self._trace.ground_truth, track.time
        if not len(truth.time):
            empty = np.full(len(stamps), np.nan)
            return empty, empty, empty
        x = np.interp(stamps, truth.time, truth.x)
        y = np.interp(stamps, truth.time, truth.y)
        # Unwrap before interpolating: between pi - e and -pi + e lies pi, not 0.
        yaw = np.interp(stamps, truth.time, np.unwrap(truth.yaw))
        # Into (-pi, pi]. ``wrap_angle`` differs in the last bits, and verdicts depend on them.
        turned = np.pi - np.mod(np.pi - (track.yaw - yaw), 2.0 * np.pi)
        return track.x - x, track.y - y, turned
