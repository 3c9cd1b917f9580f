"""Everything recorded since the last chunk, and how it becomes blocks of messages.

Joint states are kept without their repetitions.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from daemon.trace import _layouts
from daemon.trace._layouts import IntArray
from daemon.trace._mcap_writer import MessageBlock, MessageRecords, SampleColumns, encode_block
from daemon.trace._statics import MovingLinks
from daemon.trace._views import ViewerMessages
from grammars.model.geometry import Floats
from grammars.model.robot import Laser
from grammars.model.scene import Scene

HEARTBEAT: Final = 1_000_000_000
"""Longest time [ns] for which a repeated joint state is left out. Doors rest most of the time, and
the states of 20 doors take 436 bytes, 20 times a second; a viewer that jumps into the file must
still find one near."""


class JointSamples:
    """Keeps a joint state when it differs from the one before, and once a second.

    The last of a row of equal states is kept too, so that linear interpolation between the kept
    ones gives back every one that was left out.
    """

    __slots__ = ("_due", "_held", "_last", "_states", "_times", "_width")

    def __init__(self, joints: int) -> None:
        self._width = 2 * joints
        self._times: list[int] = []
        self._states: list[bytes] = []
        self._last, self._held, self._due = b"", -1, 0

    def add(self, time: int, positions: Floats, velocities: Floats) -> None:
        """Take a state; raises ``ValueError`` when it is not one float64 per joint, twice."""
        # By bytes: there nan equals itself.
        state = positions.tobytes() + velocities.tobytes()
        if not state and not self._width:
            return
        if state == self._last and time < self._due:
            self._held = time
            return
        if len(state) != 8 * self._width:
            raise ValueError(f"joint states must have {self._width // 2} positions and velocities")
        self.keep_last_repeat()
        self._times.append(time)
        self._states.append(state)
        self._last, self._due = state, time + HEARTBEAT

    def keep_last_repeat(self) -> None:
        """Keep the last repetition, because something else follows (or nothing any more)."""
        if self._held >= 0:
            self._times.append(self._held)
            self._states.append(self._last)
            self._held = -1

    def drain(self) -> tuple[IntArray, Floats]:
        """Return times (n,) and states (n, 2 k), positions first, and start anew."""
        times = np.array(self._times, np.int64)
        states = np.frombuffer(b"".join(self._states), np.float64)
        self._times, self._states = [], []
        return times, states.reshape(len(times), self._width)


DOOR_PERIOD: Final = 100_000_000
"""Shortest time [ns] between two messages with the frames of doors: enough for eyes; what is judged
comes from the joint states, which have every sample."""

POSE: Final = ("x", "y", "qz", "qw")
TWIST: Final = ("vx", "vy", "wz")
COVARIANCE: Final = tuple(f"c{i}" for i in range(9))


class SignalBuffers:
    """The collected samples of every topic; ``ids`` are the channel ids of the topics.

    One buffer per topic and not one list of messages: a chunk is then encoded column by column,
    see :mod:`daemon.trace._layouts`.
    """

    def __init__(self, scene: Scene, laser: Laser, ids: Mapping[str, int]) -> None:
        self._ids = ids
        self._laser = laser
        self._joint_names = scene.joint_names
        self.moving = MovingLinks.of(scene)
        self._door_due = 0
        self.clock = SampleColumns(())
        self.truth = SampleColumns(POSE + TWIST)
        self.odometry = SampleColumns(POSE + TWIST)
        self.command = SampleColumns(TWIST)
        self.estimate = SampleColumns(POSE + COVARIANCE)
        self.cloud = SampleColumns((*POSE, *COVARIANCE, "count"))
        self.correction = SampleColumns(POSE)
        self.joints = JointSamples(len(scene.joint_names))
        self.scan_times: list[int] = []
        self.scan_ranges: list[bytes] = []
        self.contacts: dict[tuple[str, str], SampleColumns] = {}
        self.events = MessageRecords(ids["/events"])
        self.status = MessageRecords(ids["/mission/status"])
        self.goal = MessageRecords(ids["/mission/goal"])
        self.views = ViewerMessages(ids)

    def drain(self) -> tuple[list[MessageBlock], list[MessageBlock]]:
        """Return what is judged and what is only looked at, and start anew."""
        # Drained once and used twice: odometry also becomes odom -> base_link, joints the frames
        # of doors. These copies are not recorded separately, so they can never disagree.
        odometry, joints = self.odometry.drain(), self.joints.drain()
        return self._judged(odometry, joints), self._watched(odometry, joints)

    def _judged(
        self,
        odometry: tuple[IntArray, dict[str, npt.NDArray[Any]]],
        joints: tuple[IntArray, Floats],
    ) -> list[MessageBlock]:
        ids, cloud = self._ids, self.cloud.drain()
        contacts = [
            encode_block(_layouts.contact(*pair), ids["/contacts"], *columns.drain())
            for pair, columns in self.contacts.items()
        ]
        self.contacts.clear()
        return [
            encode_block(
                _layouts.odometry("/ground_truth", "map"), ids["/ground_truth"], *self.truth.drain()
            ),
            encode_block(_layouts.odometry("/odom", "odom"), ids["/odom"], *odometry),
            *self._joint_blocks(*joints),
            encode_block(_layouts.command(), ids["/cmd_vel"], *self.command.drain()),
            encode_block(_layouts.estimate("/pose"), ids["/pose"], *self.estimate.drain()),
            encode_block(
                _layouts.estimate("/particle_cloud/summary"), ids["/particle_cloud/summary"], *cloud
            ),
            encode_block(_layouts.count(), ids["/particle_cloud/count"], *cloud),
            *contacts,
            self.status.drain(),
            self.goal.drain(),
            self.events.drain(),
        ]

    def _watched(
        self,
        odometry: tuple[IntArray, dict[str, npt.NDArray[Any]]],
        joints: tuple[IntArray, Floats],
    ) -> list[MessageBlock]:
        ids, tf = self._ids, self._ids["/tf"]
        to_odom = _layouts.transforms((("map", "odom"),))
        to_base = _layouts.transforms((("odom", "base_link"),))
        return [
            encode_block(_layouts.clock(), ids["/clock"], *self.clock.drain()),
            encode_block(to_odom, tf, *_as_first_transform(*self.correction.drain())),
            encode_block(to_base, tf, *_as_first_transform(*odometry)),
            *self._door_blocks(*joints),
            self._scan_block(),
            *self.views.drain(),
        ]

    def _joint_blocks(self, times: IntArray, states: Floats) -> list[MessageBlock]:
        names = self._joint_names
        if not len(times):
            return []
        columns = {"position": states[:, : len(names)], "velocity": states[:, len(names) :]}
        return [encode_block(_layouts.joints(names), self._ids["/joint_states"], times, columns)]

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
        layout = _layouts.transforms(tuple(("map", name) for name in names))
        return [encode_block(layout, self._ids["/tf"], times[rows], columns)]

    def _scan_block(self) -> MessageBlock:
        times = np.array(self.scan_times, np.int64)
        ranges = np.frombuffer(b"".join(self.scan_ranges), np.float32)
        self.scan_times.clear()
        self.scan_ranges.clear()
        columns = {"ranges": ranges.reshape(len(times), self._laser.rays)}
        return encode_block(_layouts.scan(self._laser), self._ids["/scan"], times, columns)


def _as_first_transform(
    times: IntArray, columns: dict[str, npt.NDArray[Any]]
) -> tuple[IntArray, dict[str, npt.NDArray[Any]]]:
    """Name the columns as the first transform of a message does."""
    return times, {f"{name}0": column for name, column in columns.items()}
