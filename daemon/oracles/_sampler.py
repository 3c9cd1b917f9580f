"""Signals of a trace, sampled on its time base when an oracle asks for them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from daemon.oracles._clearance import Obstacles, clearance, footprint_box, obstacles_of
from daemon.oracles._links import hinge_foot, joint_positions
from daemon.oracles._localisation import Localisation
from daemon.oracles._series import Codes, Series
from daemon.oracles._timeline import hold, timeline_of
from grammars.oracle import Number, Signal, object_signals
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
        self._cache: dict[tuple[str, tuple[float, ...]], Series] = {}
        self._objects = object_signals(trace.scene)
        self._localisation = Localisation(trace, self.timeline.time)

    def sample(self, signal: Signal) -> Series:
        """Return ``signal`` on the time base; it must have passed the static checks."""
        arguments = tuple(a.value for a in signal.arguments if isinstance(a, Number))
        key = (signal.name, arguments)
        if key not in self._cache:
            self._cache[key] = self._compute(signal.name, arguments)
        return self._cache[key]

    def _compute(self, name: str, arguments: tuple[float, ...]) -> Series:
        if name in self._objects:
            return self._object_signal(name)
        if name.startswith("loc."):
            return self._localisation.sample(name)
        if name == "clearance":
            return self._clearance(arguments)
        plain: dict[str, Callable[[], Series]] = {
            "contact": self._contact,
            "contact.depth": self._contact_depth,
            "speed": self._speed,
            "speed.angular": self._angular_speed,
            "path.length": self._path_length,
            "elapsed": lambda: Series(self.timeline.time - self.timeline.start),
            "mission.leg": self._leg,
            "mission.reached": self._reached,
        }
        return plain[name]()

    def _clearance(self, arguments: tuple[float, ...]) -> Series:
        if arguments:
            centre, half = (0.0, 0.0), (arguments[0], arguments[1])
        else:
            centre, half = footprint_box(self.trace.spec.robot.footprint)
        return clearance(self._obstacles, self.poses, centre=centre, half=half)

    def _contact(self) -> Series:
        _, objects, names = self._contacts
        return Series((objects >= 0).astype(np.float64), objects, names)

    def _contact_depth(self) -> Series:
        depth, objects, names = self._contacts
        return Series(depth, objects, names)

    @functools.cached_property
    def _obstacles(self) -> Obstacles:
        return obstacles_of(self.trace, self.timeline.time)

    @functools.cached_property
    def _contacts(self) -> tuple[Floats, Codes, tuple[str, ...]]:
        """Deepest contact of the robot per sample, since the previous sample, and with what."""
        time = self.timeline.time
        depth = np.zeros(len(time))
        objects = np.full(len(time), -1, dtype=np.int32)
        names: dict[str, int] = {}
        for record in self.trace.contacts:
            if ROBOT not in (record.first, record.second):
                continue
            other = record.second if record.first == ROBOT else record.first
            index = int(np.searchsorted(time, record.time - 1e-9))
            if index < len(time) and (objects[index] < 0 or record.depth > depth[index]):
                depth[index] = max(depth[index], record.depth)
                objects[index] = names.setdefault(other, len(names))
        return depth, objects, tuple(names)

    def _speed(self) -> Series:
        truth, count = self.trace.ground_truth, len(self.timeline.time)
        return Series(np.hypot(truth.vx[:count], truth.vy[:count]))

    def _angular_speed(self) -> Series:
        return Series(np.abs(self.trace.ground_truth.wz[: len(self.timeline.time)]))

    def _path_length(self) -> Series:
        steps = np.hypot(np.diff(self.x, prepend=self.x[:1]), np.diff(self.y, prepend=self.y[:1]))
        return Series(np.cumsum(steps))

    def _leg(self) -> Series:
        last = len(self.trace.spec.mission.waypoints)
        return self._progress([float(min(p.current + 1, last)) for p in self.trace.progress])

    def _reached(self) -> Series:
        return self._progress([float(p.reached) for p in self.trace.progress])

    def _progress(self, values: list[float]) -> Series:
        stamps = np.array([p.time for p in self.trace.progress], dtype=np.float64)
        return Series(hold(stamps, np.array(values), self.timeline.time))

    def _object_signal(self, name: str) -> Series:
        reference = self._objects[name]
        positions = joint_positions(self.trace, reference.object, self.timeline.time)
        if name.endswith(".distance"):
            foot_x, foot_y = hinge_foot(reference.object, reference.joint, positions)
            return Series(np.hypot(self.x - foot_x, self.y - foot_y))
        return Series(positions[:, reference.object.joints.index(reference.joint)])
