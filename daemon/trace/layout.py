"""Fixed-size CDR messages as numpy record types, derived from rosbags' own serializer.

A prototype message carries unmistakable marker values where the data will go; serializing it
once with rosbags shows where each field lies. Whole columns of messages are then written and
read with a handful of numpy assignments, and agree with rosbags byte for byte by construction.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from daemon.trace.messages import make, serialize

MESSAGE_OPCODE: Final = 0x05
HEADER: Final = struct.Struct("<BQHIQQ")
"""Head of an MCAP message record: opcode, length, channel, sequence, log and publish time."""

_HEADER_FIELDS: Final = {
    "channel": ("<u2", 9),
    "log_time": ("<u8", 15),
    "publish_time": ("<u8", 23),
}

Bytes = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.int64]


@dataclass(slots=True)
class Mark:
    """Hands out marker values for a prototype message and remembers what they stand for."""

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
        steps = np.arange(count) / max(3 * count, 1)
        values: npt.NDArray[Any] = (12345.0 + len(self.slots) + steps).astype(kind)
        self.slots.append((name, "<f8" if kind is np.float64 else "<f4", shape, values.tobytes()))
        return values


@dataclass(frozen=True, slots=True)
class Layout:
    """A fixed-size message on ``topic``: ``record`` is the numpy type of its MCAP record.

    ``template`` holds the record's constant bytes; ``constant`` lists where they lie, as
    (start, stop), for checking what a file claims to contain.
    """

    topic: str
    record: np.dtype[np.void]
    template: Bytes
    constant: tuple[tuple[int, int], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Fields of the message that vary, without the header's."""
        assert self.record.names is not None
        return tuple(n for n in self.record.names if n not in _HEADER_FIELDS)

    def encode(self, channel: int, times: Ints, columns: Mapping[str, npt.NDArray[Any]]) -> Bytes:
        """Return the MCAP message records of a channel, one row of bytes per message.

        ``times`` (n,) in nanoseconds; ``columns`` holds an array (n, ...) per field but the
        stamps, which are the times.
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

    def view(self, rows: Bytes) -> npt.NDArray[np.void]:
        """Return rows of bytes (n, size) read from a file as records (n,)."""
        records: npt.NDArray[np.void] = np.ascontiguousarray(rows).view(self.record)[:, 0]
        return records

    def fits(self, rows: Bytes) -> npt.NDArray[np.bool_]:
        """Return which rows of bytes (n, size) have this layout: size and constant bytes."""
        if rows.shape[1] != len(self.template):
            return np.zeros(len(rows), np.bool_)
        fits = np.ones(len(rows), np.bool_)
        for start, stop in self.constant:
            fits &= (rows[:, start:stop] == self.template[start:stop]).all(axis=1)
        return fits


def stamps(times: Ints) -> npt.NDArray[np.uint64]:
    """Return nanoseconds as CDR ``Time`` (int32 sec, uint32 nanosec) in one little-endian u64."""
    seconds, rest = np.divmod(times, 1_000_000_000)
    both: npt.NDArray[np.uint64] = (seconds | rest << 32).astype(np.uint64)
    return both


def derive(topic: str, kind: str, build: Callable[[Mark], Any]) -> Layout:
    """Derive the layout of the message type ``kind`` from a prototype built with marks."""
    mark = Mark()
    payload = serialize(build(mark), kind)
    head = HEADER.pack(MESSAGE_OPCODE, HEADER.size - 9 + len(payload), 0, 0, 0, 0)
    data = head + payload
    fields = {name: (np.dtype(form), at) for name, (form, at) in _HEADER_FIELDS.items()}
    constant = np.ones(len(data), np.bool_)
    constant[9 : HEADER.size] = False
    template = np.frombuffer(data, np.uint8).copy()
    for name, form, shape, marker in mark.slots:
        at = _only(data, marker)
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
    return Layout(topic, record, template, spans)


def _only(data: bytes, marker: bytes) -> int:
    """Return where ``marker`` lies; it must lie at exactly one place."""
    if not marker:
        return len(data)
    offset = data.find(marker, HEADER.size)
    if offset < 0 or data.find(marker, offset + 1) >= 0:
        raise AssertionError("marker values of a message prototype are not unique")
    return offset
