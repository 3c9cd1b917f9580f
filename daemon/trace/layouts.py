"""Fixed-size CDR messages as numpy record types, derived from rosbags' own serializer.

A prototype message has unique marker values in the places of the data. rosbags serializes it once,
and the markers show the position of each field. A few numpy assignments then write or read whole
columns of messages, which are equal to those of rosbags byte for byte. The frequent topics have one
prototype each. rosbags takes 5 to 13 us to serialize one of these messages, a template per message
0.6 to 1 us.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from daemon.model import ros_messages as ros
from daemon.model.ros_messages import make, serialize
from grammars.model.robot import Laser

MESSAGE_OPCODE: Final = 0x05
HEADER: Final = struct.Struct("<BQHIQQ")
"""Head of an MCAP message record: opcode, length, channel, sequence, log and publish time."""

_HEADER_FIELDS: Final = {
    "channel": ("<u2", 9),
    "log_time": ("<u8", 15),
    "publish_time": ("<u8", 23),
}

ByteArray = npt.NDArray[np.uint8]
IntArray = npt.NDArray[np.int64]


@dataclass(slots=True)
class FieldMarker:
    """Marker values of a prototype message, with their fields."""

    slots: list[tuple[str, str, tuple[int, ...], bytes]] = field(default_factory=list)

    def stamp(self, name: str = "stamp") -> Any:
        """Mark a ``builtin_interfaces/Time``, stored as one number: sec + nanosec * 2**32."""
        number = len(self.slots)
        sec, nanosec = 0x5A5B0000 + number, 0x3C3D0000 + number
        self.slots.append((name, "<u8", (), struct.pack("<iI", sec, nanosec)))
        return make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)

    def u4(self, name: str) -> int:
        """Mark a uint32."""
        value = 0x6C6D0000 + len(self.slots)
        self.slots.append((name, "<u4", (), struct.pack("<I", value)))
        return value

    def f8(self, name: str) -> float:
        """Mark a float64."""
        return float(self._floats(name, 1, np.float64, ())[0])

    def f8s(self, name: str, count: int) -> npt.NDArray[Any]:
        """Mark ``count`` consecutive float64."""
        return self._floats(name, count, np.float64, (count,))

    def f4s(self, name: str, count: int) -> npt.NDArray[Any]:
        """Mark ``count`` consecutive float32."""
        return self._floats(name, count, np.float32, (count,))

    def _floats(
        self, name: str, count: int, kind: type, shape: tuple[int, ...]
    ) -> npt.NDArray[Any]:
        # Different values within a third of 1, so that no marker reaches the next one.
        steps = np.arange(count) / max(3 * count, 1)
        values: npt.NDArray[Any] = (12345.0 + len(self.slots) + steps).astype(kind)
        self.slots.append((name, "<f8" if kind is np.float64 else "<f4", shape, values.tobytes()))
        return values


@dataclass(frozen=True, slots=True)
class MessageLayout:
    """Fixed-size message on ``topic``; ``record`` is the numpy type of its MCAP record.

    ``template`` has the constant bytes of the record, and ``constant`` their positions as
    (start, stop), for the check of a file.
    """

    topic: str
    record: np.dtype[np.void]
    template: ByteArray
    constant: tuple[tuple[int, int], ...]
    names: tuple[str, ...] = field(init=False)
    """Variable fields of the message, without the header."""
    _constant_bits: ByteArray = field(init=False)
    _packed: np.dtype[np.void] = field(init=False)

    def __post_init__(self) -> None:
        assert self.record.names is not None
        names = tuple(n for n in self.record.names if n not in _HEADER_FIELDS)
        object.__setattr__(self, "names", names)
        # Stamps repeat the times.
        packed_names = ("log_time", *(name for name in names if not name.startswith("stamp")))
        packed = np.dtype([(name, self.record[name]) for name in packed_names])
        object.__setattr__(self, "_packed", packed)
        bits = np.zeros(len(self.template), np.uint8)
        for start, stop in self.constant:
            bits[start:stop] = 0xFF
        object.__setattr__(self, "_constant_bits", bits)

    def encode(
        self, channel: int, times: IntArray, columns: Mapping[str, npt.NDArray[Any]]
    ) -> ByteArray:
        """Return the MCAP message records of a channel, one row of bytes per message.

        ``times`` (n,) is in nanoseconds; ``columns`` has an array (n, ...) per field except
        the stamps, which are the times.
        """
        rows = np.empty((len(times), len(self.template)), np.uint8)
        rows[:] = self.template
        records = rows.view(self.record)[:, 0]
        records["channel"] = channel
        records["log_time"] = times
        records["publish_time"] = times
        now = stamps(times)
        for name in self.names:
            records[name] = now if name.startswith("stamp") else columns[name]
        return rows

    def view(self, rows: ByteArray) -> npt.NDArray[np.void]:
        """Return rows of bytes (n, size) of a file as records (n,)."""
        records: npt.NDArray[np.void] = np.ascontiguousarray(rows).view(self.record)[:, 0]
        return records

    def pack(self, rows: ByteArray) -> npt.NDArray[np.void]:
        """Return a copy (n,) of rows (n, size) with ``log_time`` and the fields except stamps."""
        records = self.view(rows)
        packed = np.empty(len(rows), self._packed)
        for name in self._packed.fields or ():
            packed[name] = records[name]
        return packed

    def fits(self, rows: ByteArray) -> npt.NDArray[np.bool_]:
        """Return True for rows (n, size) with the size and constant bytes of this layout."""
        if rows.shape[1] != len(self.template):
            return np.zeros(len(rows), np.bool_)
        if not len(rows):
            return np.ones(0, np.bool_)
        fits: npt.NDArray[np.bool_] = self._other_bits(rows).max(axis=1) == 0
        return fits

    def fits_all(self, rows: ByteArray) -> bool:
        """Return True if all rows of bytes (n, size) have this layout, see :meth:`fits`."""
        if rows.shape[1] != len(self.template):
            return not len(rows)
        return not len(rows) or not self._other_bits(rows).max()

    def _other_bits(self, rows: ByteArray) -> ByteArray:
        """Return the constant bits of rows (n, size) that differ from the template."""
        # Whole rows at once: 200 rows of 751 bytes took 27 us; only 50 bytes of each took 20 us.
        other: ByteArray = rows ^ self.template
        other &= self._constant_bits
        return other


def stamps(times: IntArray) -> npt.NDArray[np.uint64]:
    """Return nanoseconds as CDR ``Time`` (int32 sec, uint32 nanosec) in one little-endian u64."""
    # One number instead of two fields halves the assignments.
    seconds, rest = np.divmod(times, 1_000_000_000)
    both: npt.NDArray[np.uint64] = (seconds | rest << 32).view(np.uint64)
    return both


def derive_layout(topic: str, kind: str, build: Callable[[FieldMarker], Any]) -> MessageLayout:
    """Derive the layout of the message type ``kind`` from a prototype with markers."""
    mark = FieldMarker()
    payload = serialize(build(mark), kind)
    head = HEADER.pack(MESSAGE_OPCODE, HEADER.size - 9 + len(payload), 0, 0, 0, 0)
    data = head + payload
    fields = {name: (np.dtype(form), at) for name, (form, at) in _HEADER_FIELDS.items()}
    constant = np.ones(len(data), np.bool_)
    # Channel, sequence and both times vary; opcode and length before them are constant.
    constant[9 : HEADER.size] = False
    template = np.frombuffer(data, np.uint8).copy()
    # Zeros in the template, so that no marker gets into a file.
    for name, form, shape, marker in mark.slots:
        at = _find_marker(data, marker)
        fields[name] = (np.dtype((form, shape)), at)
        constant[at : at + len(marker)] = False
        template[at : at + len(marker)] = 0
    record = np.dtype(
        {
            "names": list(fields),
            "formats": [form for form, _ in fields.values()],
            "offsets": [at for _, at in fields.values()],
            "itemsize": len(data),
        }
    )
    edges = np.flatnonzero(np.diff(constant, prepend=False, append=False)).tolist()
    spans = tuple(zip(edges[::2], edges[1::2], strict=True))
    return MessageLayout(topic, record, template, spans)


def _find_marker(data: bytes, marker: bytes) -> int:
    """Return the only position of ``marker``; raises ``AssertionError`` for several or none."""
    if not marker:
        return len(data)
    offset = data.find(marker, HEADER.size)
    if offset < 0 or data.find(marker, offset + 1) >= 0:
        raise AssertionError("marker values of a message prototype are not unique")
    return offset


COVARIANCE_SLOTS: Final = (0, 1, 5, 6, 7, 11, 30, 31, 35)
"""Indices of a (3, 3) covariance of x, y, yaw in a row-major (6, 6) covariance of x to yaw."""


@functools.cache
def clock() -> MessageLayout:
    """``/clock`` with only the time."""
    kind = "rosgraph_msgs/msg/Clock"
    return derive_layout("/clock", kind, lambda mark: ros.make(kind, clock=mark.stamp()))


@functools.cache
def odometry(topic: str, frame: str) -> MessageLayout:
    """``/odom`` and ``/ground_truth``: x, y, qz, qw in ``frame``, vx, vy, wz in base_link."""
    kind = "nav_msgs/msg/Odometry"

    def build(mark: FieldMarker) -> Any:
        pose = ros.pose(mark.f8("x"), mark.f8("y"), mark.f8("qz"), mark.f8("qw"))
        twist = ros.twist(mark.f8("vx"), mark.f8("vy"), mark.f8("wz"))
        return ros.odometry(mark.stamp(), frame, "base_link", pose, twist)

    return derive_layout(topic, kind, build)


def numbered(name: str, index: int) -> str:
    """Return the name of a field of the transform at ``index``; the first has no number."""
    return f"{name}{index or ''}"


@functools.lru_cache(maxsize=64)
def transforms(frames: tuple[tuple[str, str], ...]) -> MessageLayout:
    """``/tf`` with one transform per (parent, child): x, y, qz, qw, x1, ..., see `numbered`."""
    kind = "tf2_msgs/msg/TFMessage"

    def build(mark: FieldMarker) -> Any:
        return ros.make(
            kind,
            transforms=[
                ros.transform(
                    mark.stamp(f"stamp{i}"),
                    parent,
                    child,
                    x=mark.f8(numbered("x", i)),
                    y=mark.f8(numbered("y", i)),
                    qz=mark.f8(numbered("qz", i)),
                    qw=mark.f8(numbered("qw", i)),
                )
                for i, (parent, child) in enumerate(frames)
            ],
        )

    return derive_layout("/tf", kind, build)


@functools.lru_cache(maxsize=16)
def scan(laser: Laser) -> MessageLayout:
    """``/scan``, or ``/scan_NAME``: ranges (rays,) float32."""
    kind = "sensor_msgs/msg/LaserScan"

    def build(mark: FieldMarker) -> Any:
        ranges = mark.f4s("ranges", laser.rays)
        return ros.scan(mark.stamp(), laser.frame, laser, ranges)

    return derive_layout(f"/{laser.topic}", kind, build)


@functools.cache
def command() -> MessageLayout:
    """``/cmd_vel``: vx, vy, wz in base_link."""
    kind = "geometry_msgs/msg/TwistStamped"
    return derive_layout(
        "/cmd_vel",
        kind,
        lambda mark: ros.make(
            kind,
            header=ros.header(mark.stamp(), "base_link"),
            twist=ros.twist(mark.f8("vx"), mark.f8("vy"), mark.f8("wz")),
        ),
    )


@functools.cache
def estimate(topic: str) -> MessageLayout:
    """``/pose`` and ``/particle_cloud/summary``: x, y, qz, qw and c0..c8 in map."""
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"

    def build(mark: FieldMarker) -> Any:
        pose = ros.pose(mark.f8("x"), mark.f8("y"), mark.f8("qz"), mark.f8("qw"))
        covariance = {slot: mark.f8(f"c{i}") for i, slot in enumerate(COVARIANCE_SLOTS)}
        return ros.uncertain_pose(mark.stamp(), "map", pose, covariance)

    return derive_layout(topic, kind, build)


@functools.cache
def count() -> MessageLayout:
    """``/particle_cloud/count``: number of particles of the summary of the same time."""
    kind = "std_msgs/msg/UInt32"
    return derive_layout(
        "/particle_cloud/count", kind, lambda m: ros.make(kind, data=m.u4("count"))
    )


@functools.cache
def latency() -> MessageLayout:
    """``/sut/latency``: wall time of the answer of an external system [s]."""
    kind = "std_msgs/msg/Float64"
    return derive_layout("/sut/latency", kind, lambda m: ros.make(kind, data=m.f8("seconds")))


@functools.lru_cache(maxsize=64)
def joints(names: tuple[str, ...]) -> MessageLayout:
    """``/joint_states``: position (k,) and velocity (k,) of the named joints."""
    kind = "sensor_msgs/msg/JointState"
    return derive_layout(
        "/joint_states",
        kind,
        lambda mark: ros.make(
            kind,
            header=ros.header(mark.stamp(), ""),
            name=list(names),
            position=mark.f8s("position", len(names)),
            velocity=mark.f8s("velocity", len(names)),
            effort=np.zeros(0),
        ),
    )


# One layout per pair of names, because names are constant bytes. A run has few pairs, but a process
# that reads many traces has many.
@functools.lru_cache(maxsize=1024)
def contact(first: str, second: str) -> MessageLayout:
    """``/contacts`` with one contact between two named bodies: px, py, nx, ny, depth in map."""

    def build(mark: FieldMarker) -> Any:
        nothing = ros.vector(0.0, 0.0)
        state = ros.make(
            "gazebo_msgs/msg/ContactState",
            info="",
            collision1_name=first,
            collision2_name=second,
            wrenches=[],
            total_wrench=ros.make("geometry_msgs/msg/Wrench", force=nothing, torque=nothing),
            contact_positions=[ros.vector(mark.f8("px"), mark.f8("py"))],
            contact_normals=[ros.vector(mark.f8("nx"), mark.f8("ny"))],
            depths=np.array([mark.f8("depth")]),
        )
        return ros.make(ros.CONTACTS, header=ros.header(mark.stamp(), "map"), states=[state])

    return derive_layout("/contacts", ros.CONTACTS, build)
