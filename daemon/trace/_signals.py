"""Everything recorded since the last chunk, and how it becomes blocks of messages.

Signals are judged; what is shown only is in :mod:`daemon.trace._views`.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.trace import layouts, messages
from daemon.trace._blocks import MessageBlock, MessageRecords, SampleColumns, encode_block
from daemon.trace._statics import MovingLinks
from daemon.trace._views import ViewerMessages
from daemon.trace.layouts import IntArray
from grammars.model.geometry import Floats
from grammars.model.robot import Laser
from grammars.model.scene import Scene

HEARTBEAT: Final = 1_000_000_000
"""Longest time [ns] for which a repeated joint state is left out. Doors rest most of the time, and
the states of 20 doors take 436 bytes, 20 times a second; a viewer that jumps into the file must
still find one near."""

DOOR_PERIOD: Final = 100_000_000
"""Shortest time [ns] between two messages with the frames of doors: enough for eyes; what is judged
comes from the joint states, which have every sample."""

POSE: Final = ("x", "y", "qz", "qw")
PLANAR_POSE: Final = ("x", "y", "yaw")
TWIST: Final = ("vx", "vy", "wz")
COVARIANCE: Final = tuple(f"c{i}" for i in range(9))


Columns: TypeAlias = tuple[IntArray, dict[str, npt.NDArray[Any]]]
"""Times (n,) [ns] and the column (n,) of every field that varies."""

_FLOAT32: Final = np.dtype(np.float32)
_JUDGED_BUFFERS: Final = (
    "truth", "odometry", "command", "estimate", "cloud", "latency", "events", "status", "goal",
)  # fmt: skip


class JointSamples:
    """Keeps a joint state when it differs from the one before, and once a second.

    The last of a row of equal states is kept too, so that linear interpolation between the kept
    ones gives back every one that was left out.
    """

    __slots__ = ("_due", "_held", "_last", "_repeated", "_states", "_times", "_width")

    def __init__(self, joints: int) -> None:
        self._width = 2 * joints
        self._times: list[int] = []
        self._states: list[bytes] = []
        self._last, self._held, self._due = b"", -1, 0
        self._repeated: tuple[Floats, Floats] | None = None

    def add(self, time: int, positions: Floats, velocities: Floats) -> None:
        """Take a state; raises ``ValueError`` when it is not one float64 per joint, twice.

        While joints rest, the same two arrays again, if read-only, are not looked into.
        """
        same = self._repeated
        if same and positions is same[0] and velocities is same[1] and time < self._due:
            self._held = time
            return
        # By bytes: there nan equals itself.
        state = positions.tobytes() + velocities.tobytes()
        if not state and not self._width:
            return
        if state == self._last and time < self._due:
            self._held = time
            if not (positions.flags.writeable or velocities.flags.writeable):
                self._repeated = positions, velocities
            return
        if len(state) != 8 * self._width:
            raise ValueError(f"joint states must have {self._width // 2} positions and velocities")
        self.keep_last_repeat()
        self._times.append(time)
        self._states.append(state)
        if state != self._last:
            self._repeated = None
        self._last, self._due = state, time + HEARTBEAT

    def keep_last_repeat(self) -> None:
        """Keep the last repetition, because something else follows (or nothing any more)."""
        if self._held >= 0:
            self._times.append(self._held)
            self._states.append(self._last)
            self._held = -1

    def peek(self) -> tuple[IntArray, Floats]:
        """Return what :meth:`drain` would if this were the end, and keep it."""
        other = copy.copy(self)
        other._times, other._states = [*self._times], [*self._states]
        other.keep_last_repeat()
        return other.drain()

    def drain(self) -> tuple[IntArray, Floats]:
        """Return times (n,) and states (n, 2 k), positions first, and start anew."""
        times = np.array(self._times, np.int64)
        states = np.frombuffer(b"".join(self._states), np.float64)
        self._times, self._states = [], []
        return times, states.reshape(len(times), self._width)


class _ScanBuffer:
    """Collects the scans of one laser."""

    __slots__ = ("_laser", "_ranges", "_times")

    def __init__(self, laser: Laser) -> None:
        self._laser = laser
        self._times: list[int] = []
        self._ranges: list[bytes] = []

    def add(self, time: int, ranges: npt.NDArray[np.float32]) -> None:
        """Take a scan; raises ``ValueError`` for other than float32 of shape (rays,)."""
        if ranges.shape != (self._laser.rays,) or ranges.dtype != _FLOAT32:
            raise ValueError(f"ranges must be float32 of shape ({self._laser.rays},)")
        self._times.append(time)
        self._ranges.append(ranges.tobytes())

    def drain(self, ids: Mapping[str, int]) -> MessageBlock:
        """Return what was collected and start anew."""
        times = np.array(self._times, np.int64)
        ranges = np.frombuffer(b"".join(self._ranges), np.float32)
        self._times, self._ranges = [], []
        columns = {"ranges": ranges.reshape(len(times), self._laser.rays)}
        channel = ids[messages.scan_topic(self._laser)]
        return encode_block(layouts.scan(self._laser), channel, times, columns)


class SignalBuffers:
    """The collected samples of every topic; ``ids`` are the channel ids of the topics.

    One buffer per topic and not one list of messages: a chunk is then encoded column by column,
    see :mod:`daemon.trace.layouts`.
    """

    def __init__(self, scene: Scene, lasers: Sequence[Laser], ids: Mapping[str, int]) -> None:
        self._ids = ids
        self.scans = {laser.name: _ScanBuffer(laser) for laser in lasers}
        self._joint_names = scene.joint_names
        self.moving = MovingLinks.of(scene)
        self._door_due = 0
        self.clock = SampleColumns(())
        self.truth = SampleColumns(PLANAR_POSE + TWIST)
        self.odometry = SampleColumns(PLANAR_POSE + TWIST)
        self.command = SampleColumns(TWIST)
        self.estimate = SampleColumns(POSE + COVARIANCE)
        self.cloud = SampleColumns((*POSE, *COVARIANCE, "count"))
        self.correction = SampleColumns(POSE)
        self.latency = SampleColumns(("seconds",))
        self.joints = JointSamples(len(scene.joint_names))
        self.contacts: dict[tuple[str, str], SampleColumns] = {}
        self.events = MessageRecords(ids["/events"])
        self.status = MessageRecords(ids["/mission/status"])
        self.goal = MessageRecords(ids["/mission/goal"])
        self.views = ViewerMessages(ids)

    def drain(self) -> list[MessageBlock]:
        """Return everything as blocks and start anew."""
        # Drained once and used twice: odometry also becomes odom -> base_link, joints the frames
        # of doors. These copies are not recorded separately, so they can never disagree.
        odometry, joints = _with_quaternion(*self.odometry.drain()), self.joints.drain()
        return [*self._judged(odometry, joints), *self._watched(odometry, joints)]

    def peek_judged(self) -> list[MessageBlock]:
        """Return what is judged as it would be if this were the end, and keep it."""
        # Draining gives a buffer new lists; those of a shallow copy leave the original as it is.
        other = copy.copy(self)
        for name in _JUDGED_BUFFERS:
            setattr(other, name, copy.copy(getattr(self, name)))
        other.contacts = {pair: copy.copy(columns) for pair, columns in self.contacts.items()}
        return other._judged(_with_quaternion(*other.odometry.drain()), self.joints.peek())

    def _judged(
        self,
        odometry: Columns,
        joints: tuple[IntArray, Floats],
    ) -> list[MessageBlock]:
        ids, cloud = self._ids, self.cloud.drain()
        contacts = [
            encode_block(layouts.contact(*pair), ids["/contacts"], *columns.drain())
            for pair, columns in self.contacts.items()
        ]
        self.contacts.clear()
        return [
            encode_block(
                layouts.odometry("/ground_truth", "map"),
                ids["/ground_truth"],
                *_with_quaternion(*self.truth.drain()),
            ),
            encode_block(layouts.odometry("/odom", "odom"), ids["/odom"], *odometry),
            *self._joint_blocks(*joints),
            encode_block(layouts.command(), ids["/cmd_vel"], *self.command.drain()),
            encode_block(layouts.estimate("/pose"), ids["/pose"], *self.estimate.drain()),
            encode_block(
                layouts.estimate("/particle_cloud/summary"), ids["/particle_cloud/summary"], *cloud
            ),
            encode_block(layouts.count(), ids["/particle_cloud/count"], *cloud),
            *contacts,
            encode_block(layouts.latency(), ids["/sut/latency"], *self.latency.drain()),
            self.status.drain(),
            self.goal.drain(),
            self.events.drain(),
        ]

    def _watched(
        self,
        odometry: Columns,
        joints: tuple[IntArray, Floats],
    ) -> list[MessageBlock]:
        ids, tf = self._ids, self._ids["/tf"]
        to_odom = layouts.transforms((("map", "odom"),))
        to_base = layouts.transforms((("odom", "base_link"),))
        return [
            encode_block(layouts.clock(), ids["/clock"], *self.clock.drain()),
            encode_block(to_odom, tf, *_as_first_transform(*self.correction.drain())),
            encode_block(to_base, tf, *_as_first_transform(*odometry)),
            *self._door_blocks(*joints),
            *(scans.drain(ids) for scans in self.scans.values()),
            *self.views.drain(),
        ]

    def _joint_blocks(self, times: IntArray, states: Floats) -> list[MessageBlock]:
        names = self._joint_names
        if not len(times):
            return []
        columns = {"position": states[:, : len(names)], "velocity": states[:, len(names) :]}
        return [encode_block(layouts.joints(names), self._ids["/joint_states"], times, columns)]

    def _door_blocks(self, times: IntArray, states: Floats) -> list[MessageBlock]:
        """Return the frames of all links that joints move, at most ten times a second."""
        rows = []
        for row, now in enumerate(times.tolist()):
            if now >= self._door_due:
                rows.append(row)
                self._door_due = now + DOOR_PERIOD
        names = self.moving.names
        if not rows or not names:
            return []
        poses = self.moving.poses(states[rows, : len(self._joint_names)])
        columns = {
            f"{name}{i}": poses[:, i, j] for i in range(len(names)) for j, name in enumerate(POSE)
        }
        layout = layouts.transforms(tuple(("map", name) for name in names))
        return [encode_block(layout, self._ids["/tf"], times[rows], columns)]


def _with_quaternion(times: IntArray, columns: dict[str, npt.NDArray[Any]]) -> Columns:
    """Add z and w of the quaternion of the yaw, as :func:`ros.yaw_quaternion` gives them."""
    halves = columns["yaw"] * 0.5
    halves[np.isinf(halves)] = math.nan
    for name, function in (("qz", math.sin), ("qw", math.cos)):
        columns[name] = np.fromiter(map(function, halves.tolist()), np.float64, len(times))
    return times, columns


def _as_first_transform(times: IntArray, columns: dict[str, npt.NDArray[Any]]) -> Columns:
    """Name the columns as the first transform of a message does."""
    return times, {f"{name}0": column for name, column in columns.items()}
