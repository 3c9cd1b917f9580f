"""Signals of a trace, sampled on its time base when an oracle asks for them.

Plug-in signals and oracles run here too: they get read-only arrays, and their values are checked.
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any, Final, TypeVar

import numpy as np

from daemon.judging.oracles._clearance import (
    box_clearance_series,
    distance_series,
    inside_series,
    place_distance_series,
    place_outline,
)
from daemon.judging.oracles._obstacles import (
    ObstaclePolygons,
    belongs_to,
    footprint_box,
    hinge_foot,
    joint_positions,
    obstacles_named,
    obstacles_of,
)
from daemon.judging.oracles._series import (
    RECORDED_SIGNALS,
    LocalisationSignals,
    ObjectIndices,
    SignalSeries,
    hold_last,
    recorded_signal,
    time_base_of,
    tree_signal,
)
from daemon.model.verdicts import Evidence, MarginInterval
from daemon.trace import Trace
from grammars.model.geometry import Floats
from grammars.oracle import (
    ROBOT,
    SIGNALS,
    CustomCall,
    JointReference,
    Signal,
    custom_oracle,
    custom_signal,
    custom_signal_names,
    object_signals,
    obstacle_names,
    thing_of,
)
from grammars.text.expressions import Number
from grammars.text.plugins import explain_plugin_error

DOOR_CLEARANCE: Final = "clearance(doors)"
"""Name of a signal for people, unknown to oracles: the least ``clearance`` of any moving object."""

T = TypeVar("T")


class PluginError(Exception):
    """A plug-in raised an error or returned nonsense; the message names both."""


def sample_plugin_signal(
    name: str, sampler: SignalSampler, arguments: tuple[float, ...]
) -> SignalSeries:
    """Sample a plug-in signal; raises :class:`PluginError`."""
    declared = _require_plugin(custom_signal(name), "signal", name)
    # Pass read-only views: a plug-in is somebody else's code, in the same process.
    time = read_only_view(sampler.time_base.time)
    answer = _call_plugin(
        f'the signal "{name}"', declared.sample, sampler.read_only_trace, time, *arguments
    )
    values = _as_floats(answer, f'the signal "{name}"')
    if values.shape != time.shape:
        raise PluginError(
            f'the signal "{name}" gave values of shape {values.shape} for {len(time)} times'
        )
    if np.isinf(values).any():
        raise PluginError(f'the signal "{name}" is infinite: NaN means it is not known')
    if declared.unit == "bool":
        values = np.where(np.isnan(values), np.nan, (values != 0.0).astype(np.float64))
    return SignalSeries(values)


def judge_by_plugin(judgement: CustomCall, sampler: SignalSampler) -> MarginInterval:
    """Judge by a plug-in oracle; raises :class:`PluginError`."""
    name = f'the oracle "{judgement.name}"'
    declared = _require_plugin(custom_oracle(judgement.name), "oracle", judgement.name)
    arguments = tuple(number.value for number in judgement.arguments)
    answer = _call_plugin(name, declared.judge, sampler.read_only_trace, *arguments)
    lower, upper, evidence = _interval(answer, name)
    if sampler.time_base.closed or declared.judges_prefixes:
        return MarginInterval(lower, upper, evidence)
    # It judges a trace that was cut like a run that ended there, so its bounds do not hold.
    return MarginInterval(-math.inf, math.inf, evidence)


def read_only_view(array: Floats) -> Floats:
    """Return a read-only view of ``array``."""
    view = array.view()
    view.flags.writeable = False
    return view


def read_only_copy(value: T) -> T:
    """Return a dataclass value whose arrays, at any depth, are read-only views; lists stay.

    A plug-in that writes into a trace would change the verdicts of every other oracle.
    """
    changes: dict[str, Any] = {}
    for field in fields(value):  # type: ignore[arg-type]
        part = getattr(value, field.name)
        if isinstance(part, np.ndarray):
            changes[field.name] = read_only_view(part)
        elif is_dataclass(part) and any(
            isinstance(getattr(part, inner.name), np.ndarray) for inner in fields(part)
        ):
            changes[field.name] = read_only_copy(part)
    return replace(value, **changes)  # type: ignore[type-var]


def _require_plugin(declared: T | None, kind: str, name: str) -> T:
    if declared is None:
        raise PluginError(f'the {kind} "{name}" is not installed')
    return declared


def _call_plugin(plugin: str, function: Any, *arguments: object) -> object:
    try:
        answer: object = function(*arguments)
    except (Exception, SystemExit) as error:  # sys.exit() in a plug-in must not end a worker
        raise PluginError(explain_plugin_error(f"{plugin} failed", error, __file__)) from error
    return answer


def _as_floats(answer: object, plugin: str) -> Floats:
    try:
        return np.array(answer, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise PluginError(f"{plugin} gave no numbers: {error}") from error


def _interval(answer: object, plugin: str) -> tuple[float, float, Evidence]:
    """Read ``(lower, upper)`` or ``(lower, upper, evidence)``."""
    if not isinstance(answer, tuple) or len(answer) not in (2, 3):
        raise PluginError(f"{plugin} must return (lower, upper) or (lower, upper, Evidence)")
    evidence = answer[2] if len(answer) == 3 else Evidence()
    if not isinstance(evidence, Evidence):
        raise PluginError(f"{plugin} gave {type(evidence).__name__} instead of Evidence")
    lower, upper = _as_floats(answer[:2], plugin).tolist()
    # Unlike ``lower > upper``, this refuses NaN as well.
    if not lower <= upper:
        raise PluginError(f"{plugin} gave the interval [{lower}, {upper}]")
    return lower, upper, _plain_evidence(evidence, plugin)


def _plain_evidence(evidence: Evidence, plugin: str) -> Evidence:
    """Return evidence of only finite floats and text, as ledgers keep it."""
    numbers = (evidence.time, evidence.value, evidence.limit)
    present = [number for number in numbers if number is not None]
    if not np.isfinite(_as_floats(present, plugin)).all():
        raise PluginError(f"{plugin} gave evidence that is not finite")
    time, value, limit = (None if number is None else float(number) for number in numbers)
    return Evidence(time, value, limit, str(evidence.object), str(evidence.note))


class SignalSampler:
    """Samples the signals of one trace; each is computed once."""

    def __init__(self, trace: Trace) -> None:
        self.trace = trace
        self.time_base = time_base_of(trace)
        count = len(self.time_base.time)
        truth = trace.ground_truth
        # The time base is the valid part of the ground truth; every array has its length.
        self.x, self.y = truth.x[:count], truth.y[:count]
        self.poses = np.column_stack((self.x, self.y, truth.yaw[:count]))
        self._cache: dict[tuple[str, str, tuple[float, ...]], SignalSeries] = {}
        self.localisation = LocalisationSignals(trace, self.time_base.time)

    def sample(self, signal: Signal) -> SignalSeries:
        """Return ``signal`` on the time base; it must have passed the static checks.

        Raises :class:`PluginError` if a plug-in signal fails.
        """
        named = thing_of(signal)
        thing = "" if named is None else named.name
        arguments = tuple(a.value for a in signal.arguments if isinstance(a, Number))
        key = (signal.name, thing, arguments)
        if key not in self._cache:
            self._cache[key] = self._compute(signal.name, thing, arguments)
        return self._cache[key]

    def with_trace(self, trace: Trace) -> SignalSampler:
        """Return a sampler of ``trace``, which differs only in how its run ended.

        Both share their sampled signals.
        """
        other = copy.copy(self)
        other.trace, other.time_base = trace, time_base_of(trace)
        other.__dict__.pop("read_only_trace", None)
        return other

    @functools.cached_property
    def read_only_trace(self) -> Trace:
        """The trace for plug-ins, with read-only arrays."""
        return read_only_copy(self.trace)

    @functools.cached_property
    def _objects(self) -> dict[str, JointReference]:
        return object_signals(self.trace.scene)

    @functools.cached_property
    def current(self) -> Floats:
        """The reported index of the waypoint being approached (n,); NaN before the first report.

        It is the number of waypoints once all are done.
        """
        return self._progress([float(p.current) for p in self.trace.progress])

    def _compute(self, name: str, thing: str, arguments: tuple[float, ...]) -> SignalSeries:
        if name == DOOR_CLEARANCE:
            movers = (item.name for item in self.trace.scene.objects)
            return self._footprint_clearance(obstacles_named(self.obstacles, *movers))
        if name not in SIGNALS:
            if name in custom_signal_names():
                return sample_plugin_signal(name, self, arguments)
            return self._object_signal(name)
        if name in RECORDED_SIGNALS:
            return SignalSeries(recorded_signal(self.trace, name, self.time_base.time))
        if name.startswith("loc."):
            return self.localisation.sample(name)
        if name == "clearance":
            return self._clearance(thing, arguments)
        if name == "distance":
            return self._distance(thing)
        if name.startswith("bt."):
            return SignalSeries(tree_signal(self.trace, name, thing, self.time_base.time))
        if name == "in":
            return inside_series(place_outline(self.trace.scene, thing), self.poses, thing)
        if name.startswith("contact"):
            depth, objects, names = self._contacts(thing)
            values = depth if name == "contact.depth" else (objects >= 0).astype(np.float64)
            return SignalSeries(values, objects, names)
        trace, count = self.trace, len(self.time_base.time)
        truth = trace.ground_truth
        plain: dict[str, Callable[[], Floats]] = {
            "speed": lambda: np.hypot(truth.vx[:count], truth.vy[:count]),
            "speed.angular": lambda: np.abs(truth.wz[:count]),
            "path.length": self._path_length,
            "elapsed": lambda: self.time_base.time - self.time_base.start,
            "mission.leg": lambda: self._leg() + 1.0,
            "mission.leg.elapsed": self._leg_elapsed,
            "mission.reached": self._reached,
            "mission.remaining": lambda: len(trace.spec.mission.waypoints) - self._reached(),
            "mission.distance": self._distance_to_go,
        }
        return SignalSeries(plain[name]())

    def _clearance(self, thing: str, arguments: tuple[float, ...]) -> SignalSeries:
        obstacles = obstacles_named(self.obstacles, thing) if thing else self.obstacles
        if not arguments:
            return self._footprint_clearance(obstacles)
        half = (arguments[0], arguments[1])
        return box_clearance_series(obstacles, self.poses, centre=(0.0, 0.0), half=half)

    def _footprint_clearance(self, obstacles: ObstaclePolygons) -> SignalSeries:
        centre, half = footprint_box(self.trace.spec.robot.footprint)
        return box_clearance_series(obstacles, self.poses, centre=centre, half=half)

    def _distance(self, thing: str) -> SignalSeries:
        footprint = self.trace.spec.robot.footprint
        if thing in obstacle_names(self.trace.scene):
            named = obstacles_named(self.obstacles, thing)
            return distance_series(named, self.poses, footprint)
        outline = place_outline(self.trace.scene, thing)
        return place_distance_series(outline, self.poses, footprint, thing)

    @functools.cached_property
    def obstacles(self) -> ObstaclePolygons:
        """Obstacles of the robot's body over time."""
        return obstacles_of(self.trace, self.time_base.time)

    def _contacts(self, thing: str) -> tuple[Floats, ObjectIndices, tuple[str, ...]]:
        """Return the deepest contact since the previous sample: depth, index of the object, names.

        ``thing`` limits this to contacts with it.
        """
        time = self.time_base.time
        depth = np.zeros(len(time))
        objects = np.full(len(time), -1, dtype=np.int32)
        names: dict[str, int] = {}
        for record in self.trace.contacts:
            if ROBOT not in (record.first, record.second):
                continue
            other = record.second if record.first == ROBOT else record.first
            if thing and not belongs_to(other, thing):
                continue
            # Contacts are recorded with the next state: each belongs to the first sample at or
            # after it.
            index = int(np.searchsorted(time, record.time - 1e-9))
            if index < len(time) and (objects[index] < 0 or record.depth > depth[index]):
                depth[index] = max(depth[index], record.depth)
                objects[index] = names.setdefault(other, len(names))
        return depth, objects, tuple(names)

    def _path_length(self) -> Floats:
        steps = np.hypot(np.diff(self.x, prepend=self.x[:1]), np.diff(self.y, prepend=self.y[:1]))
        return np.cumsum(steps)

    def _leg(self) -> Floats:
        """Return the index of the waypoint being approached (n,), the last one when done."""
        return np.minimum(self.current, len(self.trace.spec.mission.waypoints) - 1.0)

    def _leg_elapsed(self) -> Floats:
        leg, time = self._leg(), self.time_base.time
        begins: dict[float, float] = {}
        for now, value in zip(time.tolist(), leg.tolist(), strict=True):
            begins.setdefault(value, now)
        # Before the first report there is no leg; a NaN never equals a key, not even itself.
        since = [begins.get(value, math.nan) for value in leg.tolist()]
        elapsed: Floats = time - np.array(since)
        return elapsed

    def _reached(self) -> Floats:
        return self._progress([float(p.reached) for p in self.trace.progress])

    def _distance_to_go(self) -> Floats:
        waypoints = self.trace.spec.mission.waypoints
        if not waypoints:
            return np.full(len(self.time_base.time), np.nan)
        leg = self._leg()
        unknown = np.isnan(leg)
        index = np.where(unknown, 0.0, leg).astype(np.int64)
        x, y = (np.array([getattr(w, axis) for w in waypoints]) for axis in "xy")
        return np.where(unknown, np.nan, np.hypot(self.x - x[index], self.y - y[index]))

    def _progress(self, values: list[float]) -> Floats:
        stamps = np.array([p.time for p in self.trace.progress], dtype=np.float64)
        return hold_last(stamps, np.array(values), self.time_base.time)

    def _object_signal(self, name: str) -> SignalSeries:
        reference = self._objects[name]
        positions = joint_positions(self.trace, reference.object, self.time_base.time)
        if name.endswith(".distance"):
            foot_x, foot_y = hinge_foot(reference.object, reference.joint, positions)
            return SignalSeries(np.hypot(self.x - foot_x, self.y - foot_y))
        return SignalSeries(positions[:, reference.object.joints.index(reference.joint)])
