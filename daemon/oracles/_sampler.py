"""Signals of a trace, sampled on its time base when an oracle asks for them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from daemon.oracles._clearance import (
    Obstacles,
    about,
    clearance,
    footprint_box,
    obstacles_of,
    only,
)
from daemon.oracles._custom import sample_custom, sealed
from daemon.oracles._links import hinge_foot, joint_positions
from daemon.oracles._localisation import Localisation
from daemon.oracles._series import Codes, Series
from daemon.oracles._timeline import hold, timeline_of
from daemon.oracles._tracks import RECORDED, recorded
from grammars.oracle import (
    SIGNALS,
    JointReference,
    Number,
    Signal,
    custom_signal_names,
    object_signals,
)
from grammars.values import Floats

if TYPE_CHECKING:
    from daemon.trace import Trace

ROBOT = "robot"
"""What recorded contacts call the robot's body."""


class Sampler:
    """Samples the signals of one trace; each is computed once."""

    def __init__(self, trace: Trace) -> None:
        self.trace = trace
        self.timeline = timeline_of(trace)
        count = len(self.timeline.time)
        truth = trace.ground_truth
        self.x, self.y = truth.x[:count], truth.y[:count]
        self.poses = np.column_stack((self.x, self.y, truth.yaw[:count]))
        self._cache: dict[tuple[str, str, tuple[float, ...]], Series] = {}
        self._localisation = Localisation(trace, self.timeline.time)

    def sample(self, signal: Signal) -> Series:
        """Return ``signal`` on the time base; it must have passed the static checks.

        Raises :class:`daemon.oracles._custom.PluginError` for a signal of one's own that fails.
        """
        thing = signal.object.name if signal.object is not None else ""
        arguments = tuple(a.value for a in signal.arguments if isinstance(a, Number))
        key = (signal.name, thing, arguments)
        if key not in self._cache:
            self._cache[key] = self._compute(signal.name, thing, arguments)
        return self._cache[key]

    @functools.cached_property
    def sealed(self) -> Trace:
        """The trace as plug-ins get it: none of its arrays can be written to."""
        return sealed(self.trace)

    @functools.cached_property
    def _objects(self) -> dict[str, JointReference]:
        return object_signals(self.trace.scene)

    @functools.cached_property
    def current(self) -> Floats:
        """The waypoint being approached (n,), from 0, as reported; NaN before the first report.

        The number of waypoints once all are done.
        """
        return self._progress([float(p.current) for p in self.trace.progress])

    def _compute(self, name: str, thing: str, arguments: tuple[float, ...]) -> Series:
        if name not in SIGNALS:
            if name in custom_signal_names():
                return sample_custom(name, self, arguments)
            return self._object_signal(name)
        if name in RECORDED:
            return Series(recorded(self.trace, name, self.timeline.time))
        if name.startswith("loc."):
            return self._localisation.sample(name)
        if name == "clearance":
            return self._clearance(thing, arguments)
        if name.startswith("contact"):
            depth, objects, names = self._contacts(thing)
            values = depth if name == "contact.depth" else (objects >= 0).astype(np.float64)
            return Series(values, objects, names)
        plain: dict[str, Callable[[], Floats]] = {
            "speed": self._speed,
            "speed.angular": self._angular_speed,
            "path.length": self._path_length,
            "elapsed": lambda: self.timeline.time - self.timeline.start,
            "mission.leg": lambda: self._leg() + 1.0,
            "mission.leg.elapsed": self._leg_elapsed,
            "mission.reached": self._reached,
            "mission.distance": self._distance_to_go,
        }
        return Series(plain[name]())

    def _clearance(self, thing: str, arguments: tuple[float, ...]) -> Series:
        if arguments:
            centre, half = (0.0, 0.0), (arguments[0], arguments[1])
        else:
            centre, half = footprint_box(self.trace.spec.robot.footprint)
        obstacles = only(self.obstacles, thing) if thing else self.obstacles
        return clearance(obstacles, self.poses, centre=centre, half=half)

    @functools.cached_property
    def obstacles(self) -> Obstacles:
        """Everything the robot's body can hit, over time."""
        return obstacles_of(self.trace, self.timeline.time)

    def _contacts(self, thing: str) -> tuple[Floats, Codes, tuple[str, ...]]:
        """Deepest contact of the robot per sample, since the previous sample, and with what.

        With ``thing``, only contacts with that.
        """
        time = self.timeline.time
        depth = np.zeros(len(time))
        objects = np.full(len(time), -1, dtype=np.int32)
        names: dict[str, int] = {}
        for record in self.trace.contacts:
            if ROBOT not in (record.first, record.second):
                continue
            other = record.second if record.first == ROBOT else record.first
            if thing and not about(other, thing):
                continue
            index = int(np.searchsorted(time, record.time - 1e-9))
            if index < len(time) and (objects[index] < 0 or record.depth > depth[index]):
                depth[index] = max(depth[index], record.depth)
                objects[index] = names.setdefault(other, len(names))
        return depth, objects, tuple(names)

    def _speed(self) -> Floats:
        truth, count = self.trace.ground_truth, len(self.timeline.time)
        return np.hypot(truth.vx[:count], truth.vy[:count])

    def _angular_speed(self) -> Floats:
        return np.abs(self.trace.ground_truth.wz[: len(self.timeline.time)])

    def _path_length(self) -> Floats:
        steps = np.hypot(np.diff(self.x, prepend=self.x[:1]), np.diff(self.y, prepend=self.y[:1]))
        return np.cumsum(steps)

    def _leg(self) -> Floats:
        """The waypoint being approached (n,), from 0; the last one stays once all are done."""
        return np.minimum(self.current, len(self.trace.spec.mission.waypoints) - 1.0)

    def _leg_elapsed(self) -> Floats:
        leg, time = self._leg(), self.timeline.time
        begun: dict[float, float] = {}
        for now, value in zip(time.tolist(), leg.tolist(), strict=True):
            begun.setdefault(value, now)
        since = [begun[value] for value in leg.tolist()]
        return np.where(np.isnan(leg), np.nan, time - np.array(since))

    def _reached(self) -> Floats:
        return self._progress([float(p.reached) for p in self.trace.progress])

    def _distance_to_go(self) -> Floats:
        waypoints = self.trace.spec.mission.waypoints
        if not waypoints:
            return np.full(len(self.timeline.time), np.nan)
        leg = self._leg()
        unknown = np.isnan(leg)
        index = np.where(unknown, 0.0, leg).astype(np.int64)
        x, y = (np.array([getattr(w, axis) for w in waypoints]) for axis in "xy")
        return np.where(unknown, np.nan, np.hypot(self.x - x[index], self.y - y[index]))

    def _progress(self, values: list[float]) -> Floats:
        stamps = np.array([p.time for p in self.trace.progress], dtype=np.float64)
        return hold(stamps, np.array(values), self.timeline.time)

    def _object_signal(self, name: str) -> Series:
        reference = self._objects[name]
        positions = joint_positions(self.trace, reference.object, self.timeline.time)
        if name.endswith(".distance"):
            foot_x, foot_y = hinge_foot(reference.object, reference.joint, positions)
            return Series(np.hypot(self.x - foot_x, self.y - foot_y))
        return Series(positions[:, reference.object.joints.index(reference.joint)])
