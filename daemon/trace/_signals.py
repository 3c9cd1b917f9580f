"""Everything recorded since the last chunk, and how it becomes blocks of messages.

Signals are judged; plans, particles and costmaps are shown only and thinned as they come.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from daemon.model import ros_messages as ros
from daemon.model.sut import CostmapPicture
from daemon.trace import layouts, messages
from daemon.trace._mcap_writer import MessageBlock, MessageRecords, SampleColumns, encode_block
from daemon.trace._statics import MovingLinks
from daemon.trace.layouts import IntArray, stamps
from grammars.model.geometry import Floats
from grammars.model.grid import OccupancyGrid
from grammars.model.robot import Laser
from grammars.model.scene import Scene

_SECOND: Final = 1_000_000_000

# A plan has hundreds of poses, of each of which rosbags wants a Python object. So the CDR of paths
# and particles is written out here, a header and a table of rows; tests hold it to rosbags.
_HEAD: Final = struct.Struct("<4siIi4sI")
"""Encapsulation, stamp, length and text of the frame, number of rows."""
_ENCAPSULATION: Final = b"\0\1\0\0"
_FRAME: Final = (4, b"map\0")
_STAMPED_POSE: Final = np.dtype([("stamp", "<u8"), ("frame", "V8"), ("pose", "<f8", 7)])
_ALIGNED: Final = _HEAD.size + 16
"""Where the first pose of a path stands: doubles lie at multiples of eight bytes after the four of
the encapsulation, so four of padding precede it. All further rows are aligned by then."""

PARTICLES: Final = "/particlecloud"
COSTMAP: Final = "/move_base/local_costmap/costmap"

PLAN_POINTS: Final = 500
"""A plan of more points is thinned to about as many; navfn puts one every 2.5 cm."""

_LOCAL_PLAN_PERIOD: Final = _SECOND // 5
_STEPS_PER_METRE: Final = 1024.0


def encode_path(now: int, points: Floats) -> bytes:
    """Return a path through ``points`` (n, 2) in map at ``now`` [ns]; all headings are 0.

    Raises ``ValueError`` for any other shape.
    """
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"a plan must have shape (n, 2), not {points.shape}")
    rows = np.zeros(len(points), _STAMPED_POSE)
    rows["stamp"] = stamps(np.array([now]))
    rows["frame"] = struct.pack("<i4s", *_FRAME)
    rows["pose"][:, :2] = points
    rows["pose"][:, 6] = 1.0
    message = _pack_head(now, len(points)) + rows.tobytes()
    return message[:_ALIGNED] + bytes(4 if len(points) else 0) + message[_ALIGNED:]


def decode_path(payload: bytes) -> Floats:
    """Return the points (n, 2) of a path written by :func:`encode_path`.

    Raises ``ValueError`` for a payload of another size than its number of poses takes.
    """
    rows = payload[_HEAD.size : _ALIGNED] + payload[_ALIGNED + 4 :]
    if len(payload) < _HEAD.size or len(rows) % _STAMPED_POSE.itemsize:
        raise ValueError("a path of another size")
    points: Floats = np.frombuffer(rows, _STAMPED_POSE)["pose"][:, :2].copy()
    return points


def _pack_head(now: int, count: int) -> bytes:
    return _HEAD.pack(_ENCAPSULATION, *divmod(now, _SECOND), *_FRAME, count)


class ViewerMessages:
    """Collects messages for viewers; times are simulated ones [ns]."""

    def __init__(self, ids: Mapping[str, int]) -> None:
        self._plan, self._local_plan, self._particles, self._costmap = (
            MessageRecords(ids[topic]) for topic in ("/plan", "/local_plan", PARTICLES, COSTMAP)
        )
        self._due = dict.fromkeys(("plan", "local plan", "particles", "costmap"), 0)
        self._last = b""
        self._waiting: tuple[int, Floats] | None = None

    def plan(self, now: int, points: Floats) -> None:
        """Take a global plan (n, 2); an unchanged one is left out.

        Of plans that change more than once a second the latest is kept until it is time. Raises
        ``ValueError`` for another shape.
        """
        thin = thin_plan(points)
        raw = thin.tobytes()
        if raw == self._last:
            return
        self._last, self._waiting = raw, (now, thin)
        self.flush(now)

    def flush(self, now: int, *, end: bool = False) -> None:
        """Write the plan that waits for its time, if that has come or the recording ends."""
        if self._waiting is not None and (end or now >= self._due["plan"]):
            self._plan.add(self._waiting[0], encode_path(*self._waiting))
            self._waiting, self._due["plan"] = None, now + _SECOND

    def local_plan(self, now: int, points: Floats) -> None:
        """Take a local plan (n, 2); more than five a second are left out."""
        if self._take("local plan", now, _LOCAL_PLAN_PERIOD):
            self._local_plan.add(now, encode_path(now, points))

    def particles(self, now: int, poses: Floats) -> None:
        """Take particles (n, 3); more than one cloud a second is left out."""
        if self._take("particles", now, _SECOND):
            self._particles.add(now, encode_poses(now, poses))

    def costmap(self, now: int, picture: CostmapPicture) -> None:
        """Take a costmap; more than one a second is left out."""
        if self._take("costmap", now, _SECOND):
            grid = ros.occupancy_grid(published_costmap(picture), now, picture.frame)
            self._costmap.add(now, ros.serialize(grid, messages.KINDS[COSTMAP]))

    def _take(self, what: str, now: int, period: int) -> bool:
        due = now >= self._due[what]
        if due:
            self._due[what] = now + period
        return due

    def drain(self) -> list[MessageBlock]:
        """Return what was collected and start anew."""
        kept = (self._plan, self._local_plan, self._particles, self._costmap)
        return [records.drain() for records in kept]


def thin_plan(points: Floats) -> Floats:
    """Round a plan and leave points out evenly, but never the last one."""
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"a plan must have shape (n, 2), not {points.shape}")
    step = -(-len(points) // PLAN_POINTS)
    if step <= 1:
        return _round_coordinates(points)
    return _round_coordinates(np.concatenate([points[:-1:step], points[-1:]]))


def _round_coordinates(values: Floats) -> Floats:
    rounded: Floats = np.rint(np.asarray(values, np.float64) * _STEPS_PER_METRE) / _STEPS_PER_METRE
    return rounded


def encode_poses(now: int, poses: Floats) -> bytes:
    """Return a ``geometry_msgs/PoseArray`` in map at ``now`` [ns], of ``poses`` (n, 3), as CDR.

    Raises ``ValueError`` for another shape and for what is not finite.
    """
    if poses.ndim != 2 or poses.shape[1] != 3 or not np.isfinite(poses).all():
        raise ValueError(f"particles must be finite and of shape (n, 3), not {poses.shape}")
    rows = np.zeros((len(poses), 7))
    rows[:, :2] = poses[:, :2]
    half = 0.5 * poses[:, 2]
    rows[:, 5], rows[:, 6] = np.sin(half), np.cos(half)
    padding = bytes(4 if len(poses) else 0)
    return _pack_head(now, len(poses)) + padding + _round_coordinates(rows).tobytes()


def published_costmap(picture: CostmapPicture) -> OccupancyGrid:
    """Return a costmap as costmap_2d publishes it: 0 free, 1 to 98, 99 inscribed, 100 lethal, -1.

    Source: the cost translation table of ``costmap_2d::Costmap2DPublisher``.
    """
    cells = picture.cells
    if cells.ndim != 2 or cells.dtype != np.uint8:
        raise ValueError(f"a costmap must be uint8 of two dimensions, not {cells.dtype}")
    return OccupancyGrid(picture.resolution, picture.x, picture.y, _cost_translation()[cells])


def _cost_translation() -> npt.NDArray[np.int8]:
    costs = np.arange(256)
    # Its loop in integer arithmetic: 1 + (97 * (cost - 1)) / 251 for costs of 1 to 252.
    table = (1 + 97 * (costs - 1) // 251).astype(np.int16)
    table[[0, 253, 254, 255]] = 0, 99, 100, -1
    return table.astype(np.int8)


HEARTBEAT: Final = 1_000_000_000
"""Longest time [ns] for which a repeated joint state is left out. Doors rest most of the time, and
the states of 20 doors take 436 bytes, 20 times a second; a viewer that jumps into the file must
still find one near."""

DOOR_PERIOD: Final = 100_000_000
"""Shortest time [ns] between two messages with the frames of doors: enough for eyes; what is judged
comes from the joint states, which have every sample."""

POSE: Final = ("x", "y", "qz", "qw")
TWIST: Final = ("vx", "vy", "wz")
COVARIANCE: Final = tuple(f"c{i}" for i in range(9))


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


class _ScanBuffer:
    """Collects the scans of one laser."""

    __slots__ = ("_laser", "_ranges", "_times")

    def __init__(self, laser: Laser) -> None:
        self._laser = laser
        self._times: list[int] = []
        self._ranges: list[bytes] = []

    def add(self, time: int, ranges: npt.NDArray[np.float32]) -> None:
        """Take a scan; raises ``ValueError`` for other than float32 of shape (rays,)."""
        if ranges.shape != (self._laser.rays,) or ranges.dtype != np.float32:
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
        self.truth = SampleColumns(POSE + TWIST)
        self.odometry = SampleColumns(POSE + TWIST)
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
            encode_block(layouts.contact(*pair), ids["/contacts"], *columns.drain())
            for pair, columns in self.contacts.items()
        ]
        self.contacts.clear()
        return [
            encode_block(
                layouts.odometry("/ground_truth", "map"), ids["/ground_truth"], *self.truth.drain()
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
        odometry: tuple[IntArray, dict[str, npt.NDArray[Any]]],
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


def _as_first_transform(
    times: IntArray, columns: dict[str, npt.NDArray[Any]]
) -> tuple[IntArray, dict[str, npt.NDArray[Any]]]:
    """Name the columns as the first transform of a message does."""
    return times, {f"{name}0": column for name, column in columns.items()}
