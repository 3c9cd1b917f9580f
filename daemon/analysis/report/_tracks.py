"""Tracks and measures of one trace for figures, from the signals of oracles.

Figures show the judged samples; this module computes no signals of its own. It also extracts how
the robot drove around doors that shut in its face, and around the same doors that stay open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import fmean
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.analysis.report._measures import (
    SPEED_AT_TRIGGER,
    SafetyBuffer,
    measured_values,
    standard_oracles,
)
from daemon.judging.oracles import SignalSampler, footprint_box, judge
from grammars.model.behaviour import JointEvent, Trigger, joint_event
from grammars.model.geometry import Floats, Point2, Ring
from grammars.oracle import ROBOT, Signal, object_signals

if TYPE_CHECKING:
    from daemon.trace import Trace

BEFORE: Final = 5.0
AFTER: Final = 15.0
"""Time around a trigger in figures [s]: the approach, and the detour."""
_RATE: Final = 5.0
"""Samples per second of that time."""
_POINTS: Final = 4000
"""Most points of one run: about as many as the histogram has cells, 64 by 64."""

ThinnedSamples: TypeAlias = npt.NDArray[np.float32]
"""Samples for drawing; measures are computed from all samples before."""
Indices: TypeAlias = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class TriggerEncounter:
    """The robot near a trigger, from :data:`BEFORE` to :data:`AFTER` the moment of its approach.

    ``fired`` tells whether the trigger belongs to the scenario; otherwise it belongs to another
    one. ``time`` [s] is in the run, ``since`` (n,) [s] relative to it, with ``speed`` [m/s] and
    ``turning`` [rad/s].
    """

    joint: str
    time: float
    fired: bool
    speed_then: float
    since: ThinnedSamples
    speed: ThinnedSamples
    turning: ThinnedSamples


def _no_samples() -> ThinnedSamples:
    return np.empty(0, np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class RunTracks:
    """Tracks and measures of one run. Tracks have the shape (n,), all on ``time`` [s].

    ``x``, ``y`` [m]: true position. ``clearance`` [m]: distance from the box around the footprint
    to the nearest obstacle, negative inside. ``error``, ``sigma_x``, ``sigma_y`` [m]: localisation;
    NaN where unknown. ``returns`` (k, 2) [m]: laser returns inside the buffer, base frame.
    ``contacts`` (time, object, x, y). ``measures`` by name, in the units of
    :func:`daemon.analysis.report._measures.standard_measures`. ``top_speed`` [m/s] and
    ``top_turning`` [rad/s] are the largest magnitudes. ``problem`` says why the tracks are empty,
    if they are.
    """

    problem: str = ""
    footprint: Ring = ()
    body: Point2 = (0.0, 0.0)
    buffer: Point2 = (0.0, 0.0)
    limit: float = 0.0
    time: ThinnedSamples = field(default_factory=_no_samples)
    x: ThinnedSamples = field(default_factory=_no_samples)
    y: ThinnedSamples = field(default_factory=_no_samples)
    clearance: ThinnedSamples = field(default_factory=_no_samples)
    error: ThinnedSamples = field(default_factory=_no_samples)
    sigma_x: ThinnedSamples = field(default_factory=_no_samples)
    sigma_y: ThinnedSamples = field(default_factory=_no_samples)
    returns: ThinnedSamples = field(default_factory=lambda: np.empty((0, 2), np.float32))
    contacts: tuple[tuple[float, str, float, float], ...] = ()
    encounters: tuple[TriggerEncounter, ...] = ()
    measures: dict[str, float] = field(default_factory=dict)
    scene: str = ""
    top_speed: float = 0.0
    top_turning: float = 0.0


def _encounters(sampler: SignalSampler, watches: Sequence[Trigger]) -> tuple[TriggerEncounter, ...]:
    """Return the encounters of the robot with each trigger, in the order of time.

    A trigger of the run itself counts from its first firing in the trace. One of another scenario
    counts from the approach of the robot, if the trigger is measured from something fixed to the
    base.
    """
    trace = sampler.trace
    own = {b.joint for b in trace.spec.behaviours if isinstance(b, Trigger)}
    fired: dict[str, float] = {}
    for event in trace.events:
        if event.source in own and joint_event(event.text) is JointEvent.TRIGGERED:
            fired.setdefault(event.source, event.time)
    # Section 4.4.1 asks for the cost of a door that shuts, so the same moment is needed in the
    # static sibling of the scenario, where no trigger fires.
    moments = [(time, joint, True) for joint, time in fired.items()]
    moments += [
        (time, watch.joint, False)
        for watch in watches
        if watch.joint not in own and (time := _approach_time(sampler, watch)) is not None
    ]
    return tuple(_encounter(sampler, *moment) for moment in sorted(moments))


def _approach_time(sampler: SignalSampler, trigger: Trigger) -> float | None:
    """Return the first time at the distance of ``trigger``, ``None`` if never or unknown."""
    scene, distance = sampler.trace.scene, f"{trigger.joint}.distance"
    reference = object_signals(scene).get(distance)
    # Only a fixed place can be measured from afterwards: a leaf that swings in another scenario
    # is somewhere else here.
    if reference is None or trigger.to != "base" or trigger.of == "leaf":
        return None
    if trigger.of == "hinge" and reference.joint.kind == "revolute":
        away = sampler.sample(Signal(distance)).values
    else:
        x, y = reference.object.pose.x, reference.object.pose.y
        doorways = {doorway.name: doorway.footprint for doorway in scene.doorways}
        if trigger.of == "doorway" and (ring := doorways.get(reference.object.doorway)):
            x, y = np.mean(ring, axis=0)
        away = np.hypot(sampler.x - x, sampler.y - y)
    near = np.flatnonzero(away < trigger.distance)
    return float(sampler.time_base.time[near[0]]) if len(near) else None


def _encounter(sampler: SignalSampler, time: float, joint: str, fired: bool) -> TriggerEncounter:
    """Return speed and turning speed around ``time``, thinned to five samples a second."""
    stamps, truth = sampler.time_base.time, sampler.trace.ground_truth
    first, last = np.searchsorted(stamps, (time - BEFORE, time + AFTER))
    rate = len(stamps) / max(float(stamps[-1] - stamps[0]), 1e-9) if len(stamps) > 1 else _RATE
    window = slice(int(first), int(last), max(1, round(rate / _RATE)))
    speed = np.hypot(truth.vx[window], truth.vy[window])
    then = min(int(np.searchsorted(stamps, time)), len(stamps) - 1)
    return TriggerEncounter(
        joint=joint,
        time=time,
        fired=fired,
        speed_then=float(np.hypot(truth.vx[then], truth.vy[then])),
        since=(stamps[window] - time).astype(np.float32),
        speed=speed.astype(np.float32),
        turning=np.asarray(truth.wz[window], dtype=np.float32),
    )


def extract_tracks(
    sampler: SignalSampler, buffer: SafetyBuffer, watches: Sequence[Trigger], points: int
) -> RunTracks:
    """Return tracks and measures of a trace, thinned to about ``points`` samples for drawing."""
    if not len(sampler.time_base.time):
        return RunTracks(problem="nothing was recorded")
    trace = sampler.trace
    footprint, truth = trace.spec.robot.footprint, trace.ground_truth
    _, body = footprint_box(footprint)
    centre, half = buffer.box(footprint)
    names = ("clearance", "loc.error", "loc.sigma.x", "loc.sigma.y")
    signals = [sampler.sample(Signal(name)).values for name in names]
    indices = thinned_indices(signals[0], signals[1], points)
    tracks = (sampler.time_base.time, sampler.x, sampler.y, *signals)
    time, x, y, clearance, error, sigma_x, sigma_y = (
        track[indices].astype(np.float32) for track in tracks
    )
    encounters = _encounters(sampler, watches)
    measures = measured_values(judge(trace, standard_oracles(buffer), sampler=sampler))
    if speeds := [encounter.speed_then for encounter in encounters if encounter.fired]:
        measures[SPEED_AT_TRIGGER] = fmean(speeds)
    return RunTracks(
        footprint=footprint,
        body=body,
        buffer=half,
        limit=min(half[0] - body[0], half[1] - body[1]),
        time=time,
        x=x,
        y=y,
        clearance=clearance,
        error=error,
        sigma_x=sigma_x,
        sigma_y=sigma_y,
        returns=returns_inside(trace, centre, half),
        contacts=_contacts(trace),
        encounters=encounters,
        measures=measures,
        scene=trace.spec.scene,
        top_speed=float(np.fmax.reduce(np.hypot(truth.vx, truth.vy), initial=0.0)),
        top_turning=float(np.fmax.reduce(np.abs(truth.wz), initial=0.0)),
    )


def thinned_indices(clearance: Floats, error: Floats, points: int) -> Indices:
    """Return the indices of about ``points`` samples that keep every dip and every peak.

    Each stretch keeps its first sample, its least clearance and its largest error. Every n-th
    sample alone would lose exactly these.
    """
    count = len(clearance)
    width = max(1, -(-3 * count // points))
    if width <= 2:
        return np.arange(count)
    starts = np.arange(0, count, width)
    padded = -(-count // width) * width - count

    def worst(values: Floats) -> Indices:
        whole = np.append(np.nan_to_num(values, nan=-np.inf), np.full(padded, -np.inf))
        indices: Indices = starts + whole.reshape(-1, width).argmax(axis=1)
        return indices

    return np.unique(np.concatenate((starts, worst(-clearance), worst(error), [count - 1])))


def _contacts(trace: Trace) -> tuple[tuple[float, str, float, float], ...]:
    """Return time, object and place of contacts; one entry for each second and object."""
    contacts: dict[tuple[int, str], tuple[float, str, float, float]] = {}
    for record in trace.contacts:
        # A contact is recorded as long as it lasts, but one cross in a figure is enough.
        if ROBOT in (record.first, record.second):
            other = record.second if record.first == ROBOT else record.first
            entry = (record.time, other, record.point[0], record.point[1])
            contacts.setdefault((int(record.time), other), entry)
    return tuple(contacts.values())


def returns_inside(trace: Trace, centre: Point2, half: Point2) -> ThinnedSamples:
    """Return laser returns (k, 2) [m, base frame] inside the box, of every laser of the robot.

    Empty if the trace was read without its scans.
    """
    parts = [np.empty((0, 2))]
    for laser, scans in zip(trace.spec.robot.lasers, trace.scans or (), strict=False):
        mount = laser.mount
        # Lost rays and those without a return are NaN or infinite.
        far = np.hypot(*half) + np.hypot(*centre) + np.hypot(mount.x, mount.y)
        ranges = scans.ranges.ravel()
        # The float32, rounded up, keeps the ranges from becoming float64.
        near = np.flatnonzero((ranges > 0.0) & (ranges <= np.float32(far * 1.001)))
        rays, ranges = near % laser.rays, ranges[near].astype(np.float64)
        bearing = mount.yaw + laser.angle_min + laser.angle_increment * np.arange(laser.rays)
        x = mount.x + ranges * np.cos(bearing)[rays] - centre[0]
        y = mount.y + ranges * np.sin(bearing)[rays] - centre[1]
        within = (np.abs(x) < half[0]) & (np.abs(y) < half[1])
        parts.append(np.column_stack((x, y))[within] + centre)
    inside = np.concatenate(parts)
    if len(inside) > _POINTS:
        inside = inside[np.linspace(0, len(inside) - 1, _POINTS).astype(np.int64)]
    return inside.astype(np.float32)
