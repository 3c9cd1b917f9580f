"""Walking an MCAP file: metadata, attachments, and runs of equal-sized messages per topic.

Nothing a file claims is believed: lengths are held against the bytes that are there, chunk
sizes against limits before anything is decompressed, checksums against what comes out.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from daemon.trace._mcap_writer import MAGIC
from daemon.trace._model import TraceError
from daemon.trace.layouts import HEADER, ByteArray, MessageLayout
from daemon.trace.messages import KINDS, is_scan

FILE_LIMIT: Final = 1 << 30
CHUNK_LIMIT: Final = 1 << 28
TOTAL_LIMIT: Final = 1 << 29
"""Largest file, chunk and sum of decompressed chunks [bytes] a reader takes on."""

RUN_LIMIT: Final = 1 << 21
"""Most runs of messages a reader takes on; the writer makes one per topic and ten seconds."""

_RECORD: Final = struct.Struct("<BQ")
_HEAD: Final = struct.Struct("<BQH")
_CHUNK_HEAD: Final = struct.Struct("<QQQII")
_LENGTH: Final = struct.Struct("<Q")
_CHANNEL: Final = struct.Struct("<H")
_WINDOW: Final = 512
"""Rows compared at a time, so that short runs (events, contacts) cost no pass over the chunk."""
_FEW: Final = 8
"""So many rows are compared one by one: hardly two plans in a row are equally long."""


class DamagedTraceError(Exception):
    """What follows cannot be read; the message says why."""


@dataclass(slots=True)
class McapContents:
    """What a file holds: ``runs`` are rows of message records (n, size), in file order.

    Those of topics whose layout was known are in ``packed``, as :meth:`MessageLayout.pack` has
    them; rows that do not fit it stay in ``runs``. ``cut`` says why reading stopped before the end
    of the file, or is empty.
    """

    path: Path
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    runs: dict[str, list[ByteArray]] = field(default_factory=dict)
    packed: dict[str, list[npt.NDArray[np.void]]] = field(default_factory=dict)
    cut: str = ""


def read_mcap(
    path: Path,
    topics: Collection[str],
    *,
    layouts: Mapping[str, MessageLayout] | None = None,
    scans: bool = False,
) -> McapContents:
    """Read the messages on ``topics`` and everything that is not a message.

    With ``scans`` also those of all lasers, whose names are only known afterwards. With ``layouts``
    of topics a chunk is let go of when it has been read, and what it says is kept: of a run of the
    reference stack 2 MB instead of 26.

    Raises :class:`TraceError` when the file cannot be opened or is no MCAP file.
    """
    try:
        if path.stat().st_size > FILE_LIMIT:
            raise TraceError(path, f"the file is larger than {FILE_LIMIT >> 20} MiB")
        data = path.read_bytes()
    except OSError as error:
        raise TraceError(path, f"cannot be read: {error.strerror}") from error
    if not data.startswith(MAGIC):
        raise TraceError(
            path,
            "is empty" if not data else "is not an MCAP file",
            "traces are the .mcap files a run leaves; run it again to get one",
        )
    walk = _McapWalk(McapContents(path), data, topics, layouts, scans)
    try:
        walk.run()
    except DamagedTraceError as error:
        walk.recording.cut = f"{error} (at byte {walk.at} of {len(data)})"
    return walk.recording


class McapFollower:
    """Reads an MCAP file while its writer, which has flushed it, is still at work.

    Every call takes up where the one before stopped, so that what was read is not read again.
    """

    def __init__(
        self, path: Path, topics: Collection[str], layouts: Mapping[str, MessageLayout]
    ) -> None:
        self._walk = _McapWalk(McapContents(path), b"", topics, layouts, False)
        self._read = 0

    def read_on(self, pending: bytes) -> McapContents:
        """Return everything so far; ``pending`` are message records that no chunk holds yet.

        Raises ``OSError`` and :class:`DamagedTraceError`.
        """
        walk = self._walk
        with walk.recording.path.open("rb") as file:
            file.seek(self._read)
            walk.take(file.read(), 0 if self._read else len(MAGIC))
        with suppress(DamagedTraceError):  # the end, as far as there is one
            walk.run()
        self._read += walk.at
        return walk.with_records(pending)


class _McapWalk:
    """One pass over the records of a file."""

    def __init__(
        self,
        recording: McapContents,
        data: bytes,
        topics: Collection[str],
        layouts: Mapping[str, MessageLayout] | None,
        scans: bool,
    ) -> None:
        self.recording = recording
        self.at = len(MAGIC)
        self._data = data
        self._topics, self._layouts, self._scans = topics, layouts, scans
        self._decompressor = zstandard.ZstdDecompressor()
        self._channels: dict[int, str] = {}
        self._schemas: dict[int, str] = {}
        self._total = 0
        self._runs = 0

    def take(self, data: bytes, at: int) -> None:
        """Go on with other data, which begins ``at`` that byte."""
        self._data, self.at = data, at

    def with_records(self, data: bytes) -> McapContents:
        """Return what was read with these records, of which nothing is kept here."""
        before = self.recording
        self.recording = replace(
            before,
            metadata={**before.metadata},
            runs={topic: [*rows] for topic, rows in before.runs.items()},
            packed={topic: [*rows] for topic, rows in before.packed.items()},
        )
        try:
            self._records(data)
            return self.recording
        finally:
            self.recording = before

    def run(self) -> None:
        """Read up to the end of the data; raises :class:`DamagedTraceError` when it is cut."""
        data = self._data
        while True:
            opcode, content = self._record(self.at)
            if opcode == Opcode.CHUNK:
                self._chunk(content)
            elif opcode == Opcode.DATA_END:
                break
            elif opcode == Opcode.MESSAGE:
                raise DamagedTraceError("messages outside chunks are not read")
            elif opcode != Opcode.MESSAGE_INDEX:
                self._rare(opcode, data[content.start : content.stop])
            self.at = content.stop
        if not data.endswith(MAGIC):
            raise DamagedTraceError("the end of the file is missing")

    def _record(self, at: int) -> tuple[int, slice]:
        if at + _RECORD.size > len(self._data):
            raise DamagedTraceError("the file is cut")
        opcode, length = _RECORD.unpack_from(self._data, at)
        start = at + _RECORD.size
        if length > len(self._data) - start:
            raise DamagedTraceError("the file is cut or damaged")
        return opcode, slice(start, start + length)

    def _rare(self, opcode: int, content: bytes) -> None:
        """Read a record that is neither chunk nor message."""
        kinds: dict[int, Any] = {
            Opcode.SCHEMA: records.Schema,
            Opcode.CHANNEL: records.Channel,
            Opcode.METADATA: records.Metadata,
            Opcode.ATTACHMENT: records.Attachment,
        }
        # Statistics, indexes and what later versions of the format add: nothing we need.
        if opcode not in kinds:
            return
        try:
            record = kinds[opcode].read(ReadDataStream(io.BytesIO(content)))
        except (McapError, struct.error, ValueError, OverflowError) as error:
            # The mcap library takes lengths inside of a record as they are, up to 2**64.
            raise DamagedTraceError(f"a damaged {kinds[opcode].__name__.lower()} record") from error
        if isinstance(record, records.Schema):
            self._schemas[record.id] = record.name
        elif isinstance(record, records.Channel):
            kind = KINDS.get(record.topic)
            # Topics that are not ours may be anything: merged files and other tools' additions.
            if kind is not None and self._schemas.get(record.schema_id) != kind:
                raise DamagedTraceError(f"{record.topic} is not {kind}")
            self._channels[record.id] = record.topic
        elif isinstance(record, records.Metadata):
            self.recording.metadata[record.name] = record.metadata
        else:
            self.recording.attachments[record.name] = record.data

    def _chunk(self, content: slice) -> None:
        if not self._wanted(content.stop):
            return
        self._records(self._decompressed(content))

    def _records(self, data: bytes) -> None:
        at = 0
        while at < len(data):
            if at + _RECORD.size > len(data):
                raise DamagedTraceError("a damaged chunk")
            opcode, length = _RECORD.unpack_from(data, at)
            end = at + _RECORD.size + length
            if end > len(data):
                raise DamagedTraceError("a damaged chunk")
            if opcode == Opcode.MESSAGE:
                end = self._messages(data, at, end)
            else:
                self._rare(opcode, data[at + _RECORD.size : end])
            at = end

    def _wanted(self, at: int) -> bool:
        """Whether the chunk before ``at`` must be opened, by the message indexes after it."""
        indexed = False
        while True:
            try:
                opcode, content = self._record(at)
            except DamagedTraceError:
                # Cut right behind the chunk: its index is lost, the chunk is not.
                return True
            if opcode != Opcode.MESSAGE_INDEX:
                return not indexed
            if content.stop - content.start < _CHANNEL.size:
                raise DamagedTraceError("a damaged message index")
            (channel,) = _CHANNEL.unpack_from(self._data, content.start)
            topic = self._channels.get(channel)
            if topic is None or self._collected(topic):
                return True
            indexed = True
            at = content.stop

    def _collected(self, topic: str) -> bool:
        return topic in self._topics or (self._scans and is_scan(topic))

    def _decompressed(self, content: slice) -> bytes:
        raw = memoryview(self._data)[content]
        if len(raw) < _CHUNK_HEAD.size:
            raise DamagedTraceError("a damaged chunk")
        _, _, size, crc, named = _CHUNK_HEAD.unpack_from(raw)
        start = _CHUNK_HEAD.size + named + _LENGTH.size
        if start > len(raw):
            raise DamagedTraceError("a damaged chunk")
        if _LENGTH.unpack_from(raw, start - _LENGTH.size)[0] != len(raw) - start:
            raise DamagedTraceError("a damaged chunk")
        self._total += size
        # Before decompressing: a few bytes of zstd can claim, and become, gigabytes.
        if size > CHUNK_LIMIT or self._total > TOTAL_LIMIT:
            raise TraceError(
                self.recording.path,
                f"holds more than {TOTAL_LIMIT >> 20} MiB of messages, or a chunk too large",
            )
        method = bytes(raw[_CHUNK_HEAD.size : start - _LENGTH.size])
        data = decompress(raw[start:], method, size, decompressor=self._decompressor)
        if crc and zlib.crc32(data) != crc:
            raise DamagedTraceError("a chunk with a wrong checksum")
        return data

    def _messages(self, data: bytes, at: int, end: int) -> int:
        """Collect the run of equal-sized messages of one channel that starts at ``at``.

        Returns where the run ends.
        """
        size = end - at
        if size < HEADER.size:
            raise DamagedTraceError("a message without a header")
        head = data[at : at + _HEAD.size]
        topic = self._channels.get(_HEAD.unpack(head)[2])
        if topic is None:
            raise DamagedTraceError("a message on an unknown channel")
        count = 1
        if data.startswith(head, end):
            count = _run_length(data, at, size, head)
            end = at + count * size
        if self._collected(topic):
            self._runs += 1
            if self._runs > RUN_LIMIT:
                raise TraceError(self.recording.path, "holds too many scattered messages")
            rows = np.frombuffer(data, np.uint8, count * size, at).reshape(count, size)
            self._collect(topic, rows)
        return end

    def _collect(self, topic: str, rows: ByteArray) -> None:
        layout = None if self._layouts is None else self._layouts.get(topic)
        if layout is not None and layout.fits_all(rows):
            self.recording.packed.setdefault(topic, []).append(layout.pack(rows))
            return
        if self._layouts is not None and not is_scan(topic):
            # A view would keep the whole chunk. Most of a chunk with scans is scans.
            rows = rows.copy()
        self.recording.runs.setdefault(topic, []).append(rows)


def _run_length(data: bytes, at: int, size: int, head: bytes) -> int:
    """Return how many records of ``size`` bytes starting with ``head`` lie from ``at`` on."""
    count, most = 0, (len(data) - at) // size
    while count < min(most, _FEW):
        if not data.startswith(head, at + count * size):
            return count
        count += 1
    # As two numbers of eight bytes that overlap: a third of the time of eleven bytes one by one.
    tail = len(head) - 8
    first, last = (int.from_bytes(head[i : i + 8], "little") for i in (0, tail))
    while count < most:
        step = min(_WINDOW, most - count)
        start = at + count * size
        firsts = np.ndarray((step,), "<u8", data, start, (size,))
        lasts = np.ndarray((step,), "<u8", data, start + tail, (size,))
        same = (firsts == first) & (lasts == last)
        other = int(same.argmin())
        if not same[other]:
            return count + other
        count += step
    return count


def decompress(
    data: bytes | memoryview,
    method: bytes,
    size: int | None,
    limit: int = CHUNK_LIMIT,
    *,
    decompressor: zstandard.ZstdDecompressor | None = None,
) -> bytes:
    """Decompress exactly ``size`` bytes, or any number up to ``limit`` when it is ``None``.

    With a ``decompressor`` that serves many chunks none is made for each. Memory is only taken for
    what is allowed. Raises :class:`DamagedTraceError` for anything else.
    """
    most = limit if size is None else size
    try:
        if method == b"zstd":
            # As a stream: ``decompress`` allocates what the frame's header claims.
            claimed = zstandard.frame_content_size(data)
            own = decompressor or zstandard.ZstdDecompressor()
            with own.stream_reader(data) as reader:
                found = reader.read(1 + (min(claimed, most) if claimed >= 0 else most))
        elif method == b"":
            found = bytes(data)
        else:
            raise DamagedTraceError(f"unknown compression {method[:16]!r}")
    except zstandard.ZstdError as error:
        raise DamagedTraceError("a chunk that cannot be decompressed") from error
    if len(found) > most or (size is not None and len(found) != size):
        raise DamagedTraceError("a chunk of another size than it says")
    return found
