"""Writer of the MCAP container for whole columns of messages per chunk.

The mcap library's ``Writer`` spends about 4 us of Python on each message, more than its encoding
and compression take. This writer gets the bytes of a chunk, one block per channel, and sorts and
indexes them with numpy. The mcap library still makes the records that occur once per file or
chunk.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO, Final

import numpy as np
import numpy.typing as npt
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

from daemon.trace.layouts import HEADER, MESSAGE_OPCODE, ByteArray, IntArray, MessageLayout

MAGIC: Final = b"\x89MCAP0\r\n"
LIBRARY: Final = "scenario-tui"
PROFILE: Final = "ros2"
COMPRESSION_LEVEL: Final = 1
"""Measured on a minute of driving: 3.3 us a message and 1254 kB; the library's writer with its
default level takes 6.3 us and 1234 kB. The noise of laser ranges does not compress at any level."""

_CHUNK_HEAD: Final = struct.Struct("<BQQQQII4sQ")
"""Opcode, length, first and last time, size and checksum before compression, length and name of the
compression, compressed size. The data follow; the mcap library's ``Chunk`` would copy them three
times."""
_COMPRESSION: Final = b"zstd"
_INDEX_HEAD: Final = struct.Struct("<BQHI")
_INDEX_NUMBER: Final = np.dtype("<i8")
"""Time [ns] of an entry, and its offset in the chunk [bytes]. The numbers of the format are
unsigned, equal to these below 2**63."""


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


def _interleave(blocks: Sequence[MessageBlock]) -> tuple[IntArray, IntArray, IntArray, ByteArray]:
    """Sort the messages of some blocks by time, one behind the other in one array of bytes.

    Return channels, times [ns] and offsets (n,), and the bytes. Messages of one instant are sorted
    by channel. Messages of a block keep their order, even if their times go back, so that a reader
    notices it.
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
    return channels[order], times[order], offsets, data


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


