"""Everything recorded since the last chunk, and how it becomes blocks of messages."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from daemon.trace import layouts
from daemon.trace.columns import Columns, Records, block
from daemon.trace.container import Block
from daemon.trace.joints import JointSamples
from daemon.trace.kinematics import MovingLinks
from daemon.trace.layout import Ints
from daemon.trace.views import Views
from grammars.robot import Laser
from grammars.scene import Scene
from grammars.values import Floats

DOOR_PERIOD: Final = 100_000_000
"""Shortest time [ns] between two messages with the frames of doors."""

POSE: Final = ("x", "y", "qz", "qw")
TWIST: Final = ("vx", "vy", "wz")
COVARIANCE: Final = tuple(f"c{i}" for i in range(9))


class Signals:
    """The collected samples of every topic; ``ids`` are the channel ids of the topics."""

    def __init__(self, scene: Scene, laser: Laser, ids: Mapping[str, int]) -> None:
        self._ids = ids
        self._laser = laser
        self._joint_names = scene.joint_names
        self.moving = MovingLinks.of(scene)
        self._door_due = 0
        self.clock = Columns(())
        self.truth = Columns(POSE + TWIST)
        self.odometry = Columns(POSE + TWIST)
        self.command = Columns(TWIST)
        self.estimate = Columns(POSE + COVARIANCE)
        self.cloud = Columns((*POSE, *COVARIANCE, "count"))
        self.correction = Columns(POSE)
        self.joints = JointSamples(len(scene.joint_names))
        self.scan_times: list[int] = []
        self.scan_ranges: list[bytes] = []
        self.contacts: dict[tuple[str, str], Columns] = {}
        self.events = Records(ids["/events"])
        self.status = Records(ids["/mission/status"])
        self.goal = Records(ids["/mission/goal"])
        self.views = Views(ids)

    def take(self) -> tuple[list[Block], list[Block]]:
        """Return what is judged and what is only looked at, and start anew."""
        odometry, joints = self.odometry.take(), self.joints.take()
        return self._judged(odometry, joints), self._watched(odometry, joints)

    def _judged(
        self, odometry: tuple[Ints, dict[str, npt.NDArray[Any]]], joints: tuple[Ints, Floats]
    ) -> list[Block]:
        ids, cloud = self._ids, self.cloud.take()
        contacts = [
            block(layouts.contact(*pair), ids["/contacts"], *columns.take())
            for pair, columns in self.contacts.items()
        ]
        self.contacts.clear()
        return [
            block(
                layouts.odometry("/ground_truth", "map"), ids["/ground_truth"], *self.truth.take()
            ),
            block(layouts.odometry("/odom", "odom"), ids["/odom"], *odometry),
            *self._joint_blocks(*joints),
            block(layouts.command(), ids["/cmd_vel"], *self.command.take()),
            block(layouts.estimate("/pose"), ids["/pose"], *self.estimate.take()),
            block(
                layouts.estimate("/particle_cloud/summary"), ids["/particle_cloud/summary"], *cloud
            ),
            block(layouts.count(), ids["/particle_cloud/count"], *cloud),
            *contacts,
            self.status.take(),
            self.goal.take(),
            self.events.take(),
        ]

    def _watched(
        self, odometry: tuple[Ints, dict[str, npt.NDArray[Any]]], joints: tuple[Ints, Floats]
    ) -> list[Block]:
        ids, tf = self._ids, self._ids["/tf"]
        to_odom = layouts.transforms((("map", "odom"),))
        to_base = layouts.transforms((("odom", "base_link"),))
        return [
            block(layouts.clock(), ids["/clock"], *self.clock.take()),
            block(to_odom, tf, *_numbered(*self.correction.take())),
            block(to_base, tf, *_numbered(*odometry)),
            *self._door_blocks(*joints),
            self._scan_block(),
            *self.views.take(),
        ]

    def _joint_blocks(self, times: Ints, states: Floats) -> list[Block]:
        names = self._joint_names
        if not len(times):
            return []
        columns = {"position": states[:, : len(names)], "velocity": states[:, len(names) :]}
        return [block(layouts.joints(names), self._ids["/joint_states"], times, columns)]

    def _door_blocks(self, times: Ints, states: Floats) -> list[Block]:
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
        return [block(layout, self._ids["/tf"], times[rows], columns)]

    def _scan_block(self) -> Block:
        times = np.array(self.scan_times, np.int64)
        ranges = np.frombuffer(b"".join(self.scan_ranges), np.float32)
        self.scan_times.clear()
        self.scan_ranges.clear()
        columns = {"ranges": ranges.reshape(len(times), self._laser.rays)}
        return block(layouts.scan(self._laser), self._ids["/scan"], times, columns)


def _numbered(
    times: Ints, columns: dict[str, npt.NDArray[Any]]
) -> tuple[Ints, dict[str, npt.NDArray[Any]]]:
    """Name the columns as the first transform of a message does."""
    return times, {f"{name}0": column for name, column in columns.items()}
