"""Signals of a run: buffers of samples, and their messages.

Each signal has its own buffer, so that a chunk is encoded column by column (see
:mod:`daemon.trace.layouts`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.trace import layouts
from daemon.trace._statics import MovingLinks
from daemon.trace.layouts import IntArray, MessageLayout
from daemon.trace.messages import scan_topic
from grammars.model.geometry import Floats
from grammars.model.robot import Laser, Robot
from grammars.model.scene import Scene

HEARTBEAT: Final = 1_000_000_000
"""Longest time [ns] without a joint state while it repeats. Doors rest most of the time, and the
states of 20 doors take 436 bytes, 20 times a second; a viewer that jumps into the file still needs
one close by."""

DOOR_PERIOD: Final = 100_000_000
"""Shortest time [ns] between two messages with the frames of doors, enough for viewers. Judges use
the joint states, which have every sample."""

POSE: Final = ("x", "y", "qz", "qw")
TWIST: Final = ("vx", "vy", "wz")
MOTION: Final = ("x", "y", "yaw", *TWIST)
BELIEF: Final = (*POSE, *(f"c{i}" for i in range(9)))
"""Pose and row-major (3, 3) covariance over x, y, yaw."""

_FLOAT32: Final = np.dtype(np.float32)

Columns: TypeAlias = dict[str, npt.NDArray[Any]]
"""A column (n, ...) for every variable field of a message."""


class SampledSignal(ABC):
    """Samples of one signal since the last chunk; each makes one message of every layout.

    Times are simulated times [ns].
    """

    __slots__ = ("_times", "_values", "layouts", "topics")

    def __init__(self, *message_layouts: MessageLayout) -> None:
        self.layouts = message_layouts
        self.topics = frozenset(layout.topic for layout in message_layouts)
        # Lists and not ``array``: to extend a list by seven floats takes 27 ns, and 8 ns each for
        # the columns; to extend an ``array`` takes 350 ns.
        self._times: list[int] = []
        self._values: list[Any] = []

    @abstractmethod
    def add(self, time: int, values: Sequence[Any]) -> None:
        """Append a sample; raises ``ValueError`` for values of a wrong shape."""

    @abstractmethod
    def _columns(self, times: list[int], values: list[Any]) -> Columns:
        """Return the columns of samples."""

    def peek(self) -> tuple[IntArray, Columns]:
        """Return times (n,) and columns of the samples including the last one, and keep them."""
        return np.array(self._times, np.int64), self._columns(self._times, self._values)

    def keep_last(self) -> None:
        """Add the last sample to the buffer if it was left out as a repetition."""
        return

    def messages(self) -> Iterator[tuple[MessageLayout, IntArray, Columns]]:
        """Yield layout, times (n,) and columns of the messages, and empty the buffer."""
        times, columns = self.drain()
        for layout in self.layouts:
            yield layout, times, columns

    def drain(self) -> tuple[IntArray, Columns]:
        """Return times (n,) and columns, and empty the buffer."""
        times, values = self._times, self._values
        self._times, self._values = [], []
        return np.array(times, np.int64), self._columns(times, values)


class SampleColumns(SampledSignal):
    """Samples of a fixed number of floats each; the columns have the quaternion of a yaw, too.

    :meth:`add` takes a fraction of a microsecond, because the columns are made later.
    """

    __slots__ = ("_names",)

    def __init__(self, names: tuple[str, ...], *message_layouts: MessageLayout) -> None:
        super().__init__(*message_layouts)
        self._names = names

    def add(self, time: int, values: Sequence[float]) -> None:
        """Append a sample; ``values`` in the order of the names."""
        self._times.append(time)
        self._values.extend(values)

    def _columns(self, times: list[int], values: list[float]) -> Columns:
        table = np.fromiter(values, np.float64, len(values)).reshape(len(times), len(self._names))
        columns: Columns = {name: table[:, i] for i, name in enumerate(self._names)}
        if "yaw" in columns:
            columns |= _quaternions(columns["yaw"])
        return columns


class JointSamples(SampledSignal):
    """Joint states, and at most ten times a second the frames of the links that joints move.

    A state is kept if it differs from the previous one, and once a second. The last of a row of
    equal states is kept, too, so that linear interpolation gives all states that were left out.
    """

    __slots__ = (
        "_due", "_frames", "_frames_due", "_held", "_joints", "_last", "_links", "_repeated",
    )  # fmt: skip

    def __init__(self, scene: Scene) -> None:
        names = scene.joint_names
        super().__init__(layouts.joints(names))
        self.topics |= {"/tf"}
        self._links, self._frames_due = MovingLinks.of(scene), 0
        self._frames = layouts.transforms(tuple(("map", name) for name in self._links.names))
        self._joints = len(names)
        self._last, self._held, self._due = b"", -1, 0
        self._repeated: tuple[Floats, Floats] | None = None

    def add(self, time: int, values: Sequence[Floats]) -> None:
        """Append positions and velocities; raises ``ValueError`` unless one float64 per joint.

        While joints rest, the same two read-only arrays are accepted without a comparison.
        """
        positions, velocities = values
        same = self._repeated
        if same and positions is same[0] and velocities is same[1] and time < self._due:
            self._held = time
            return
        # As bytes, in which nan equals itself.
        state = positions.tobytes() + velocities.tobytes()
        if not state and not self._joints:
            return
        if state == self._last and time < self._due:
            self._held = time
            if not (positions.flags.writeable or velocities.flags.writeable):
                self._repeated = positions, velocities
            return
        if len(state) != 16 * self._joints:
            raise ValueError(f"joint states must have {self._joints} positions and velocities")
        self.keep_last()
        self._times.append(time)
        self._values.append(state)
        if state != self._last:
            self._repeated = None
        self._last, self._due = state, time + HEARTBEAT

    def keep_last(self) -> None:
        """Add the last repetition, before a different state or at the end."""
        if self._held >= 0:
            self._times.append(self._held)
            self._values.append(self._last)
            self._held = -1

    def peek(self) -> tuple[IntArray, Columns]:
        """Return times (n,) and columns (n, joints) with the last repetition, and keep them."""
        if self._held < 0:
            return super().peek()
        times, values = [*self._times, self._held], [*self._values, self._last]
        return np.array(times, np.int64), self._columns(times, values)

    def messages(self) -> Iterator[tuple[MessageLayout, IntArray, Columns]]:
        """Yield the joint states, then the frames, and empty the buffer."""
        times, columns = self.drain()
        yield self.layouts[0], times, columns
        rows = []
        for row, now in enumerate(times.tolist()):
            if now >= self._frames_due:
                rows.append(row)
                self._frames_due = now + DOOR_PERIOD
        if rows and self._links.names:
            poses = self._links.poses(columns["position"][rows])
            frames = {
                layouts.numbered(name, i): poses[:, i, j]
                for i in range(len(self._links.names))
                for j, name in enumerate(POSE)
            }
            yield self._frames, times[rows], frames

    def _columns(self, times: list[int], values: list[bytes]) -> Columns:
        table = np.frombuffer(b"".join(values), np.float64).reshape(len(times), 2 * self._joints)
        return {"position": table[:, : self._joints], "velocity": table[:, self._joints :]}


class LaserScans(SampledSignal):
    """Scans of one laser."""

    __slots__ = ("_rays",)

    def __init__(self, laser: Laser) -> None:
        super().__init__(layouts.scan(laser))
        self._rays = laser.rays

    def add(self, time: int, values: Sequence[npt.NDArray[np.float32]]) -> None:
        """Append a scan; raises ``ValueError`` for other than float32 of shape (rays,)."""
        (ranges,) = values
        if ranges.shape != (self._rays,) or ranges.dtype != _FLOAT32:
            raise ValueError(f"ranges must be float32 of shape ({self._rays},)")
        self._times.append(time)
        self._values.append(ranges.tobytes())

    def _columns(self, times: list[int], values: list[bytes]) -> Columns:
        ranges = np.frombuffer(b"".join(values), np.float32)
        return {"ranges": ranges.reshape(len(times), self._rays)}


def common_signals() -> dict[str, SampledSignal]:
    """Return the signals that are the same in every run, by topic.

    Several signals share ``/tf``; its messages of one instant are in the order of this table.
    """
    summary = layouts.estimate("/particle_cloud/summary")
    to_base = layouts.transforms((("odom", "base_link"),))
    return {
        "/clock": SampleColumns((), layouts.clock()),
        "/tf": SampleColumns(POSE, layouts.transforms((("map", "odom"),))),
        # odom -> base_link has the columns of the odometry, so the two always agree.
        "/odom": SampleColumns(MOTION, layouts.odometry("/odom", "odom"), to_base),
        "/ground_truth": SampleColumns(MOTION, layouts.odometry("/ground_truth", "map")),
        "/cmd_vel": SampleColumns(TWIST, layouts.command()),
        "/pose": SampleColumns(BELIEF, layouts.estimate("/pose")),
        "/particle_cloud/summary": SampleColumns((*BELIEF, "count"), summary, layouts.count()),
        "/sut/latency": SampleColumns(("seconds",), layouts.latency()),
    }


def run_signals(robot: Robot, scene: Scene) -> dict[str, SampledSignal]:
    """Return the signals of a run except its contacts, by topic."""
    return {
        **common_signals(),
        "/joint_states": JointSamples(scene),
        **{scan_topic(laser): LaserScans(laser) for laser in robot.lasers},
    }


def contact_signal(first: str, second: str) -> SampledSignal:
    """Return the signal of contacts between two named bodies."""
    return SampleColumns(("px", "py", "nx", "ny", "depth"), layouts.contact(first, second))


def _quaternions(yaw: Floats) -> Columns:
    """Return z and w of the quaternions of yaws (n,), equal to :func:`ros.yaw_quaternion`."""
    halves = yaw * 0.5
    halves[np.isinf(halves)] = math.nan
    values = halves.tolist()
    return {
        name: np.fromiter(map(function, values), np.float64, len(values))
        for name, function in (("qz", math.sin), ("qw", math.cos))
    }
