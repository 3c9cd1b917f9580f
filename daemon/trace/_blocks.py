"""Messages for a chunk: collected by channel, then sorted by time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from daemon.trace.layouts import HEADER, MESSAGE_OPCODE, ByteArray, IntArray, MessageLayout


@dataclass(frozen=True, slots=True, eq=False)
class MessageBlock:
    """Message records of one channel: ``times`` (n,) [ns] and ``offsets`` (n,) in ``data``.

    A memory view as ``data`` has single bytes.
    """

    channel: int
    times: IntArray
    offsets: IntArray
    data: bytes | memoryview

    @property
    def sizes(self) -> IntArray:
        """Size of each record (n,) [bytes]."""
        # A third of the time of np.diff with its append, for every block of every chunk.
        sizes = np.empty_like(self.offsets)
        np.subtract(self.offsets[1:], self.offsets[:-1], out=sizes[:-1])
        sizes[-1:] = len(self.data) - self.offsets[-1:]
        return sizes


@dataclass(frozen=True, slots=True, eq=False)
class MessageTable:
    """Message records of many channels, one behind the other in ``data``.

    ``channels``, ``times`` [ns] and ``offsets`` [bytes] are (n,), in the order of the records.
    """

    channels: IntArray
    times: IntArray
    offsets: IntArray
    data: ByteArray


def split_blocks(
    blocks: Iterable[MessageBlock], before: int | None
) -> tuple[list[MessageBlock], list[MessageBlock]]:
    """Return the messages earlier than ``before`` [ns], or all for ``None``, and the rest.

    In a block that goes back in time, everything up to its last earlier message is early.
    """
    early, late = [], []
    for block in blocks:
        count = len(block.times)
        if before is not None and count:
            earlier = np.flatnonzero(block.times < before)
            count = int(earlier[-1]) + 1 if len(earlier) else 0
        if count:
            early.append(_part(block, 0, count))
        if count < len(block.times):
            late.append(_part(block, count, len(block.times)))
    return early, late


def interleave(blocks: Sequence[MessageBlock]) -> MessageTable:
    """Sort the messages of some blocks by time.

    Messages of one instant are sorted by channel. Messages of a block keep their order, even if
    their times go back, so that a reader notices it.
    """
    counts = [len(block.times) for block in blocks]
    channels = np.repeat([block.channel for block in blocks], counts)
    times = np.concatenate([block.times for block in blocks])
    due = np.concatenate([np.maximum.accumulate(block.times) for block in blocks])
    sizes = [block.sizes for block in blocks]
    order = np.lexsort((channels, due))
    ordered = np.concatenate(sizes)[order]
    ends = np.cumsum(ordered)
    offsets = ends - ordered
    places = np.empty(len(order), np.int64)
    places[order] = offsets
    data = np.empty(int(ends[-1]), np.uint8)
    first = 0
    for block, each, count in zip(blocks, sizes, counts, strict=True):
        _scatter(block, each, data, places[first : first + count])
        first += count
    return MessageTable(channels[order], times[order], offsets, data)


def records_at_any_place(data: bytes | memoryview | ByteArray, size: int) -> ByteArray:
    """Return a view with a row for every possible place of a record of ``size`` bytes.

    It allows reading or writing many records at once. Shape (len(data) - size + 1, size).
    """
    return np.ndarray((len(data) - size + 1, size), np.uint8, data, 0, (1, 1))


def _part(block: MessageBlock, first: int, stop: int) -> MessageBlock:
    """Return the messages ``first`` to ``stop`` of a block."""
    if stop - first == len(block.times):
        return block
    start = int(block.offsets[first])
    end = int(block.offsets[stop]) if stop < len(block.times) else len(block.data)
    offsets = block.offsets[first:stop] - start
    return MessageBlock(block.channel, block.times[first:stop], offsets, block.data[start:end])


def _scatter(block: MessageBlock, sizes: IntArray, data: ByteArray, places: IntArray) -> None:
    """Copy the records of a block to their ``places`` (n,) in ``data``."""
    rows = np.frombuffer(block.data, np.uint8)
    size = int(sizes[0])
    if (sizes == size).all():
        records_at_any_place(data, size)[places] = rows.reshape(-1, size)
        return
    for place, start, length in zip(
        places.tolist(), block.offsets.tolist(), sizes.tolist(), strict=True
    ):
        data[place : place + length] = rows[start : start + length]


class MessageRecords:
    """Serialised messages of one channel, for rare topics and those of varying size."""

    __slots__ = ("_channel", "_lengths", "_parts", "_times", "size")

    def __init__(self, channel: int) -> None:
        self._channel = channel
        self._times: list[int] = []
        self._lengths: list[int] = []
        self._parts: list[bytes] = []
        self.size = 0

    def add(self, time: int, payload: bytes) -> None:
        """Append a serialized message."""
        length = HEADER.size + len(payload)
        self._times.append(time)
        self._lengths.append(length)
        self._parts.append(HEADER.pack(MESSAGE_OPCODE, length - 9, self._channel, 0, time, time))
        self._parts.append(payload)
        self.size += length

    def peek(self) -> MessageBlock:
        """Return the messages as a block, and keep them."""
        return MessageBlock(
            self._channel,
            np.array(self._times, np.int64),
            np.cumsum([0, *self._lengths[:-1]], dtype=np.int64)[: len(self._times)],
            b"".join(self._parts),
        )

    def drain(self) -> MessageBlock:
        """Return the messages as a block and clear them."""
        block = self.peek()
        self._times, self._lengths, self._parts, self.size = [], [], [], 0
        return block


def encode_block(
    layout: MessageLayout, channel: int, times: IntArray, columns: dict[str, npt.NDArray[Any]]
) -> MessageBlock:
    """Encode columns as a block of messages with the given layout."""
    if not len(times):
        return MessageBlock(channel, times, times, b"")
    rows = layout.encode(channel, times, columns)
    offsets = np.arange(0, rows.size, rows.shape[1], dtype=np.int64)
    return MessageBlock(channel, times, offsets, rows.reshape(-1).data)