class McapWriter:
    """Writer of an MCAP file to a binary stream; the same calls give the same bytes."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._compressor = zstandard.ZstdCompressor(level=COMPRESSION_LEVEL)
        self._sha256 = hashlib.sha256()
        self._crc = 0
        self._size = 0
        self._data_end: tuple[int, Any, int] | None = None
        self._schemas: list[records.Schema] = []
        self._channels: list[records.Channel] = []
        self._chunks: list[records.ChunkIndex] = []
        self._attachments: list[records.AttachmentIndex] = []
        self._metadata: list[records.MetadataIndex] = []
        self._counts: dict[int, int] = {}
        self._span: tuple[int, int] | None = None
        self._write(MAGIC + _record_bytes(records.Header(profile=PROFILE, library=LIBRARY)))

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._size

    @property
    def sha256(self) -> str:
        """SHA-256 of everything written so far, in hexadecimal."""
        return self._sha256.hexdigest()

    @property
    def messages(self) -> int:
        """Messages written so far."""
        return sum(self._counts.values())

    @property
    def finished(self) -> bool:
        """True when the file has its end."""
        return self._data_end is not None

    @property
    def last(self) -> int:
        """Time of the latest message written so far [ns]."""
        return self._span[1] if self._span else 0

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment, with 0 as its times because it has no simulated time."""
        attachment = records.Attachment(
            create_time=0, log_time=0, name=name, media_type=media_type, data=data
        )
        offset, length = self._write(_record_bytes(attachment))
        self._attachments.append(
            records.AttachmentIndex(
                offset=offset, length=length, log_time=0, create_time=0,
                data_size=len(data), name=name, media_type=media_type,
            )
        )  # fmt: skip

    def add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Write a metadata record."""
        offset, length = self._write(
            _record_bytes(records.Metadata(name=name, metadata=dict(entries)))
        )
        self._metadata.append(records.MetadataIndex(offset=offset, length=length, name=name))

    def add_channel(self, topic: str, kind: str, text: str, metadata: Mapping[str, str]) -> int:
        """Declare a topic of CDR messages; returns its channel id (1, 2, ... in this order).

        Declarations are in the first chunk, so all channels come before any chunk.
        """
        ids = [schema.id for schema in self._schemas if schema.name == kind]
        if not ids:
            ids = [len(self._schemas) + 1]
            self._schemas.append(
                records.Schema(id=ids[0], name=kind, encoding="ros2msg", data=text.encode())
            )
        channel = records.Channel(
            id=len(self._channels) + 1, topic=topic, message_encoding="cdr",
            metadata=dict(metadata), schema_id=ids[0],
        )  # fmt: skip
        self._channels.append(channel)
        return channel.id

    def add_chunk(self, blocks: Sequence[MessageBlock]) -> None:
        """Write blocks of messages as one compressed chunk in the order of time, and the index."""
        blocks = [block for block in blocks if len(block.times)]
        if not blocks:
            return
        channels, times, offsets, messages = _interleave(blocks)
        # Schemas and channels go into the first chunk and are compressed with it.
        declarations = () if self._chunks else (*self._schemas, *self._channels)
        head = b"".join(map(_record_bytes, declarations))
        data = b"".join((head, messages.data)) if head else messages.data
        compressed = self._compressor.compress(data)
        offset = self._size
        length = _CHUNK_HEAD.size + len(compressed)
        start, end = int(times.min()), int(times.max())
        self._write(
            _CHUNK_HEAD.pack(
                Opcode.CHUNK, length - 9, start, end, len(data), zlib.crc32(data),
                len(_COMPRESSION), _COMPRESSION, len(compressed),
            )
        )  # fmt: skip
        self._write(compressed)
        index, index_offsets = self._index(channels, times, offsets + len(head))
        self._write(index)
        self._chunks.append(
            records.ChunkIndex(
                message_start_time=start, message_end_time=end, chunk_start_offset=offset,
                chunk_length=length, message_index_offsets=index_offsets,
                message_index_length=len(index), compression=_COMPRESSION.decode(),
                compressed_size=len(compressed), uncompressed_size=len(data),
            )
        )  # fmt: skip
        first, last = self._span or (start, end)
        self._span = (min(first, start), max(last, end))

    def finish(self) -> None:
        """Write the end of the data, the summary and the footer."""
        self._data_end = self._size, self._sha256.copy(), self._crc
        self._write(_record_bytes(records.DataEnd(data_section_crc=self._crc)))
        # In the order of the mcap library's own writer; the format allows any.
        groups: list[tuple[Opcode, Sequence[Any]]] = [
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        ]
        start, at = self._size, self._size
        summary, offsets = [], []
        for opcode, group in groups:
            data = b"".join(map(_record_bytes, group))
            if data:
                summary.append(data)
                offsets.append(
                    records.SummaryOffset(
                        group_opcode=opcode, group_start=at, group_length=len(data)
                    )
                )
            at += len(data)
        body = b"".join([*summary, *map(_record_bytes, offsets)])
        # The format's summary checksum covers the footer up to the checksum itself.
        head = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, at)
        footer = records.Footer(
            summary_start=start, summary_offset_start=at, summary_crc=zlib.crc32(body + head)
        )
        self._write(body + _record_bytes(footer) + MAGIC)

    def reopen(self) -> None:
        """Remove the end of a finished file, so that more can be added."""
        if self._data_end is not None:
            self._size, self._sha256, self._crc = self._data_end
            self._stream.seek(self._size)
            self._stream.truncate()
            self._data_end = None

    def _index(
        self, channels: IntArray, times: IntArray, offsets: IntArray
    ) -> tuple[bytes, dict[int, int]]:
        """Return the message indexes of a chunk and the position of each in the file."""
        # By channel, and in each by time, which is the order for readers. The sort is stable:
        # messages of one instant stay in the order of their recording.
        order = np.lexsort((times, channels))
        numbers, first = np.unique(channels[order], return_index=True)
        entries = np.empty((len(order), 2), _INDEX_NUMBER)
        entries[:, 0], entries[:, 1] = times[order], offsets[order]
        parts, index_offsets, position = [], {}, self._size
        for channel, rows in zip(numbers.tolist(), np.split(entries, first[1:]), strict=True):
            data = rows.tobytes()
            index_offsets[channel] = position
            parts.append(_INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + len(data), channel, len(data)))
            parts.append(data)
            position += _INDEX_HEAD.size + len(data)
            self._counts[channel] = self._counts.get(channel, 0) + len(rows)
        return b"".join(parts), index_offsets

    def _statistics(self) -> records.Statistics:
        start, end = self._span or (0, 0)
        return records.Statistics(
            attachment_count=len(self._attachments), channel_count=len(self._channels),
            channel_message_counts=dict(sorted(self._counts.items())),
            chunk_count=len(self._chunks), message_count=self.messages,
            metadata_count=len(self._metadata), message_start_time=start,
            message_end_time=end, schema_count=len(self._schemas),
        )  # fmt: skip

    def _write(self, data: bytes) -> tuple[int, int]:
        offset = self._size
        self._stream.write(data)
        self._sha256.update(data)
        self._crc = zlib.crc32(data, self._crc)
        self._size += len(data)
        return offset, len(data)


def _record_bytes(record: Any) -> bytes:
    builder: Any = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data
